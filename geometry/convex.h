// A convex shape as contact detection sees it: a core swept by a sphere, its support function and
// its features.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "hlm/common/spatial.h"
#include "hlm/common/static_vector.h"
#include "hlm/geometry/feature.h"
#include "hlm/geometry/shape.h"

namespace hlm::geometry {

/// Most corners of one face. A face of a hull that has more is represented by those whose loss
/// would cost most of its area: of a circle of 100 mm radius at most 0.5 mm are cut off. With more,
/// two round faces cost more time to clip.
inline constexpr std::size_t kMaxFaceCorners = 32;

/// The part of a core that looks in one direction: a face (3 or more corners, counter-clockwise
/// seen from outside), an edge (2) or a vertex (1). A half-space is a face without corners.
struct Patch {
  struct Corner {
    Vector3 p;       ///< m, frame of the shape.
    Feature vertex;  ///< This corner.
    Feature side;    ///< The edge from this corner towards the next.
  };
  StaticVector<Corner, kMaxFaceCorners> corners;
  Feature feature;                    ///< The face, edge or vertex itself.
  Vector3 normal = Vector3::UnitZ();  ///< Normal of a face: outward, unit, frame of the shape.
  bool round = false;                 ///< Whether the surface beside it is round: an edge that a
                                      ///< sphere sweeps, or the line of a lateral surface.

  bool is_face() const noexcept { return corners.size() != 1 && corners.size() != 2; }
};

/// An immutable convex shape in its own frame. Lengths in m.
///
/// Numbering of features, the same for every shape of a kind:
/// - sphere: vertex 0;
/// - capsule: vertices 0 (-z), 1 (+z); edge 0;
/// - box: vertex 4·[z>0] + 2·[y>0] + [x>0]; faces -x, +x, -y, +y, -z, +z; edges in the order in
///   which the faces meet them;
/// - cylinder: faces 0 (-z), 1 (+z); vertices at fixed angles on the rims, and one at either end of
///   the line of contact of the lateral surface; edges: chords between those vertices, that line
///   (whichever line it is: it rolls), the rims;
/// - ellipsoid: vertex 0, wherever it touches;
/// - hull: as convex_hull() numbers vertices and faces; edges in the order in which faces meet
/// them;
/// - half-space: face 0.
class Convex {
 public:
  /// Throws std::invalid_argument if a size is not finite and > 0, and as convex_hull().
  explicit Convex(const Shape& shape);

  /// Radius of the sphere that sweeps the core, >= 0.
  double margin() const noexcept { return margin_; }
  bool is_half_space() const noexcept { return kind_ == Kind::kHalfSpace; }
  /// True if normals of faces and cross products of edge directions are all that can separate the
  /// core from another such core; false if the core is curved.
  bool is_polytope() const noexcept {
    return kind_ == Kind::kPolytope || kind_ == Kind::kBox || is_hull();
  }
  /// A polytope with so many of both that trying all takes too long: a hull of more than six
  /// vertices.
  bool is_hull() const noexcept { return kind_ == Kind::kHull; }
  bool is_box() const noexcept { return kind_ == Kind::kBox; }
  bool is_cylinder() const noexcept { return kind_ == Kind::kCylinder; }
  bool is_ellipsoid() const noexcept { return kind_ == Kind::kEllipsoid; }
  /// Half the length of a cylinder, m.
  double half_length() const noexcept { return cylinder_.length / 2; }
  bool has_faces() const noexcept { return !face_normals_.empty(); }
  /// True if the core is a point, the origin.
  bool is_point() const noexcept { return vertices_.size() == 1; }

