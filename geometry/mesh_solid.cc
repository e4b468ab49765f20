#include "hlm/geometry/mesh_solid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <utility>

#include "hlm/geometry/interruption.h"
#include "hlm/geometry/mesh_edges.h"

namespace hlm::geometry {
namespace {

/// Triangles of a leaf. More: fewer nodes, and more triangles looked at in vain.
constexpr std::uint32_t kLeaf = 4;
/// Edges that bend by less, rad, are flat: the corners of files are rounded. More: flat facets of
/// round things have no edges.
constexpr double kFlat = 1e-3;
/// Planes of a mesh whose extent is this or more, m, are stood on with all their corners. Smaller
/// ones are the facets of something round, which is touched at its highest corner.
constexpr double kBroad = 4e-3;
/// Parts of a mesh that are solids of their own. More are one solid.
constexpr std::size_t kMostParts = 256;
/// Ends of a way that count as touching what they are on, m.
constexpr double kEnds = 1e-7;
/// How far beside a triangle a way meets it still, m: none passes between two.
constexpr double kGrazing = 1e-9;
/// Work of a triangle that is looked at.
constexpr std::uint64_t kTriangleWork = 20;

using Corners = MeshSolid::Corners;

double square(double x) { return x * x; }

/// Square of a point's distance from the box of a node, m².
double square_to(const MeshSolid::Node& node, const Vector3& p) {
  return ((p - node.centre).cwiseAbs() - node.half).cwiseMax(0.0).squaredNorm();
}

/// The point of a triangle that is nearest to p, after Ericson, Real-Time Collision
/// Detection 5.1.5.
void find_nearest(const Vector3& p, const Vector3& a, const Vector3& b, const Vector3& c,
                  MeshSolid::Nearest& found) {
  const auto at = [&](const Vector3& q, FeatureKind kind, std::uint8_t index) {
    found.p = q;
    found.kind = kind;
    found.index = index;
  };
  const Vector3 ab = b - a;
  const Vector3 ac = c - a;
  const Vector3 ap = p - a;
  const double d1 = ab.dot(ap);
  const double d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return at(a, FeatureKind::kVertex, 0);
  const Vector3 bp = p - b;
  const double d3 = ab.dot(bp);
  const double d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return at(b, FeatureKind::kVertex, 1);
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return at(a + d1 / (d1 - d3) * ab, FeatureKind::kEdge, 0);
  const Vector3 cp = p - c;
  const double d5 = ab.dot(cp);
  const double d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return at(c, FeatureKind::kVertex, 2);
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return at(a + d2 / (d2 - d6) * ac, FeatureKind::kEdge, 2);
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    return at(b + (d4 - d3) / (d4 - d3 + d5 - d6) * (c - b), FeatureKind::kEdge, 1);
  }
  const double all = va + vb + vc;
  at(a + vb / all * ab + vc / all * ac, FeatureKind::kFace, 0);
}

}  // namespace

MeshSolid::MeshSolid(const std::vector<Vector3>& points, const std::vector<Corners>& triangles,
                     bool closed)
    : closed_(closed) {
  std::vector<std::uint32_t> place(points.size(), std::numeric_limits<std::uint32_t>::max());
  std::vector<std::uint32_t> order(triangles.size());
  std::iota(order.begin(), order.end(), 0);
  // Points by their first triangle.
  std::vector<Corners> own = triangles;
  for (Corners& corners : own) {
    for (std::uint32_t& corner : corners) {
      std::uint32_t& at = place[corner];
      if (at == std::numeric_limits<std::uint32_t>::max()) {
        at = static_cast<std::uint32_t>(points_.size());
        points_.push_back(points[corner]);
      }
      corner = at;
    }
  }
  triangles_.reserve(own.size());
  for (const Corners& corners : own) triangles_.push_back({.corner = corners});
  for (const Vector3& p : points_) bounds_.extend(p);
  build(order);
  for (Triangle& t : triangles_) {
    t.n = (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).normalized();
    t.offset = t.n.dot(corner(t, 0));
  }
  interruption_point();
  find_neighbours();
  find_bends();
  find_broad();
  list_features();
  find_cones();
}

