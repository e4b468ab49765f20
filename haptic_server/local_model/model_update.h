// What the environment reports to the local model.
#pragma once

#include "hlm/common/contact.h"
#include "hlm/common/joint_drive.h"
#include "hlm/common/tool_model.h"

namespace hlm::server {

inline const MovableBodies kNoBodies;
inline const BodyPoses kNoPoses;
inline const AccelerationRates kNoRates;
inline const ExternalWrenches kNoWrenches;
inline const Ownerships kNoOwners;
inline const JointDrives kNoDrives;

struct ModelUpdate {
  const ReportedContacts& contacts;
  const Configuration& q_VE;  ///< Configuration of the tool for which the contacts hold.
  double age = 0;             ///< Age of the contacts with constraints of the world, s.
  const MovableBodies& bodies = kNoBodies;
  double impulse_step = 0;  ///< The bodies' state is that of this step, or part of one; 0: unknown.
  double period = 0;        ///< Period of the environment's frames, s.
  const BodyPoses& poses = kNoPoses;  ///< Where the scene's bodies are; others are not there.
  const AccelerationRates& rates = kNoRates;  ///< Of bodies.
  double time = 0;                            ///< The environment's, s.
  const Velocity* v_VE = nullptr;             ///< Of the tool at q_VE; null: nothing is external.
  /// Several on one link add up; of a link that is not named there is none.
  const ExternalWrenches& external = kNoWrenches;
  const Ownerships& owners = kNoOwners;  ///< Of `poses`.
  const JointDrives& drives = kNoDrives;
  bool holds = true;  ///< The server may move what bears upon the tool.
};

}  // namespace hlm::server
