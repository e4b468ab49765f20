#include "hlm/haptic_server/loop/session.h"

#include <algorithm>

namespace hlm::server {
namespace {

/// Ages beyond this come from a clock gone wrong, s: constraints are not advanced further.
constexpr double kLargestAge = 1.0;

}  // namespace

void Session::begin(const protocol::Hello& hello, Freedoms missing) noexcept {
  *this = Session(dt_);
  period_ = 1 / hello.ve_rate;
  missing_freedoms_ = missing;
}

/// The round trip of the update's echo, s; empty if it has none.
std::optional<double> Session::travel_of(const protocol::ContactUpdate& update) const noexcept {
  if (update.echo_step == 0 || update.echo_step > step_) return std::nullopt;
  const double round_trip = static_cast<double>(step_ - update.echo_step) * dt_;
  return std::max(0.0, round_trip - update.echo_hold);
}

double Session::age_of(const protocol::ContactUpdate& update) const noexcept {
  return std::min(update.compute_time + travel_of(update).value_or(0) / 2, kLargestAge);
}

void Session::hear(const protocol::ContactUpdate& update) noexcept {
  const std::optional<double> travel = travel_of(update);
  if (!travel) {  // It may be as old as the session.
    oldest_ = update.compute_time + static_cast<double>(step_) * dt_;
    return;
  }
  shortest_travel_ = std::min(shortest_travel_.value_or(*travel), *travel);
  oldest_ = update.compute_time + *travel - *shortest_travel_ / 2;
}

void Session::adopted(const protocol::ContactUpdate& update) noexcept {
  contained_impulses_ = update.impulse_step;
  ++updates_;
}

}  // namespace hlm::server
