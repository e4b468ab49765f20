// Telemetry in the tick: signals in batches, and the local contacts, to a client that asked.
#pragma once

#include "hlm/haptic_server/local_model/local_model.h"
#include "hlm/haptic_server/report/tick_record.h"
#include "hlm/protocol/server_session.h"

namespace hlm::server {

/// Off until it is asked for, in each session again. Nothing allocates, waits or throws.
class Telemetry {
 public:
  /// A session begins; nobody has asked.
  void begin() noexcept {
    on_ = false;
    age_ = 0;
    batch_.ticks.clear();
    next_step_ = 0;
  }
  void switch_on(bool on) noexcept {
    if (on == on_) return;
    on_ = on;
    batch_.ticks.clear();
    next_step_ = 0;
  }

  /// One step with its signals. previous_execution: of the step before, s. limit: of the wrench
  /// commanded in it. Sends when a batch is full.
  /// Steps that were missed since the one before are sent as it was.
  void tick(double now, const TickRecord& record, double previous_execution, ForceLimit limit,
            protocol::ServerSession& session) noexcept;
  /// The contacts of this step.
  void contacts(double now, std::uint64_t step, const LocalModel& model,
                protocol::ServerSession& session) noexcept;

 private:
  void add(double now, std::uint64_t step, const protocol::TickSignals& signals,
           protocol::ServerSession& session) noexcept;
  void send(double now, protocol::ServerSession& session) noexcept;

  bool on_ = false;
  double age_ = 0;               ///< Age of the latest contacts, s.
  std::uint64_t next_step_ = 0;  ///< After the latest that was sent or is to be; 0: none was.
  protocol::TickSignals latest_;
  protocol::Ticks batch_;
  protocol::LocalState state_;
};

}  // namespace hlm::server
