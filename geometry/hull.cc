#include "hlm/geometry/hull.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include <libqhull_r/qhull_ra.h>

#include "hlm/common/range.h"
#include "hlm/geometry/interruption.h"
#include "hlm/geometry/tolerances.h"

namespace hlm::geometry {
namespace {

/// Largest coordinate, m.
constexpr double kFarthest = 1000;

using Triangle = std::array<std::uint16_t, 3>;

std::invalid_argument fault(const std::string& what) {
  return std::invalid_argument("convex hull: " + what);
}

/// Extent of the points perpendicular to the plane of the three that span most, m.
double thickness(std::span<const Vector3> points) {
  const Vector3& origin = points[0];
  const auto farthest = [&](auto&& measure) {
    return *std::max_element(points.begin(), points.end(), [&](const auto& a, const auto& b) {
      return measure(a - origin) < measure(b - origin);
    });
  };
  const Vector3 along = farthest([](const Vector3& d) { return d.norm(); }) - origin;
  if (!(along.norm() > 0)) return 0;
  const Vector3 u = along.normalized();
  const Vector3 across =
      farthest([&](const Vector3& d) { return (d - d.dot(u) * u).norm(); }) - origin;
  const Vector3 n = u.cross(across);
  if (!(n.norm() > narrow::kThinnest)) return 0;
  const Vector3 unit = n.normalized();
  double low = 0;
  double high = 0;
  for (const Vector3& p : points) {
    low = std::min(low, unit.dot(p - origin));
    high = std::max(high, unit.dot(p - origin));
  }
  return high - low;
}

void check(std::span<const Vector3> points) {
  if (points.size() < 4) {
    throw fault(std::to_string(points.size()) + " points; at least 4 are needed");
  }
  for (const Vector3& p : points) {
    const double largest = p.cwiseAbs().maxCoeff();
    const auto error = find_error("convex hull: coordinate", p.allFinite() ? largest : p.sum(),
                                  {-kFarthest, kFarthest, "m"});
    if (error) throw std::invalid_argument(*error);
  }
  if (!has_inside(points)) {
    throw fault("its points lie in a plane; it must be thicker than 1e-06 m");
  }
}

/// Qhull's answer: corners of triangles, counter-clockwise seen from outside, as indices of points.
std::vector<std::array<int, 3>> hull_triangles(std::span<const Vector3> points) {
  std::vector<double> coordinates;
  for (const Vector3& p : points) coordinates.insert(coordinates.end(), p.begin(), p.end());
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> nowhere(std::fopen("/dev/null", "w"),
                                                                &std::fclose);
  qhT memory;
  qhT* const qh = &memory;
  qh_zero(qh, nowhere.get());
  std::array<char, 16> command{"qhull Qt Pp"};
  const int failed = qh_new_qhull(qh, 3, static_cast<int>(points.size()), coordinates.data(), False,
                                  command.data(), nullptr, nowhere.get());
  std::vector<std::array<int, 3>> triangles;
  if (!failed) {
    for (const facetT* facet = qh->facet_list; facet && facet->next; facet = facet->next) {
      std::array<int, 3> corners{};
      for (std::size_t i = 0; i < 3; ++i) {
        const auto* vertex = static_cast<const vertexT*>(facet->vertices->e[i].p);
        corners[i] = qh_pointid(qh, vertex->point);
      }
      const auto at = [&](std::size_t i) { return points[static_cast<std::size_t>(corners[i])]; };
      const Vector3 area = (at(1) - at(0)).cross(at(2) - at(0));
      if (area.dot(Eigen::Map<const Vector3>(facet->normal)) < 0) std::swap(corners[0], corners[1]);
      triangles.push_back(corners);
    }
  }
  qh_freeqhull(qh, !qh_ALL);
  int kept = 0;
  int total = 0;
  qh_memfreeshort(qh, &kept, &total);
  if (failed) throw fault("Qhull finds none (its error " + std::to_string(failed) + ")");
  return triangles;
}

/// Each time the one farthest from all that are already there, from the first on.
std::vector<int> spread(const std::vector<int>& vertices, std::span<const Vector3> points) {
  std::vector<int> left = vertices;
  std::vector<double> distance(left.size(), std::numeric_limits<double>::infinity());
  std::vector<int> order;
  std::size_t next = 0;
  while (order.size() < vertices.size()) {
    interruption_point();
    const int chosen = left[next];
    order.push_back(chosen);
    distance[next] = -1;
    for (std::size_t i = 0; i < left.size(); ++i) {
      const double d =
          (points[static_cast<std::size_t>(left[i])] - points[static_cast<std::size_t>(chosen)])
              .squaredNorm();
      distance[i] = std::min(distance[i], d);
    }
    next = static_cast<std::size_t>(std::max_element(distance.begin(), distance.end()) -
                                    distance.begin());
  }
  return order;
}

/// Merges triangles into faces.
class Merger {
 public:
  Merger(const std::vector<Vector3>& vertices, const std::vector<Triangle>& triangles)
      : vertices_(vertices), triangles_(triangles), face_of_(triangles.size(), kNone) {
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      for (std::size_t i = 0; i < 3; ++i) {
        across_[{triangles[t][i], triangles[t][(i + 1) % 3]}] = t;
      }
    }
  }

