// What does a ray meet in a mesh?
#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "hlm/geometry/mesh.h"

namespace hlm::geometry {

/// A tree of boxes over the triangles of a mesh.
class MeshRays {
 public:
  /// `mesh` outlives this.
  explicit MeshRays(const Mesh& mesh);

  /// Distance along the unit vector u from p to the first triangle beyond `least`, m; +infinity if
  /// there is none.
  double distance(const Vector3& p, const Vector3& u, double least) const;

 private:
  struct Node {
    Eigen::AlignedBox3d box;
    std::size_t first = 0;  ///< First of its triangles in order_.
    std::size_t count = 0;
    std::size_t right = 0;  ///< The left child is the next node; 0: a leaf.
  };

  std::size_t build(std::size_t first, std::size_t count);
  double to_triangle(const Vector3& p, const Vector3& u, std::size_t triangle) const;

  const Mesh& mesh_;
  std::vector<std::size_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace hlm::geometry
