#include "hlm/geometry/clip.h"

#include <algorithm>
#include <optional>
#include <tuple>

#include "hlm/geometry/tolerances.h"

namespace hlm::geometry {
namespace {

/// The line on which a side of the clipped polygon lies.
struct Line {
  bool of_reference;
  std::size_t side;
};

/// Corner of the polygon that is left of the incident patch: one of its vertices, or a crossing
/// with a side of the reference.
struct ClipCorner {
  Vector3 p;
  Feature first;                  ///< The incident patch's vertex, edge or (two sides cross) face.
  std::optional<Feature> second;  ///< The reference's edge, if that crosses one.
  Line after;                     ///< Line of the side from here to the next corner.
};
using Polygon = StaticVector<ClipCorner, 2 * kMaxFaceCorners>;

Polygon polygon_of(const Patch& incident) {
  Polygon polygon;
  for (std::size_t i = 0; i < incident.corners.size(); ++i) {
    const auto& corner = incident.corners[i];
    polygon.push_back({corner.p, corner.vertex, {}, {false, i}});
  }
  return polygon;
}

/// The crossing of a side on `line` with side `border` of the reference.
ClipCorner crossing(const Vector3& p, Line line, std::size_t border, const Patch& incident,
                    const Patch& reference) {
  if (line.of_reference) return {p, incident.feature, {}, line};
  return {p, incident.corners[line.side].side, reference.corners[border].side, line};
}

/// One step of Sutherland and Hodgman's algorithm: what is inside of side `border`.
Polygon clip(const Polygon& polygon, std::size_t border, const Vector3& n, const Patch& incident,
             const Patch& reference) {
  const Vector3& from = reference.corners[border].p;
  const Vector3& to = reference.corners[(border + 1) % reference.corners.size()].p;
  const Vector3 up = reference.normal.dot(n) > 0 ? n : Vector3(-n);
  const Vector3 outward = (to - from).cross(up).normalized();
  const auto beyond = [&](const ClipCorner& corner) { return outward.dot(corner.p - from); };

  Polygon inside;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const ClipCorner& here = polygon[i];
    const ClipCorner& next = polygon[(i + 1) % polygon.size()];
    const double d_here = beyond(here);
    const double d_next = beyond(next);
    const auto cross_border = [&] {
      const Vector3 p = here.p + d_here / (d_here - d_next) * (next.p - here.p);
      return crossing(p, here.after, border, incident, reference);
    };
    if (d_here <= narrow::kAccuracy) inside.push_back(here);
    if (d_here <= narrow::kAccuracy && d_next > narrow::kAccuracy) {
      if (d_here < -narrow::kAccuracy) inside.push_back(cross_border());
      inside.back().after = {true, border};
    }
    if (d_here > narrow::kAccuracy && d_next < -narrow::kAccuracy) inside.push_back(cross_border());
  }
  return inside;
}

/// The point of the reference opposite a corner, and the features that meet: the incident patch's
/// vertex, else the reference's vertex if it is there, else two edges. None where two sides of the
/// reference cross that are not neighbours.
std::optional<Opposite> opposite(const ClipCorner& corner, const Vector3& n, const Patch& incident,
                                 const Patch& reference) {
  // A half-space has no corners; its plane is that of its frame.
  const Vector3 on_plane =
      reference.corners.empty() ? Vector3(Vector3::Zero()) : reference.corners[0].p;
  const double height = reference.normal.dot(on_plane - corner.p) / reference.normal.dot(n);
  const Vector3 foot = corner.p + height * n;
  if (corner.first.kind == FeatureKind::kVertex) {
    return Opposite{corner.p, foot, corner.first, reference.feature};
  }
  for (const auto& there : reference.corners) {
    if ((there.p - foot).norm() > narrow::kAccuracy) continue;
    return Opposite{corner.p, foot, incident.feature, there.vertex};
  }
  if (!corner.second) return {};
  return Opposite{corner.p, foot, corner.first, *corner.second};
}

bool has_pair(const Opposites& points, const Feature& first, const Feature& second) {
  return std::any_of(points.begin(), points.end(), [&](const Opposite& point) {
    return point.first == first && point.second == second;
  });
}

/// Lower for what stays of too many. The numbers of a hull's vertices are spread over it; those of
/// its edges are not, so that they are mixed.
std::uint32_t rank(const Opposite& point) {
  constexpr std::uint32_t kVertex = 1U << 16;
  constexpr std::uint32_t kMixing = 40503;  // Knuth's multiplier for 16 bits.
  if (point.first.kind == FeatureKind::kVertex) return kVertex + point.first.index;
  if (point.second.kind == FeatureKind::kVertex) return kVertex + point.second.index;
  return (kMixing * (point.first.index + point.second.index)) % kVertex;
}

void keep_most_spread(Opposites& points) {
  if (points.size() <= kMaxOpposites) return;
  // Points of equal rank differ in their features; a stable sort would allocate.
  std::sort(points.begin(), points.end(), [](const Opposite& a, const Opposite& b) {
    return std::tuple(rank(a), a.first, a.second) < std::tuple(rank(b), b.first, b.second);
  });
  points.erase(points.begin() + kMaxOpposites, points.end());
}

/// An edge with a coordinate along a direction.
struct Span {
  const Patch& patch;
  double u_first;  ///< Coordinate of the first corner, m; not always the smaller one.
  double u_last;   ///< Coordinate of the last corner, m.

  Span(const Patch& edge, const Vector3& along)
      : patch(edge), u_first(edge.corners[0].p.dot(along)), u_last(edge.corners[1].p.dot(along)) {}

  /// `slack` > 0 lengthens the span at both ends, m.
  bool contains(double u, double slack) const {
    return u >= std::min(u_first, u_last) - slack && u <= std::max(u_first, u_last) + slack;
  }
  Vector3 at(double u) const {
    const Vector3& start = patch.corners[0].p;
    return start + (u - u_first) / (u_last - u_first) * (patch.corners[1].p - start);
  }
};

}  // namespace

Opposites overlap(const Patch& incident, const Patch& reference, const Vector3& n) {
  Polygon polygon = polygon_of(incident);
  for (std::size_t border = 0; border < reference.corners.size(); ++border) {
    polygon = clip(polygon, border, n, incident, reference);
  }
  Opposites points;
  for (const ClipCorner& corner : polygon) {
    const auto point = opposite(corner, n, incident, reference);
    // The two sides of an edge seen as a polygon meet a border in one point.
    if (point && !has_pair(points, point->first, point->second)) points.push_back(*point);
  }
  keep_most_spread(points);
  return points;
}

Opposites overlap_of_edges(const Patch& first, const Patch& second) {
  if (first.corners.size() != 2 || second.corners.size() != 2) return {};
  const Vector3 e = (first.corners[1].p - first.corners[0].p).normalized();
  const Vector3 f = (second.corners[1].p - second.corners[0].p).normalized();
  const double parallel =
      first.round && second.round ? narrow::kParallelRoundEdges : narrow::kParallelEdges;
  if (e.cross(f).norm() > parallel) return {};
  const Span a(first, f);
  const Span b(second, f);
  Opposites points;
  for (const auto& corner : first.corners) {
    const double u = corner.p.dot(f);
    if (b.contains(u, narrow::kAccuracy)) {
      points.push_back({corner.p, b.at(u), corner.vertex, second.feature});
    }
  }
  for (const auto& corner : second.corners) {
    const double u = corner.p.dot(f);
    if (a.contains(u, -narrow::kAccuracy)) {
      points.push_back({a.at(u), corner.p, first.feature, corner.vertex});
    }
  }
  return points;
}

}  // namespace hlm::geometry
