// What the servo reports: a tick's record, and to the client the welcome and the proxy state.
#pragma once

#include <cstdint>

#include "hlm/haptic_server/device/device.h"
#include "hlm/haptic_server/local_model/local_model.h"
#include "hlm/haptic_server/loop/servo_options.h"
#include "hlm/haptic_server/loop/timing.h"
#include "hlm/haptic_server/report/tick_record.h"
#include "hlm/haptic_server/safety/state_machine.h"
#include "hlm/protocol/server_session.h"

namespace hlm::server {

/// Fills in the record's timing, states and counts of datagrams. step: of the session.
void describe(const Timing& timing, const SafetyStateMachine& machine,
              const protocol::ServerSession& session, std::uint64_t step,
              TickRecord& record) noexcept;

/// Fills in the record's proxy, the environment's tool and the contacts.
void describe(const LocalModel& model, TickRecord& record) noexcept;

/// The welcome that grants a session. fingerprint: of the server's options; silence_time: at the
/// client's nominal rate, s.
protocol::Welcome welcome(const ServoOptions& options, std::uint64_t fingerprint,
                          double silence_time, Device& device,
                          const protocol::Capabilities& capabilities) noexcept;

/// The acknowledgement of the update adopted in the tick of `record`. step, updates: of the
/// session; model: null without one. In a fault, what is not finite or of no
/// plausible size is replaced: a client refuses such numbers and would never learn of the fault.
protocol::ProxyState proxy_state(const TickRecord& record, std::uint64_t step,
                                 std::uint64_t updates, const LocalModel* model) noexcept;

/// What the tool has done to bodies: those of the latest update, and those that it has touched
/// after `contained`, the step up to which the environment has the impulses.
protocol::Impulses impulses_of(const LocalModel& model, double contained) noexcept;

/// Sends where the bodies are that the environment must place, or take back.
void tell_held(double now, std::uint64_t step, const LocalModel& model,
               protocol::ServerSession& session) noexcept;

}  // namespace hlm::server
