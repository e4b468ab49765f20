#include "hlm/haptic_server/loop/telemetry.h"

#include <cmath>

namespace hlm::server {
namespace {

/// Most missed periods that are filled, as many as in 32 ms at 1 kHz: longer, the motors are off.
constexpr std::uint64_t kMostHeld = 32;

protocol::TickSignals signals(const TickRecord& record, double previous_execution, double age,
                              ForceLimit limit) noexcept {
  return {.F_env = record.F_env.head<3>(),
          .F_command = record.F_command.head<3>(),
          .F_hand = record.F_hand.head<3>(),
          .torque = record.F_command.tail<3>().norm(),
          .smallest_separation = record.smallest_separation,
          .device_proxy = (record.X_WD.p - record.X_WP.p).norm(),
          .proxy_tool = (record.X_WP.p - record.X_WT.p).norm(),
          .lateness = record.lateness,
          .execution = previous_execution,
          .age = age,
          .active_contacts = static_cast<std::uint16_t>(record.active_contacts),
          .predicted_contacts = static_cast<std::uint16_t>(record.predicted_contacts),
          .adopted = record.adopted > 0,
          .limit = limit};
}

protocol::LocalContactReport report(const LocalContact& contact) noexcept {
  return {.identity = contact.identity,
          .a = contact.a,
          .b = contact.b,
          .state = contact.now.state,
          .retained = contact.deformation.deferred > 0 || contact.orphaned(),
          .c_W = contact.now.c_W,
          .n_W = contact.now.n_W,
          .p_W = contact.now.p_W,
          .s = contact.now.s,
          .f_W = contact.latest.f_W};
}

}  // namespace

void Telemetry::tick(double now, const TickRecord& record, double previous_execution,
                     ForceLimit limit, protocol::ServerSession& session) noexcept {
  if (!on_) return;
  if (record.adopted > 0) age_ = record.age;
  // A period that was missed shows what the device held in it.
  const std::uint64_t missed = next_step_ > 0 ? record.step - next_step_ : kMostHeld + 1;
  if (missed <= kMostHeld) {
    for (std::uint64_t i = 0; i < missed; ++i) add(now, next_step_, latest_, session);
  } else if (!batch_.ticks.empty()) {
    send(now, session);
  }
  latest_ = signals(record, previous_execution, age_, limit);
  add(now, record.step, latest_, session);
}

void Telemetry::add(double now, std::uint64_t step, const protocol::TickSignals& signals,
                    protocol::ServerSession& session) noexcept {
  if (batch_.ticks.empty()) batch_.first_step = step;
  batch_.ticks.push_back(signals);
  next_step_ = step + 1;
  if (batch_.ticks.size() == protocol::kTicksPerMessage) send(now, session);
}

void Telemetry::send(double now, protocol::ServerSession& session) noexcept {
  session.inform(now, batch_);
  batch_.ticks.clear();
}

void Telemetry::contacts(double now, std::uint64_t step, const LocalModel& model,
                         protocol::ServerSession& session) noexcept {
  if (!on_) return;
  state_.step = step;
  state_.contacts.clear();
  const auto add = [&](const LocalContacts& contacts, bool touching) {
    for (const LocalContact& contact : contacts) {
      if ((contact.now.s <= 0) != touching) continue;
      // One between bodies that are held since their step led nowhere.
      if (!std::isfinite(contact.now.s) || !contact.latest.f_W.allFinite()) continue;
      if (state_.contacts.size() == state_.contacts.capacity()) return;
      state_.contacts.push_back(report(contact));
    }
  };
  add(model.contacts(), true);
  add(model.supports(), true);
  add(model.contacts(), false);
  add(model.supports(), false);
  session.inform(now, state_);
}

}  // namespace hlm::server