/// Builds the tree, and puts the triangles in its order.
void MeshSolid::build(std::vector<std::uint32_t>& order) {
  std::vector<Vector3> middles;
  middles.reserve(triangles_.size());
  for (const Triangle& t : triangles_) {
    middles.push_back((corner(t, 0) + corner(t, 1) + corner(t, 2)) / 3);
  }
  nodes_.reserve(triangles_.size());
  build(order, middles, 0, static_cast<std::uint32_t>(order.size()));
  nodes_.shrink_to_fit();
  std::vector<Triangle> sorted;
  sorted.reserve(order.size());
  for (const std::uint32_t t : order) sorted.push_back(triangles_[t]);
  triangles_ = std::move(sorted);
}

std::uint32_t MeshSolid::build(std::vector<std::uint32_t>& order,
                               const std::vector<Vector3>& middles, std::uint32_t first,
                               std::uint32_t count) {
  if (count > 1000) interruption_point();
  Eigen::AlignedBox3d box;
  Eigen::AlignedBox3d of_middles;
  for (std::uint32_t i = first; i < first + count; ++i) {
    for (std::size_t k = 0; k < 3; ++k) box.extend(corner(triangles_[order[i]], k));
    of_middles.extend(middles[order[i]]);
  }
  const auto index = static_cast<std::uint32_t>(nodes_.size());
  Node& node = nodes_.emplace_back();
  node.centre = box.center();
  node.half = box.sizes() / 2;
  node.radius = node.half.norm();
  node.first = first;
  node.count = count;
  if (count <= kLeaf) return index;
  Eigen::Index axis = 0;
  of_middles.sizes().maxCoeff(&axis);
  const std::uint32_t half = count / 2;
  const auto begin = order.begin() + static_cast<std::ptrdiff_t>(first);
  std::nth_element(begin, begin + static_cast<std::ptrdiff_t>(half),
                   begin + static_cast<std::ptrdiff_t>(count),
                   [&](std::uint32_t a, std::uint32_t b) {
                     return std::pair(middles[a][axis], a) < std::pair(middles[b][axis], b);
                   });
  build(order, middles, first, half);
  const std::uint32_t right = build(order, middles, first + half, count - half);
  nodes_[index].right = right;
  return index;
}

void MeshSolid::find_neighbours() {
  first_.assign(points_.size() + 1, 0);
  for (const Triangle& t : triangles_) {
    for (const std::uint32_t point : t.corner) ++first_[point + 1];
  }
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  around_.resize(3 * triangles_.size());
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
    for (const std::uint32_t point : triangles_[t].corner) around_[next[point]++] = t;
  }
  std::vector<Corners> corners;
  corners.reserve(triangles_.size());
  for (const Triangle& t : triangles_) corners.push_back(t.corner);
  const std::vector<std::array<std::int32_t, 3>> across = MeshEdges(corners).across(points_);
  for (std::size_t t = 0; t < triangles_.size(); ++t) triangles_[t].across = across[t];
}

void MeshSolid::find_bends() {
  on_rim_.assign(points_.size(), false);
  normals_.assign(points_.size(), Vector3::Zero());
  for (Triangle& t : triangles_) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3 a = (corner(t, (i + 1) % 3) - corner(t, i)).normalized();
      const Vector3 b = (corner(t, (i + 2) % 3) - corner(t, i)).normalized();
      normals_[t.corner[i]] += std::acos(std::clamp(a.dot(b), -1.0, 1.0)) * t.n;
      if (t.across[i] < 0) {
        t.bend[i] = Bend::kRim;
        on_rim_[t.corner[i]] = on_rim_[t.corner[(i + 1) % 3]] = true;
        continue;
      }
      const Triangle& other = triangles_[static_cast<std::size_t>(t.across[i])];
      const Vector3 along = a;  // From corner i to the next.
      const double sine = along.dot(t.n.cross(other.n));
      const bool is_flat = std::abs(sine) < kFlat && t.n.dot(other.n) > 0;
      t.bend[i] = is_flat ? Bend::kFlat : sine > 0 ? Bend::kConvex : Bend::kConcave;
    }
  }
}

