// Conversion of SDFormat's geometry and quantities to ours.
#pragma once

#include <optional>
#include <vector>

#include <ignition/math/Matrix3.hh>
#include <ignition/math/Pose3.hh>
#include <sdf/Collision.hh>
#include <sdf/Geometry.hh>

#include "hlm/ve_client/scene/diagnostics.h"
#include "hlm/ve_client/scene/solid.h"
#include "hlm/ve_client/scene/world_description.h"

namespace hlm::ve {

Vector3 to_vector(const ignition::math::Vector3d& v);
Matrix3 to_matrix(const ignition::math::Matrix3d& m);
Pose to_pose(const ignition::math::Pose3d& pose);

/// The <cone> of a geometry, which libsdformat does not know; null: it has none.
sdf::ElementPtr cone_of(const sdf::Geometry& geometry);

/// A collision of a file.
struct FileCollision {
  std::vector<CollisionDescription> pieces;  ///< Its convex pieces.
  std::optional<Solid> solid_B;              ///< What it fills; empty if it is fixed.
};

/// A collision of a link whose SDF frame S has its origin at p_BS (m), with
/// friction μ if the file has it; `fixed`: the link never moves. A mesh is its convex hull if it is
/// convex or <haptic:pieces> in <mesh> says "hull", its triangles if it is fixed or that says
/// "triangles", and else its convex decomposition ("parts"). A heightmap is its triangles, and must
/// be fixed. Without pieces if it cannot be used; what is refused or approximated goes to
/// `diagnostics`, with its place. Refused is what is wrong in the file: sizes below 0 or above
/// 1000 km, friction < 0, meshes and images that are not found. A collision that can have no shape,
/// as a sphere of radius 0 or a file without a mesh, is approximated: it alone is left out.
FileCollision to_collision(const sdf::Collision& collision, const Vector3& p_BS, bool fixed,
                           Diagnostics& diagnostics);

}  // namespace hlm::ve
