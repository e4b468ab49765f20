// A part of a mesh that hangs together, as one solid: how far is a point from it, on which side,
// and which feature is nearest?
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "hlm/geometry/feature.h"
#include "hlm/geometry/mesh.h"
#include "hlm/geometry/work.h"

namespace hlm::geometry {

/// A tree of boxes over triangles, with pseudonormals (Baerentzen and Aanaes 2005): of a closed
/// part distances are signed, an open one is a sheet without thickness. Immutable; what is asked of
/// it allocates nothing. Some 180 bytes a triangle.
class MeshSolid {
 public:
  using Corners = std::array<std::uint32_t, 3>;

  /// What the surface is like at an edge, seen from outside.
  enum class Bend : std::uint8_t { kFlat, kConvex, kConcave, kRim };

  struct Triangle {
    Corners corner;                        ///< Counter-clockwise seen from outside.
    std::array<std::int32_t, 3> across{};  ///< Over the edge from corner i to i + 1; -1: none.
    std::array<Bend, 3> bend{};            ///< At these edges.
    bool broad = false;                    ///< Its plane is large enough to stand on.
    std::uint8_t vertices = 0;             ///< Sharp vertices that it lists, a bit each,
    std::uint8_t edges = 0;                ///< and such edges: each is in one triangle's list.
    Vector3 n = Vector3::UnitZ();          ///< Outward, unit.
    double offset = 0;                     ///< nᵀ x of its points, m.
  };

  /// A node of the tree.
  struct Node {
    Vector3 centre = Vector3::Zero();  ///< Of its box, m,
    Vector3 half = Vector3::Zero();    ///< and half its edges, m.
    double radius = 0;                 ///< Of the ball about it, m.
    Vector3 axis = Vector3::UnitZ();   ///< All normals in it, and next to it, are within
    double angle = 0;                  ///< this angle of this axis, rad.
    std::uint32_t first = 0;           ///< Of its triangles.
    std::uint32_t count = 0;
    std::uint32_t right = 0;  ///< The left child is the next node; 0: a leaf.
  };

  /// A point of the surface that is nearest to another one.
  struct Nearest {
    double distance = 0;  ///< m, not signed.
    Vector3 p = Vector3::Zero();
    std::uint32_t triangle = 0;
    FeatureKind kind = FeatureKind::kFace;
    std::uint8_t index = 0;  ///< Which edge or corner of the triangle.
  };

  /// `closed`: every edge joins two triangles.
  MeshSolid(const std::vector<Vector3>& points, const std::vector<Corners>& triangles, bool closed);

  bool is_closed() const noexcept { return closed_; }
  const Eigen::AlignedBox3d& bounds() const noexcept { return bounds_; }
  const std::vector<Triangle>& triangles() const noexcept { return triangles_; }
  const Vector3& point(std::uint32_t index) const noexcept { return points_[index]; }
  const Vector3& corner(const Triangle& triangle, std::size_t i) const noexcept {
    return points_[triangle.corner[i]];
  }
  /// Normal of a vertex: of the triangles there, each by its angle.
  const Vector3& vertex_normal(std::uint32_t point) const noexcept { return normals_[point]; }
  bool is_on_rim(std::uint32_t point) const noexcept { return on_rim_[point]; }

  /// The point nearest to p, if it is no farther than `within`, m.
  std::optional<Nearest> nearest(const Vector3& p, double within) const noexcept;
  /// Normal of the surface there, not unit: p is outside if it lies on its side.
  Vector3 pseudonormal(const Nearest& nearest) const noexcept;
  /// Signed distance of a closed solid, negative inside, m.
  double distance(const Vector3& p) const noexcept;
  bool contains(const Vector3& p) const noexcept {
    return closed_ && bounds_.contains(p) && distance(p) < 0;
  }
  /// Whether the way from p along the unit vector u meets no triangle, its ends left out.
  bool is_clear(const Vector3& p, const Vector3& u, double length) const noexcept;

  /// Whether no edge at a vertex rises along n by more than `slope`, rad.
  bool is_summit(std::uint32_t point, const Vector3& n, double slope) const noexcept;
  /// Of the broad triangles at a vertex the one whose normal, or for a `side` of -1 the opposite of
  /// it, is nearest to n and within an angle of it whose cosine is `least`; null: there is none.
  const Triangle* broad_at(std::uint32_t point, const Vector3& n, double side,
                           double least) const noexcept;

  /// Calls `use(triangle)` for the triangles at a point.
  template <class Use>
  void for_each_at(std::uint32_t point, const Use& use) const {
    for (std::uint32_t k = first_[point]; k < first_[point + 1]; ++k) use(triangles_[around_[k]]);
  }

  /// Calls `use(triangle)` for the triangles of the leaves that `enters(node)`.
  template <class Enters, class Use>
  void visit(const Enters& enters, const Use& use) const {
    constexpr std::uint64_t kNodeWork = 15;
    std::array<std::uint32_t, kMostOpen> open;
    std::size_t count = 0;
    open[count++] = 0;
    while (count > 0) {
      const std::uint32_t index = open[--count];
      const Node& node = nodes_[index];
      Work::add(kNodeWork);
      if (!enters(node)) continue;
      if (node.right == 0) {
        for (std::uint32_t i = node.first; i < node.first + node.count; ++i) use(i);
      } else {
        open[count++] = node.right;
        open[count++] = index + 1;
      }
    }
  }

 private:
  /// Halved at each level, a tree of 2^32 triangles is no deeper.
  static constexpr std::size_t kMostOpen = 64;

  void find_neighbours();
  void find_bends();
  void find_broad();
  void list_features();
  void build(std::vector<std::uint32_t>& order);
  std::uint32_t build(std::vector<std::uint32_t>& order, const std::vector<Vector3>& middles,
                      std::uint32_t first, std::uint32_t count);
  void find_cones();

  bool closed_;
  std::vector<Vector3> points_;
  std::vector<Vector3> normals_;  ///< By point.
  std::vector<bool> on_rim_;      ///< By point.
  std::vector<Triangle> triangles_;
  std::vector<Node> nodes_;
  Eigen::AlignedBox3d bounds_;
  /// The triangles at point i are those from first_[i] to first_[i + 1].
  std::vector<std::uint32_t> first_;
  std::vector<std::uint32_t> around_;
};

/// The solids of a mesh: its closed parts, each outside out, cavities with what is around them, and
/// its open ones. Walls inside of a solid, where three triangles meet at each of their edges, are
/// left out.
std::vector<MeshSolid> solids_of(const Mesh& mesh);

}  // namespace hlm::geometry