/// Finds how large the planes are that the triangles make.
void MeshSolid::find_broad() {
  std::vector<bool> seen(triangles_.size(), false);
  std::vector<std::uint32_t> plane;
  for (std::uint32_t seed = 0; seed < triangles_.size(); ++seed) {
    if (seen[seed]) continue;
    interruption_point();
    plane.assign(1, seed);
    seen[seed] = true;
    Eigen::AlignedBox3d box;
    for (std::size_t next = 0; next < plane.size(); ++next) {
      const Triangle& t = triangles_[plane[next]];
      for (std::size_t i = 0; i < 3; ++i) {
        box.extend(corner(t, i));
        if (t.bend[i] != Bend::kFlat) continue;
        const auto other = static_cast<std::uint32_t>(t.across[i]);
        if (seen[other] || triangles_[other].n.dot(triangles_[seed].n) < std::cos(2 * kFlat)) {
          continue;
        }
        seen[other] = true;
        plane.push_back(other);
      }
    }
    const bool broad = box.diagonal().norm() >= kBroad;
    for (const std::uint32_t t : plane) triangles_[t].broad = broad;
  }
}

/// Lists each sharp vertex and edge once. Of a sheet what is hollow on one side is sharp on the
/// other.
void MeshSolid::list_features() {
  const auto is_sharp = [&](Bend bend) {
    return bend == Bend::kConvex || bend == Bend::kRim || (!closed_ && bend == Bend::kConcave);
  };
  std::vector<bool> is_pointed(points_.size(), false);
  std::vector<bool> is_listed(points_.size(), false);
  for (const Triangle& t : triangles_) {
    for (std::size_t i = 0; i < 3; ++i) {
      if (is_sharp(t.bend[i])) is_pointed[t.corner[i]] = is_pointed[t.corner[(i + 1) % 3]] = true;
    }
  }
  for (std::uint32_t index = 0; index < triangles_.size(); ++index) {
    Triangle& t = triangles_[index];
    for (std::size_t i = 0; i < 3; ++i) {
      const auto bit = static_cast<std::uint8_t>(1U << i);
      if (is_pointed[t.corner[i]] && !is_listed[t.corner[i]]) {
        is_listed[t.corner[i]] = true;
        t.vertices |= bit;
      }
      const bool is_first = t.across[i] < 0 || static_cast<std::uint32_t>(t.across[i]) > index;
      if (is_first && is_sharp(t.bend[i])) t.edges |= bit;
    }
  }
}

/// Bounds the normals in each node, those of triangles next to it included.
void MeshSolid::find_cones() {
  for (std::size_t index = nodes_.size(); index-- > 0;) {
    Node& node = nodes_[index];
    if (node.right == 0) {
      Vector3 sum = Vector3::Zero();
      const auto for_each = [&](const auto& use) {
        for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
          for (const std::uint32_t point : triangles_[i].corner) {
            if (on_rim_[point]) node.angle = std::numbers::pi;
            for (std::uint32_t k = first_[point]; k < first_[point + 1]; ++k) {
              use(triangles_[around_[k]].n);
            }
          }
        }
      };
      for_each([&](const Vector3& n) { sum += n; });
      if (!(sum.norm() > 1e-6)) {
        node.angle = std::numbers::pi;
        continue;
      }
      node.axis = sum.normalized();
      double least = 1;
      for_each([&](const Vector3& n) { least = std::min(least, n.dot(node.axis)); });
      node.angle = std::max(node.angle, std::acos(std::clamp(least, -1.0, 1.0)));
      continue;
    }
    const Node& left = nodes_[index + 1];
    const Node& right = nodes_[node.right];
    const Vector3 sum = left.axis + right.axis;
    if (!(sum.norm() > 1e-3)) {
      node.angle = std::numbers::pi;
      continue;
    }
    node.axis = sum.normalized();
    const auto reach = [&](const Node& child) {
      return child.angle + std::acos(std::clamp(child.axis.dot(node.axis), -1.0, 1.0));
    };
    node.angle = std::min(std::numbers::pi, std::max(reach(left), reach(right)));
  }
}

