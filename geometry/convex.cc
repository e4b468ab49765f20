#include "hlm/geometry/convex.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string>

#include "hlm/common/range.h"
#include "hlm/geometry/hull.h"
#include "hlm/geometry/interruption.h"
#include "hlm/geometry/tolerances.h"
#include "hlm/geometry/work.h"

namespace hlm::geometry {
namespace {

/// Vertices on each rim of a cylinder. More follow the circle more closely (8 leave out 8 % of the
/// radius), and make as many contacts of a cap that lies flat.
constexpr std::uint16_t kRimVertices = 8;
static_assert(kRimVertices <= kMaxFaceCorners);

/// Features of a cylinder beyond those of its two polygons.
constexpr std::uint16_t kLineVertices = 2 * kRimVertices;  ///< First at -z; the +z end follows.
constexpr std::uint16_t kLine = 2 * kRimVertices;          ///< Line of contact, as an edge.
constexpr std::uint16_t kRims = 2 * kRimVertices + 1;      ///< The -z rim; the +z rim follows.

/// All axes of a hull are tried up to this number of vertices.
constexpr std::size_t kFewVertices = 6;
/// Hulls with at least this many vertices find their support by climbing from vertex to neighbour,
/// starting at the farthest of the first kClimbStarts. With fewer, looking at all is faster.
constexpr std::size_t kClimbFrom = 128;
constexpr std::size_t kClimbStarts = 16;
/// Work of a vertex or face that is looked at.
constexpr std::uint64_t kVertexWork = 1;

Feature vertex(std::size_t index) {
  return {FeatureKind::kVertex, 0, static_cast<std::uint16_t>(index)};
}
Feature edge(std::size_t index) {
  return {FeatureKind::kEdge, 0, static_cast<std::uint16_t>(index)};
}
Feature face(std::size_t index) {
  return {FeatureKind::kFace, 0, static_cast<std::uint16_t>(index)};
}

void check_size(double value, const char* name) {
  const auto error = find_error(name, value, above_zero("m"));
  if (error) throw std::invalid_argument(*error);
}

/// Which corners of a loop stand for it: all, or kMaxFaceCorners, taken away one by one where that
/// costs least area.
std::vector<std::uint16_t> telling_corners(const std::vector<std::uint16_t>& loop,
                                           const std::vector<Vector3>& vertices) {
  std::vector<std::uint16_t> kept(loop.size());
  std::iota(kept.begin(), kept.end(), std::uint16_t{0});
  while (kept.size() > kMaxFaceCorners) {
    const auto corner = [&](std::size_t i) { return vertices[loop[kept[i % kept.size()]]]; };
    const auto cost = [&](std::size_t i) {
      const Vector3 before = corner(i + kept.size() - 1);
      return (corner(i) - before).cross(corner(i + 1) - before).norm();
    };
    std::size_t least = 0;
    for (std::size_t i = 1; i < kept.size(); ++i) {
      if (cost(i) < cost(least)) least = i;
    }
    kept.erase(kept.begin() + static_cast<std::ptrdiff_t>(least));
  }
  return kept;
}

double distance_to_segment(const Vector3& p, const Vector3& a, const Vector3& b) {
  const Vector3 ab = b - a;
  const double t = std::clamp((p - a).dot(ab) / ab.squaredNorm(), 0.0, 1.0);
  return (p - a - t * ab).norm();
}

}  // namespace

Convex::Convex(const Shape& shape) {
  std::visit([this](const auto& kind) { build(kind); }, shape);
}

void Convex::build(const Sphere& sphere) {
  check_size(sphere.radius, "sphere radius");
  margin_ = sphere.radius;
  vertices_ = {Vector3::Zero()};
}

void Convex::build(const Capsule& capsule) {
  check_size(capsule.radius, "capsule radius");
  check_size(capsule.length, "capsule length");
  margin_ = capsule.radius;
  vertices_ = {{0, 0, -capsule.length / 2}, {0, 0, capsule.length / 2}};
  edges_ = {{0, 1}};
  collect_edge_directions();
}

void Convex::build(const Cylinder& cylinder) {
  check_size(cylinder.radius, "cylinder radius");
  check_size(cylinder.length, "cylinder length");
  kind_ = Kind::kCylinder;
  cylinder_ = cylinder;
  std::vector<std::uint16_t> bottom;
  std::vector<std::uint16_t> top;
  for (const double z : {-cylinder.length / 2, cylinder.length / 2}) {
    for (std::uint16_t i = 0; i < kRimVertices; ++i) {
      const double angle = 2 * std::numbers::pi * i / kRimVertices;
      vertices_.emplace_back(cylinder.radius * std::cos(angle), cylinder.radius * std::sin(angle),
                             z);
    }
  }
  for (std::uint16_t i = 0; i < kRimVertices; ++i) {
    bottom.push_back(static_cast<std::uint16_t>(kRimVertices - 1 - i));
    top.push_back(static_cast<std::uint16_t>(kRimVertices + i));
  }
  add_face(std::move(bottom));
  add_face(std::move(top));
  edge_directions_ = {Vector3::UnitZ()};
}

void Convex::build(const Box& box) {
  check_size(box.size.x(), "box size x");
  check_size(box.size.y(), "box size y");
  check_size(box.size.z(), "box size z");
  kind_ = Kind::kBox;
  box_half_ = box.size / 2;
  for (int i = 0; i < 8; ++i) {
    const Vector3 signs(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
    vertices_.push_back(signs.cwiseProduct(box_half_));
  }
  for (int axis = 0; axis < 3; ++axis) {
    const int here = 1 << axis;
    const int u = 1 << (axis + 1) % 3;
    const int v = 1 << (axis + 2) % 3;
    const auto corner = [](int bits) { return static_cast<std::uint16_t>(bits); };
    add_face({corner(0), corner(v), corner(u | v), corner(u)});
    add_face({corner(here), corner(here | u), corner(here | u | v), corner(here | v)});
  }
  collect_edge_directions();
}

void Convex::build(const Ellipsoid& ellipsoid) {
  check_size(ellipsoid.radii.x(), "ellipsoid radius x");
  check_size(ellipsoid.radii.y(), "ellipsoid radius y");
  check_size(ellipsoid.radii.z(), "ellipsoid radius z");
  kind_ = Kind::kEllipsoid;
  radii_ = ellipsoid.radii;
}

void Convex::build(const Hull& hull) {
  HullFaces faces = convex_hull(hull.vertices);
  vertices_ = std::move(faces.vertices);
  for (std::vector<std::uint16_t>& loop : faces.loops) add_face(std::move(loop));
  face_normals_ = std::move(faces.normals);
  if (vertices_.size() <= kFewVertices) return collect_edge_directions();
  kind_ = Kind::kHull;
  edges_of_.resize(vertices_.size());
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    for (const std::uint16_t end : {edges_[i].from, edges_[i].to}) {
      edges_of_[end].push_back(static_cast<std::uint16_t>(i));
    }
  }
  if (vertices_.size() < kClimbFrom) return;
  for (const auto& neighbours : faces.neighbours) {
    first_neighbour_.push_back(static_cast<std::uint32_t>(neighbours_.size()));
    neighbours_.insert(neighbours_.end(), neighbours.begin(), neighbours.end());
  }
  first_neighbour_.push_back(static_cast<std::uint32_t>(neighbours_.size()));
}

void Convex::build(const HalfSpace&) {
  kind_ = Kind::kHalfSpace;
  face_normals_ = {Vector3::UnitZ()};
}

void Convex::add_face(std::vector<std::uint16_t> loop) {
  interruption_point();
  Face& added = faces_.emplace_back();
  added.telling = telling_corners(loop, vertices_);
  for (std::size_t i = 0; i < loop.size(); ++i) {
    added.edges.push_back(edge_between(loop[i], loop[(i + 1) % loop.size()]));
  }
  const Vector3 along = vertices_[loop[1]] - vertices_[loop[0]];
  const Vector3 across = vertices_[loop.back()] - vertices_[loop[0]];
  face_normals_.push_back(along.cross(across).normalized());
  added.vertices = std::move(loop);
}

std::uint16_t Convex::edge_between(std::uint16_t from, std::uint16_t to) {
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    if (edges_[i].from == to && edges_[i].to == from) return static_cast<std::uint16_t>(i);
  }
  edges_.push_back({from, to});
  return static_cast<std::uint16_t>(edges_.size() - 1);
}

