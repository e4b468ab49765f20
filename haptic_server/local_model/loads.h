// What loads the proxy besides its contacts and the hand.
#pragma once

#include "hlm/haptic_server/local_model/driven_joints.h"
#include "hlm/haptic_server/local_model/link_wrenches.h"

namespace hlm::server {

struct Loads {
  explicit Loads(const ToolDescription& tool) noexcept
      : external(tool),
        of_contacts(GeneralisedForce::Zero(tool.dof())),
        latest(GeneralisedForce::Zero(tool.dof())) {}

  LinkWrenches external;
  DrivenJoints drives;
  GeneralisedForce of_contacts;  ///< τ of the tool's contacts in the latest step, N or N·m.
  GeneralisedForce latest;       ///< τ of these and of its weight in the latest step, N or N·m.
};

}  // namespace hlm::server