  /// A point of the core farthest along `direction` (any length > 0). Not for half-spaces.
  Vector3 support(const Vector3& direction) const noexcept;
  /// How fast that point moves while the unit direction turns by `turn` (perpendicular to it), m
  /// per rad. Zero for a vertex; for a cylinder that of its rim.
  Vector3 support_rate(const Vector3& direction, const Vector3& turn) const noexcept;
  /// Corners of a polytope, in the order of their features, m.
  std::span<const Vector3> vertices() const noexcept { return vertices_; }
  /// Outward unit normals of the core's faces.
  std::span<const Vector3> face_normals() const noexcept { return face_normals_; }
  /// How high the point p of the shape's frame is over the plane of a face, m. Not for half-spaces.
  double height_over_face(std::size_t face, const Vector3& p) const noexcept {
    return face_normals_[face].dot(p - vertices_[faces_[face].vertices[0]]);
  }
  /// Unit directions of the core's straight edges, each once. None if is_hull().
  std::span<const Vector3> edge_directions() const noexcept { return edge_directions_; }

  /// The face whose normal is nearest `direction` (unit); for a capsule its edge, for a sphere its
  /// vertex, for the lateral surface of a cylinder its line.
  Patch facing(const Vector3& direction) const;
  /// The edge at the support point along `direction` (unit) that is most nearly perpendicular
  /// to it; the vertex if there is no edge.
  Patch edge_facing(const Vector3& direction) const;
  /// The smallest feature that contains the point p of the core's surface, to within a micrometre.
  Feature feature_at(const Vector3& p) const;

  /// Half the extents along the axes of the shape's frame, margin included; infinite for a
  /// half-space.
  Vector3 half_extents() const;
  /// Smallest axis-aligned box in W that contains the shape at X_WS. That of a half-space is the
  /// whole of space, -infinity to +infinity along each axis.
  Eigen::AlignedBox3d bounds(const Pose& X_WS) const;

 private:
  enum class Kind : std::uint8_t { kPolytope, kBox, kCylinder, kEllipsoid, kHull, kHalfSpace };
  struct Edge {
    std::uint16_t from;
    std::uint16_t to;
  };
  struct Face {
    std::vector<std::uint16_t> vertices;  ///< Counter-clockwise seen from outside.
    std::vector<std::uint16_t> edges;     ///< edges[i] joins vertices[i] and the next one.
    std::vector<std::uint16_t> telling;   ///< Which of them are the corners of its patch.
  };

  void build(const Sphere& sphere);
  void build(const Capsule& capsule);
  void build(const Cylinder& cylinder);
  void build(const Box& box);
  void build(const Ellipsoid& ellipsoid);
  void build(const Hull& hull);
  void build(const HalfSpace& half_space);
  void add_face(std::vector<std::uint16_t> loop);
  std::uint16_t edge_between(std::uint16_t from, std::uint16_t to);
  void collect_edge_directions();

  Patch face_patch(std::size_t face) const;
  Patch edge_patch(std::size_t edge) const;
  Patch vertex_patch(std::size_t vertex) const;
  Patch lateral_patch(const Vector3& direction) const;
  Patch rolling_patch(const Vector3& direction) const;
  std::size_t support_vertex(const Vector3& direction) const noexcept;
  std::size_t farthest_of_first(std::size_t count, const Vector3& direction) const noexcept;
  std::size_t face_above(const Vector3& p) const noexcept;
  Feature cylinder_feature_at(const Vector3& p) const;
  Feature hull_feature_at(const Vector3& p) const;

  Kind kind_ = Kind::kPolytope;
  double margin_ = 0;
  Vector3 box_half_ = Vector3::Zero();  ///< Half the edge lengths, if kind_ is kBox.
  Cylinder cylinder_;                   ///< If kind_ is kCylinder.
  Vector3 radii_ = Vector3::Zero();     ///< If kind_ is kEllipsoid.
  std::vector<Vector3> vertices_;
  std::vector<Edge> edges_;
  std::vector<Face> faces_;
  std::vector<Vector3> face_normals_;  ///< Normals in the order of faces_.
  std::vector<Vector3> edge_directions_;
  std::vector<std::vector<std::uint16_t>> edges_of_;  ///< Edges by vertex, if kind_ is kHull.
  /// In a hull of kClimbFrom vertices or more, the neighbours of vertex i are those from
  /// first_neighbour_[i] to first_neighbour_[i + 1].
  std::vector<std::uint16_t> neighbours_;
  std::vector<std::uint32_t> first_neighbour_;
};

}  // namespace hlm::geometry