std::optional<MeshSolid::Nearest> MeshSolid::nearest(const Vector3& p,
                                                     double within) const noexcept {
  struct Open {
    std::uint32_t node;
    double square;
  };
  std::array<Open, kMostOpen> open;
  std::size_t count = 0;
  double least = within < 1e150 ? square(within) : std::numeric_limits<double>::infinity();
  Nearest best;
  bool found = false;
  open[count++] = {0, square_to(nodes_[0], p)};
  while (count > 0) {
    const auto [index, to_box] = open[--count];
    if (to_box > least) continue;
    const Node& node = nodes_[index];
    if (node.right == 0) {
      Work::add(kTriangleWork * node.count);
      for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
        const Triangle& t = triangles_[i];
        if (square(t.n.dot(p) - t.offset) > least) continue;
        Nearest here{.triangle = i};
        find_nearest(p, corner(t, 0), corner(t, 1), corner(t, 2), here);
        const double away = (here.p - p).squaredNorm();
        if (away > least || (found && away == least)) continue;
        least = away;
        best = here;
        found = true;
      }
      continue;
    }
    const Open left{index + 1, square_to(nodes_[index + 1], p)};
    const Open right{node.right, square_to(nodes_[node.right], p)};
    const bool left_first = left.square <= right.square;
    open[count++] = left_first ? right : left;
    open[count++] = left_first ? left : right;
  }
  if (!found) return {};
  best.distance = std::sqrt(least);
  return best;
}

Vector3 MeshSolid::pseudonormal(const Nearest& nearest) const noexcept {
  const Triangle& t = triangles_[nearest.triangle];
  switch (nearest.kind) {
    case FeatureKind::kFace:
      return t.n;
    case FeatureKind::kEdge: {
      const std::int32_t other = t.across[nearest.index];
      return other < 0 ? t.n : Vector3(t.n + triangles_[static_cast<std::size_t>(other)].n);
    }
    case FeatureKind::kVertex:
      return normals_[t.corner[nearest.index]];
  }
  return t.n;
}

double MeshSolid::distance(const Vector3& p) const noexcept {
  const auto found = nearest(p, std::numeric_limits<double>::infinity());
  if (!found) return std::numeric_limits<double>::infinity();
  return pseudonormal(*found).dot(p - found->p) < 0 ? -found->distance : found->distance;
}

bool MeshSolid::is_clear(const Vector3& p, const Vector3& u, double length) const noexcept {
  if (!(length > 2 * kEnds)) return true;
  const Vector3 inverse = u.cwiseInverse();
  bool clear = true;
  const auto enters = [&](const Node& node) {
    if (!clear) return false;
    double from = 0;
    double to = length;
    for (Eigen::Index i = 0; i < 3; ++i) {
      const double middle = node.centre[i] - p[i];
      if (std::abs(u[i]) < 1e-12) {
        if (std::abs(middle) > node.half[i]) return false;
        continue;
      }
      const double a = (middle - node.half[i]) * inverse[i];
      const double b = (middle + node.half[i]) * inverse[i];
      from = std::max(from, std::min(a, b));
      to = std::min(to, std::max(a, b));
    }
    return from <= to;
  };
  visit(enters, [&](std::uint32_t index) {
    const Triangle& t = triangles_[index];
    Work::add(kTriangleWork);
    const double along = t.n.dot(u);
    if (std::abs(along) < 1e-9) return;
    const double at = (t.offset - t.n.dot(p)) / along;
    if (at < kEnds || at > length - kEnds) return;
    const Vector3 q = p + at * u;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3& from = corner(t, i);
      const Vector3 edge = corner(t, (i + 1) % 3) - from;
      if (t.n.dot(edge.cross(q - from)) < -kGrazing * edge.norm()) return;
    }
    clear = false;
  });
  return clear;
}