  /// Adds faces to `faces`, the largest triangles' first.
  void merge(HullFaces& faces) {
    std::vector<std::size_t> order(triangles_.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return area(a).norm() > area(b).norm(); });
    for (const std::size_t seed : order) {
      if (face_of_[seed] != kNone) continue;
      interruption_point();
      const std::vector<std::size_t> members = grow(seed, faces.loops.size());
      auto loop = border(members);
      if (loop.size() < 3) continue;
      faces.normals.push_back(area(seed).normalized());
      faces.loops.push_back(std::move(loop));
    }
  }

 private:
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

  const Vector3& corner(std::size_t t, std::size_t i) const { return vertices_[triangles_[t][i]]; }
  Vector3 area(std::size_t t) const {
    return (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0));
  }
  std::size_t neighbour(std::size_t t, std::size_t i) const {
    const auto found = across_.find({triangles_[t][(i + 1) % 3], triangles_[t][i]});
    return found == across_.end() ? kNone : found->second;
  }

  /// All triangles that lie in the plane of `seed` and hang together.
  std::vector<std::size_t> grow(std::size_t seed, std::size_t face) {
    const Vector3 n = area(seed).normalized();
    const auto in_plane = [&](std::size_t t) {
      for (std::size_t i = 0; i < 3; ++i) {
        if (std::abs(n.dot(corner(t, i) - corner(seed, 0))) > narrow::kCoplanar) return false;
      }
      return area(t).dot(n) >= 0;
    };
    std::vector<std::size_t> members{seed};
    face_of_[seed] = face;
    for (std::size_t next = 0; next < members.size(); ++next) {
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t t = neighbour(members[next], i);
        if (t == kNone || face_of_[t] != kNone || !in_plane(t)) continue;
        face_of_[t] = face;
        members.push_back(t);
      }
    }
    return members;
  }

  /// The corners around the members, counter-clockwise.
  std::vector<std::uint16_t> border(const std::vector<std::size_t>& members) const {
    std::map<std::uint16_t, std::uint16_t> next;
    for (const std::size_t t : members) {
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t other = neighbour(t, i);
        if (other != kNone && face_of_[other] == face_of_[t]) continue;
        next[triangles_[t][i]] = triangles_[t][(i + 1) % 3];
      }
    }
    std::vector<std::uint16_t> loop;
    if (next.empty()) return loop;
    const std::uint16_t first = next.begin()->first;
    for (std::uint16_t at = first; loop.size() < next.size(); at = next[at]) {
      loop.push_back(at);
      if (next[at] == first) break;
    }
    return loop;
  }

  const std::vector<Vector3>& vertices_;
  const std::vector<Triangle>& triangles_;
  std::vector<std::size_t> face_of_;
  std::map<std::pair<std::uint16_t, std::uint16_t>, std::size_t> across_;
};

}  // namespace

bool has_inside(std::span<const Vector3> points) {
  return points.size() >= 4 && thickness(points) > narrow::kThinnest;
}

HullFaces convex_hull(std::span<const Vector3> points) {
  check(points);
  interruption_point();
  const auto corners = hull_triangles(points);
  std::vector<int> used;
  for (const auto& triangle : corners) used.insert(used.end(), triangle.begin(), triangle.end());
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  std::sort(used.begin(), used.end(), [&](int a, int b) {
    const Vector3& p = points[static_cast<std::size_t>(a)];
    const Vector3& q = points[static_cast<std::size_t>(b)];
    return std::lexicographical_compare(p.begin(), p.end(), q.begin(), q.end());
  });
  if (used.size() > kMaxHullVertices) {
    throw fault(std::to_string(used.size()) + " vertices; at most " +
                std::to_string(kMaxHullVertices) + " are allowed");
  }
  HullFaces hull;
  std::map<int, std::uint16_t> number;
  for (const int point : spread(used, points)) {
    number[point] = static_cast<std::uint16_t>(hull.vertices.size());
    hull.vertices.push_back(points[static_cast<std::size_t>(point)]);
  }
  std::vector<Triangle> triangles;
  hull.neighbours.resize(hull.vertices.size());
  for (const auto& [a, b, c] : corners) {
    triangles.push_back({number[a], number[b], number[c]});
    const Triangle& t = triangles.back();
    // Each edge belongs to two triangles, in opposite directions.
    for (std::size_t i = 0; i < 3; ++i) hull.neighbours[t[i]].push_back(t[(i + 1) % 3]);
  }
  Merger(hull.vertices, triangles).merge(hull);
  return hull;
}

}  // namespace hlm::geometry
