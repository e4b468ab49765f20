// What does a ray meet in a mesh?
#pragma once

#include "hlm/geometry/box_tree.h"
#include "hlm/geometry/mesh.h"

namespace hlm::geometry {

/// A tree over the triangles of a mesh.
class MeshRays {
 public:
  /// `mesh` outlives this.
  explicit MeshRays(const Mesh& mesh);

  /// Distance along the unit vector u from p to the first triangle beyond `least`, m; +infinity if
  /// there is none.
  double distance(const Vector3& p, const Vector3& u, double least) const;
  /// The same to the first triangle that looks along u: where it leaves what the mesh encloses.
  double to_exit(const Vector3& p, const Vector3& u, double least) const;

 private:
  template <class Counts>
  double first(const Vector3& p, const Vector3& u, double least, const Counts& counts) const;
  double to_triangle(const Vector3& p, const Vector3& u, std::size_t triangle) const;

  const Mesh& mesh_;
  BoxTree tree_;
};

}  // namespace hlm::geometry
