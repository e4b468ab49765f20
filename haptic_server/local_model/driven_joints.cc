#include "hlm/haptic_server/local_model/driven_joints.h"

#include <algorithm>
#include <cmath>

namespace hlm::server {

void DrivenJoints::adopt(const JointDrives& drives, const ToolModel& tool) noexcept {
  const auto before = driven_;
  driven_.clear();
  for (const JointDrive& drive : drives) {
    Driven& driven = driven_.emplace_back();
    driven.drive = drive;
    driven.coordinate = tool.velocity_index(drive.link);
    const auto same = std::ranges::find(before, driven.coordinate, &Driven::coordinate);
    if (same != before.end()) driven.at_limit = same->at_limit;
  }
}

void DrivenJoints::begin_step(const ToolModel& proxy, std::optional<double> opening,
                              double dt) noexcept {
  dt_ = dt;
  for (Driven& driven : driven_) {
    const JointDrive& drive = driven.drive;
    const double led = drive.closed + opening.value_or(0) * (drive.open - drive.closed);
    const double wanted = drive.follows_device && opening ? led : drive.target;
    const Link& link = proxy.description().links[drive.link];
    const double target = std::clamp(wanted, link.lower, link.upper);
    const double q = proxy.configuration()[proxy.coordinate_index(drive.link)];
    driven.constant = drive.stiffness * (target - q);
    driven.impedance = drive.damping + dt * drive.stiffness;
  }
}

void DrivenJoints::add_to(MassMatrix& E, GeneralisedForce& r) const noexcept {
  for (const Driven& driven : driven_) {
    const int i = driven.coordinate;
    if (driven.at_limit != 0) {
      r[i] += dt_ * driven.at_limit * driven.drive.most;
    } else {
      r[i] += dt_ * driven.constant;
      E(i, i) += dt_ * driven.impedance;
    }
  }
}

bool DrivenJoints::revise(const Velocity& v) noexcept {
  bool revised = false;
  for (Driven& driven : driven_) {
    const double wanted = driven.force(v[driven.coordinate]);
    const bool beyond = std::abs(wanted) > driven.drive.most;
    const double limit = beyond ? std::copysign(1.0, wanted) : 0;
    revised |= limit != driven.at_limit;
    driven.at_limit = limit;
  }
  return revised;
}

double DrivenJoints::Driven::limited(double v) const noexcept {
  return at_limit != 0 ? at_limit * drive.most : force(v);
}

GeneralisedForce DrivenJoints::end_step(const Velocity& v, const GeneralisedForce& tau) noexcept {
  GeneralisedForce done = GeneralisedForce::Zero(v.size());
  grip_ = opening_force_ = 0;
  for (const Driven& driven : driven_) {
    const int i = driven.coordinate;
    const double stroke = driven.drive.open - driven.drive.closed;
    done[i] += driven.limited(v[i]);
    grip_ += stroke < 0 ? -tau[i] : tau[i];
    if (driven.drive.follows_device) opening_force_ += tau[i] * stroke;
  }
  return done;
}

}  // namespace hlm::server