bool MeshSolid::is_summit(std::uint32_t point, const Vector3& n, double slope) const noexcept {
  const Vector3& p = points_[point];
  for (std::uint32_t k = first_[point]; k < first_[point + 1]; ++k) {
    for (const std::uint32_t other : triangles_[around_[k]].corner) {
      if (other == point) continue;
      const Vector3 along = points_[other] - p;
      const double rise = n.dot(along);
      if (rise > 0 && square(rise) > square(slope) * along.squaredNorm()) return false;
    }
  }
  return true;
}

const MeshSolid::Triangle* MeshSolid::broad_at(std::uint32_t point, const Vector3& n, double side,
                                               double least) const noexcept {
  const Triangle* best = nullptr;
  for (std::uint32_t k = first_[point]; k < first_[point + 1]; ++k) {
    const Triangle& t = triangles_[around_[k]];
    const double cosine = side * t.n.dot(n);
    if (!t.broad || cosine < least) continue;
    best = &t;
    least = cosine;
  }
  return best;
}

namespace {

/// Which half-edges are those of the middle one of three triangles at an edge: not next to the
/// widest gap between them, which is outside.
std::vector<bool> find_middle_ones(const std::vector<Vector3>& points,
                                   const std::vector<Corners>& triangles, const MeshEdges& edges) {
  std::vector<bool> is_middle(3 * triangles.size(), false);
  edges.for_each_crowded([&](const std::vector<std::uint32_t>& places) {
    if (places.size() != 3) return;
    const Corners& first = triangles[places[0] / 3];
    const Vector3& a = points[first[places[0] % 3]];
    const Vector3 along = (points[first[(places[0] % 3 + 1) % 3]] - a).normalized();
    const auto away = [&](std::uint32_t place) -> Vector3 {
      const Vector3 v = points[triangles[place / 3][(place % 3 + 2) % 3]] - a;
      return (v - v.dot(along) * along).normalized();
    };
    const Vector3 x = away(places[0]);
    const Vector3 y = along.cross(x);
    std::array<std::pair<double, std::uint32_t>, 3> around;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3 v = away(places[i]);
      const double angle = std::atan2(y.dot(v), x.dot(v));
      around[i] = {angle < 0 ? angle + 2 * std::numbers::pi : angle, places[i]};
    }
    std::ranges::sort(around);
    std::size_t widest = 0;
    double width = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const double next = around[(i + 1) % 3].first + (i == 2 ? 2 * std::numbers::pi : 0);
      if (next - around[i].first > width) widest = i;
      width = std::max(width, next - around[i].first);
    }
    is_middle[around[(widest + 2) % 3].second] = true;
  });
  return is_middle;
}

/// Leaves out the walls inside of a solid: parts that are the middle one of three at all of their
/// borders.
void drop_inner_walls(const std::vector<Vector3>& points, std::vector<Corners>& triangles) {
  const MeshEdges edges(triangles);
  if (edges.crowded() == 0) return;
  const std::vector<bool> is_middle = find_middle_ones(points, triangles, edges);
  const auto across = edges.across();
  std::vector<bool> seen(triangles.size(), false);
  std::vector<bool> is_wall(triangles.size(), false);
  std::vector<std::size_t> part;
  for (std::size_t seed = 0; seed < triangles.size(); ++seed) {
    if (seen[seed]) continue;
    bool ends = false;
    bool middle = true;
    part.assign(1, seed);
    seen[seed] = true;
    for (std::size_t next = 0; next < part.size(); ++next) {
      for (std::size_t i = 0; i < 3; ++i) {
        const std::int32_t other = across[part[next]][i];
        if (other < 0) {
          ends = true;
          middle = middle && is_middle[3 * part[next] + i];
        } else if (!seen[static_cast<std::size_t>(other)]) {
          seen[static_cast<std::size_t>(other)] = true;
          part.push_back(static_cast<std::size_t>(other));
        }
      }
    }
    if (!ends || !middle) continue;
    for (const std::size_t t : part) is_wall[t] = true;
  }
  std::size_t next = 0;
  std::erase_if(triangles, [&](const Corners&) { return is_wall[next++]; });
}

