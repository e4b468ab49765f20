#include "hlm/haptic_server/safety/hand_work.h"

namespace hlm::server {

HandWork::HandWork(const DeviceRatings& device, double capacity) noexcept
    : inertia_(diagonal(device.mass, device.inertia)),
      damping_(diagonal(device.damping, 0)),
      scale_(device.scale),
      capacity_(capacity),
      waiting_(capacity) {}

void HandWork::observe(const Pose& X_WD, const Twist& V_WD, double given) noexcept {
  const double kinetic = V_WD.dot(inertia_.cwiseProduct(V_WD)) / 2 / scale_;
  if (known_) {
    const double damped = displacement(X_WD_, X_WD).dot(damping_.cwiseProduct(V_WD)) / scale_;
    const double work = kinetic - kinetic_ + std::max(damped, 0.0) - (given - given_);
    waiting_ = std::min(waiting_ + work, capacity_);
  }
  known_ = true;
  X_WD_ = X_WD;
  kinetic_ = kinetic;
  given_ = given;
}

double HandWork::credited(double work) noexcept {
  const double credit = std::min(work, waiting_ > 0 ? waiting_ : 0);
  waiting_ = std::min(waiting_ - credit, capacity_);
  return credit;
}

}  // namespace hlm::server
