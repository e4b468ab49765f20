// From SDFormat's geometry and quantities to ours.
#pragma once

#include <string>

#include <ignition/math/Matrix3.hh>
#include <ignition/math/Pose3.hh>
#include <sdf/Collision.hh>

#include "ve_client/world/world_description.h"

namespace hlm::ve {

Vector3 to_vector(const ignition::math::Vector3d& v);
Matrix3 to_matrix(const ignition::math::Matrix3d& m);
Pose to_pose(const ignition::math::Pose3d& pose);

/// A collision of a link whose SDF frame S has its origin at p_BS (m). `where` names it in
/// messages. Throws std::runtime_error for sizes that are not finite and > 0 and for friction < 0.
CollisionDescription to_collision(const sdf::Collision& collision, const Vector3& p_BS,
                                  const std::string& where);

}  // namespace hlm::ve
