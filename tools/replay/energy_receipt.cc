#include "hlm/tools/replay/energy_receipt.h"

#include <algorithm>
#include <cmath>
#include <ostream>

#include <spdlog/fmt/fmt.h>

namespace hlm::server {

EnergyReceipt::EnergyReceipt(std::ostream& out) : out_(out) {
  out_ << "session,step,update,given_J,taken_J,explained_J,tank_J,brought_J\n";
}

void EnergyReceipt::observe(const TickRecord& record) {
  if (record.step == 0) return;
  if (before_ && before_->session == record.session) {
    const double work =
        work_at_handle(before_->F_command, displacement(before_->X_WD, record.X_WD), record.scale);
    (work > 0 ? all_.given : all_.taken) += std::abs(work);
    (work > 0 ? since_update_.given : since_update_.taken) += std::abs(work);
  }
  before_ = record;
  const double net = all_.given - all_.taken - record.port.explained;
  least_net_ = std::min(least_net_, net);
  largest_net_ = std::max(largest_net_, net - least_net_);
  if (!begin_) begin_ = record.time;
  closest_ =
      std::max(closest_, all_.given - all_.taken - record.port_power * (record.time - *begin_));
  largest_difference_ = std::max({largest_difference_, std::abs(all_.given - record.port.given),
                                  std::abs(all_.taken - record.port.taken)});
  if (record.adopted == 0) return;
  out_ << fmt::format("{},{},{},{},{},{},{},{}\n", record.session, record.step, record.adopted,
                      since_update_.given, since_update_.taken, record.port.explained - explained_,
                      record.port.tank, record.brought);
  since_update_ = {};
  explained_ = record.port.explained;
}

std::string EnergyReceipt::total() const {
  if (!before_) return "the port gave and took nothing: no step was played\n";
  return fmt::format(
      "the port gave {:.6g} J and took {:.6g} J in {} steps; {:.6g} J of the difference is weight "
      "and moving constraints; beyond that it never gave more than {:.6g} J at a stretch. Given "
      "less taken came to {:.6g} J and {:g} W of the time; the bound is {:.6g} J. Not covered: "
      "a gripper, motors, amplifiers, and the delay of the device\n",
      all_.given, all_.taken, before_->step, before_->port.explained, largest_net_, closest_,
      before_->port_power, before_->port_bound);
}

}  // namespace hlm::server