void Convex::collect_edge_directions() {
  for (const Edge& e : edges_) {
    const Vector3 direction = (vertices_[e.to] - vertices_[e.from]).normalized();
    const bool known = std::any_of(
        edge_directions_.begin(), edge_directions_.end(),
        [&](const Vector3& other) { return direction.cross(other).norm() < narrow::kLine; });
    if (!known) edge_directions_.push_back(direction);
  }
}

std::size_t Convex::farthest_of_first(std::size_t count, const Vector3& direction) const noexcept {
  std::size_t best = 0;
  double farthest = vertices_[0].dot(direction);
  for (std::size_t i = 1; i < count; ++i) {
    const double along = vertices_[i].dot(direction);
    if (along > farthest) {
      farthest = along;
      best = i;
    }
  }
  return best;
}

std::size_t Convex::support_vertex(const Vector3& direction) const noexcept {
  if (neighbours_.empty()) {
    Work::add(kVertexWork * vertices_.size());
    return farthest_of_first(vertices_.size(), direction);
  }
  std::uint64_t looked_at = kClimbStarts;
  std::size_t best = farthest_of_first(kClimbStarts, direction);
  double farthest = vertices_[best].dot(direction);
  for (bool higher = true; higher;) {
    higher = false;
    const std::uint32_t end = first_neighbour_[best + 1];
    looked_at += end - first_neighbour_[best];
    for (std::uint32_t i = first_neighbour_[best]; i < end; ++i) {
      const double along = vertices_[neighbours_[i]].dot(direction);
      if (along <= farthest) continue;
      farthest = along;
      best = neighbours_[i];
      higher = true;
    }
  }
  Work::add(kVertexWork * looked_at);
  return best;
}