struct Part {
  std::vector<Corners> triangles;
  bool closed = true;
  double volume = 0;  ///< m³.
  Eigen::AlignedBox3d bounds;
};

std::vector<Part> parts_of(const std::vector<Vector3>& points,
                           const std::vector<Corners>& triangles) {
  const auto across = MeshEdges(triangles).across(points);
  std::vector<bool> seen(triangles.size(), false);
  std::vector<Part> parts;
  std::vector<std::size_t> open;
  for (std::size_t seed = 0; seed < triangles.size(); ++seed) {
    if (seen[seed]) continue;
    interruption_point();
    Part& part = parts.emplace_back();
    open.assign(1, seed);
    seen[seed] = true;
    while (!open.empty()) {
      const std::size_t t = open.back();
      open.pop_back();
      part.triangles.push_back(triangles[t]);
      const Vector3& a = points[triangles[t][0]];
      const Vector3& origin = points[triangles[seed][0]];
      part.volume +=
          (points[triangles[t][1]] - a).cross(points[triangles[t][2]] - a).dot(a - origin) / 6;
      for (const std::uint32_t corner : triangles[t]) part.bounds.extend(points[corner]);
      for (const std::int32_t other : across[t]) {
        if (other < 0) {
          part.closed = false;
        } else if (!seen[static_cast<std::size_t>(other)]) {
          seen[static_cast<std::size_t>(other)] = true;
          open.push_back(static_cast<std::size_t>(other));
        }
      }
    }
  }
  return parts;
}

/// Joins cavities to the solids that they are in, and turns other parts that are inside out.
void settle_inner(const std::vector<Vector3>& points, std::vector<Part>& parts) {
  for (Part& part : parts) {
    if (!part.closed || part.volume >= 0) continue;
    const Vector3& p = points[part.triangles.front()[0]];
    const auto around = std::ranges::find_if(parts, [&](const Part& other) {
      return &other != &part && other.closed && other.volume > -part.volume &&
             other.bounds.contains(part.bounds) &&
             MeshSolid(points, other.triangles, true).distance(p) < 0;
    });
    if (around != parts.end()) {
      around->triangles.insert(around->triangles.end(), part.triangles.begin(),
                               part.triangles.end());
      part.triangles.clear();
    } else {
      for (Corners& t : part.triangles) std::swap(t[1], t[2]);
      part.volume = -part.volume;
    }
  }
  std::erase_if(parts, [](const Part& part) { return part.triangles.empty(); });
}

}  // namespace

std::vector<MeshSolid> solids_of(const Mesh& mesh) {
  std::vector<Corners> triangles;
  triangles.reserve(mesh.triangles.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    triangles.push_back({static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b),
                         static_cast<std::uint32_t>(c)});
  }
  if (!mesh.closed) drop_inner_walls(mesh.points, triangles);
  std::vector<Part> parts = parts_of(mesh.points, triangles);
  if (parts.size() <= kMostParts) {
    settle_inner(mesh.points, parts);
  } else {  // A soup: closed parts together, and open ones.
    std::vector<Part> two(2);
    two[1].closed = false;
    for (const Part& part : parts) {
      std::vector<Corners>& into = two[part.closed ? 0 : 1].triangles;
      into.insert(into.end(), part.triangles.begin(), part.triangles.end());
    }
    std::erase_if(two, [](const Part& part) { return part.triangles.empty(); });
    parts = std::move(two);
  }
  std::vector<MeshSolid> solids;
  solids.reserve(parts.size());
  for (const Part& part : parts) solids.emplace_back(mesh.points, part.triangles, part.closed);
  return solids;
}

}  // namespace hlm::geometry
