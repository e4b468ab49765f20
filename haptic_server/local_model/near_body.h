// The scene's bodies near the tool, and who moves them (docs/method.md 21).
#pragma once

#include <algorithm>
#include <cstdint>

#include "hlm/common/contact.h"
#include "hlm/common/static_vector.h"

namespace hlm::server {

enum class Owner : std::uint8_t {
  kEnvironment,  ///< It goes on as it was reported.
  kServer,       ///< It bears upon the tool: the local model moves it.
  kGivenBack,    ///< It does no more, and the environment has not said that it has it.
};

struct NearBody {
  BodyPose pose;  ///< Where it is now or, if the local model moves it, was when that began.
  Pose X_CB;      ///< Its frame in that of the local body.
  Owner owner = Owner::kEnvironment;
  std::uint32_t number = 0;  ///< Of Ownership.
  bool kept = false;         ///< The environment lets nobody else move it.
  double pace = 1;           ///< Of its time, when it was reported.
  double apart = 0;          ///< Since it bore upon the tool, s.
};
/// What an update says of a body; nothing is the environment's from the beginning.
inline Ownership owner_of(std::uint32_t body, const Ownerships& owners) noexcept {
  const auto found = std::ranges::find(owners, body, &Ownership::body);
  return found == owners.end() ? Ownership{.body = body} : *found;
}

/// It goes on as it was reported, for dt, s.
inline void advance(BodyPose& pose, double dt) noexcept {
  pose.X_WB.p += dt * pose.V_W.head<3>();
  pose.X_WB.R = (rotation_from_vector(dt * pose.V_W.tail<3>()) * pose.X_WB.R).normalized();
}

inline Vector3 velocity_at(const BodyPose& pose, const Vector3& p_W) noexcept {
  return pose.V_W.head<3>() + pose.V_W.tail<3>().cross(p_W - pose.X_WB.p);
}

using NearBodies = StaticVector<NearBody, kMaxPoses>;

}  // namespace hlm::server