Vector3 Convex::support(const Vector3& direction) const noexcept {
  switch (kind_) {
    case Kind::kBox:
      return {std::copysign(box_half_.x(), direction.x()),
              std::copysign(box_half_.y(), direction.y()),
              std::copysign(box_half_.z(), direction.z())};
    case Kind::kCylinder: {
      const double radial = direction.head<2>().norm();
      const double scale = radial > 0 ? cylinder_.radius / radial : 0;
      return {scale * direction.x(), scale * direction.y(),
              std::copysign(cylinder_.length / 2, direction.z())};
    }
    case Kind::kEllipsoid: {
      const Vector3 scaled = radii_.cwiseProduct(direction);
      return radii_.cwiseProduct(scaled) / scaled.norm();
    }
    case Kind::kPolytope:
    case Kind::kHull:
    case Kind::kHalfSpace:
      break;
  }
  assert(!is_half_space());
  return vertices_[support_vertex(direction)];
}

Vector3 Convex::support_rate(const Vector3& direction, const Vector3& turn) const noexcept {
  if (kind_ == Kind::kCylinder) {
    const double radial = direction.head<2>().norm();
    if (!(radial > 0)) return Vector3::Zero();
    const Vector3 along = Vector3(-direction.y(), direction.x(), 0) / radial;
    return cylinder_.radius / radial * along.dot(turn) * along;
  }
  if (kind_ == Kind::kEllipsoid) {
    const double scale = radii_.cwiseProduct(direction).norm();
    const Vector3 p = support(direction);
    return (radii_.cwiseProduct(radii_).cwiseProduct(turn) - p.dot(turn) * p) / scale;
  }
  return Vector3::Zero();
}

Patch Convex::facing(const Vector3& direction) const {
  Work::add(kVertexWork * faces_.size());
  if (faces_.empty()) {
    if (is_half_space()) return {.corners = {}, .feature = face(0), .normal = face_normals_[0]};
    return edge_facing(direction);
  }
  std::size_t best = 0;
  double nearest = face_normals_[0].dot(direction);
  for (std::size_t i = 1; i < faces_.size(); ++i) {
    const double cosine = face_normals_[i].dot(direction);
    if (cosine <= nearest) continue;
    nearest = cosine;
    best = i;
  }
  const bool lateral =
      kind_ == Kind::kCylinder && direction.head<2>().norm() > std::abs(direction.z());
  return lateral ? lateral_patch(direction) : face_patch(best);
}

Patch Convex::edge_facing(const Vector3& direction) const {
  if (kind_ == Kind::kCylinder) return lateral_patch(direction);
  if (kind_ == Kind::kEllipsoid) return rolling_patch(direction);
  const std::size_t at = support_vertex(direction);
  std::size_t best = edges_.size();
  double smallest_slope = std::numeric_limits<double>::infinity();
  const auto consider = [&](std::size_t i) {
    const Vector3 along = (vertices_[edges_[i].to] - vertices_[edges_[i].from]).normalized();
    const double slope = std::abs(along.dot(direction));
    if (slope < smallest_slope) {
      smallest_slope = slope;
      best = i;
    }
  };
  if (is_hull()) {
    for (const std::uint16_t i : edges_of_[at]) consider(i);
  } else {
    for (std::size_t i = 0; i < edges_.size(); ++i) {
      if (edges_[i].from == at || edges_[i].to == at) consider(i);
    }
  }
  return best < edges_.size() ? edge_patch(best) : vertex_patch(at);
}

