// From SDFormat's geometry and quantities to ours.
#pragma once

#include <string>
#include <vector>

#include <ignition/math/Matrix3.hh>
#include <ignition/math/Pose3.hh>
#include <sdf/Collision.hh>

#include "ve_client/world/world_description.h"

namespace hlm::ve {

Vector3 to_vector(const ignition::math::Vector3d& v);
Matrix3 to_matrix(const ignition::math::Matrix3d& m);
Pose to_pose(const ignition::math::Pose3d& pose);

/// The convex pieces of a collision of a link whose SDF frame S has its origin at p_BS (m);
/// `fixed`: the link never moves. `where` names it in messages. A mesh is its convex hull if it is
/// convex or <haptic:pieces> in <mesh> says "hull", its triangles if it is fixed or that says
/// "triangles", and else its convex decomposition ("parts"). Throws std::runtime_error for sizes
/// that are not finite and > 0, for friction < 0, and for meshes that cannot be used; `repairs`: as
/// read_mesh().
std::vector<CollisionDescription> to_collisions(const sdf::Collision& collision,
                                                const Vector3& p_BS, const std::string& where,
                                                bool fixed, std::vector<std::string>& repairs);

}  // namespace hlm::ve