Patch Convex::face_patch(std::size_t index) const {
  Patch patch{.corners = {}, .feature = face(index), .normal = face_normals_[index]};
  const Face& f = faces_[index];
  for (const std::uint16_t i : f.telling) {
    patch.corners.push_back({vertices_[f.vertices[i]], vertex(f.vertices[i]), edge(f.edges[i])});
  }
  return patch;
}

Patch Convex::edge_patch(std::size_t index) const {
  const Edge& e = edges_[index];
  Patch patch{.corners = {}, .feature = edge(index)};
  patch.round = margin_ > 0;
  patch.corners.push_back({vertices_[e.from], vertex(e.from), edge(index)});
  patch.corners.push_back({vertices_[e.to], vertex(e.to), edge(index)});
  return patch;
}

Patch Convex::vertex_patch(std::size_t index) const {
  Patch patch{.corners = {}, .feature = vertex(index)};
  patch.corners.push_back({vertices_[index], vertex(index), vertex(index)});
  return patch;
}

Patch Convex::rolling_patch(const Vector3& direction) const {
  Patch patch{.corners = {}, .feature = vertex(0)};
  patch.corners.push_back({support(direction), vertex(0), vertex(0)});
  return patch;
}

Patch Convex::lateral_patch(const Vector3& direction) const {
  const Vector3 outward = Vector3(direction.x(), direction.y(), 0).normalized();
  const Vector3 to_end(0, 0, cylinder_.length / 2);
  const Vector3 middle = cylinder_.radius * outward;
  Patch patch{.corners = {}, .feature = edge(kLine)};
  patch.round = true;
  patch.corners.push_back({middle - to_end, vertex(kLineVertices), edge(kLine)});
  patch.corners.push_back({middle + to_end, vertex(kLineVertices + 1), edge(kLine)});
  return patch;
}

Feature Convex::feature_at(const Vector3& p) const {
  if (is_half_space()) return face(0);
  if (kind_ == Kind::kCylinder) return cylinder_feature_at(p);
  if (kind_ == Kind::kEllipsoid) return vertex(0);
  if (is_hull()) return hull_feature_at(p);
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    if ((p - vertices_[i]).norm() < narrow::kAccuracy) return vertex(i);
  }
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    if (distance_to_segment(p, vertices_[edges_[i].from], vertices_[edges_[i].to]) <
        narrow::kAccuracy) {
      return edge(i);
    }
  }
  return face(face_above(p));
}

std::size_t Convex::face_above(const Vector3& p) const noexcept {
  std::size_t best = 0;
  double highest = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < faces_.size(); ++i) {
    const double height = height_over_face(i, p);
    if (height > highest) {
      highest = height;
      best = i;
    }
  }
  return best;
}

Feature Convex::hull_feature_at(const Vector3& p) const {
  const std::size_t above = face_above(p);
  const Face& f = faces_[above];
  for (const std::uint16_t i : f.vertices) {
    if ((p - vertices_[i]).norm() < narrow::kAccuracy) return vertex(i);
  }
  for (const std::uint16_t i : f.edges) {
    if (distance_to_segment(p, vertices_[edges_[i].from], vertices_[edges_[i].to]) <
        narrow::kAccuracy) {
      return edge(i);
    }
  }
  return face(above);
}

Feature Convex::cylinder_feature_at(const Vector3& p) const {
  const bool on_side = p.head<2>().norm() > cylinder_.radius - narrow::kAccuracy;
  const bool on_cap = std::abs(p.z()) > cylinder_.length / 2 - narrow::kAccuracy;
  const std::uint16_t end = p.z() > 0 ? 1 : 0;
  if (on_side && on_cap) return edge(static_cast<std::size_t>(kRims + end));
  return on_side ? edge(kLine) : face(end);
}

Vector3 Convex::half_extents() const { return bounds(Pose{}).sizes() / 2; }

Eigen::AlignedBox3d Convex::bounds(const Pose& X_WS) const {
  if (is_half_space()) {
    const Vector3 everywhere = Vector3::Constant(std::numeric_limits<double>::infinity());
    return {-everywhere, everywhere};
  }
  const Matrix3 R_WS = X_WS.R.toRotationMatrix();
  Eigen::AlignedBox3d box;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3 along = R_WS.row(axis).transpose();
    box.max()[axis] = X_WS.p[axis] + support(along).dot(along) + margin_;
    box.min()[axis] = X_WS.p[axis] + support(-along).dot(along) - margin_;
  }
  return box;
}

}  // namespace hlm::geometry
