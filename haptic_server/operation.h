// What those who run a server need of it: recordings, its state, its socket, its watchdog, its
// guard.
#pragma once

#include <functional>
#include <memory>

#include "hlm/haptic_server/device/motor_guard.h"
#include "hlm/haptic_server/operator_socket.h"
#include "hlm/haptic_server/options.h"
#include "hlm/haptic_server/report/flight_recorder.h"
#include "hlm/haptic_server/report/state_file.h"
#include "hlm/haptic_server/service_manager.h"
#include "hlm/protocol/datagram_link.h"

namespace hlm::server {

/// Makes SIGUSR1 ask for a recording from here on. Not for the servo thread.
class Operation {
 public:
  /// `guard` must outlive this; `listen`: where the server does. release_fault: what a person at
  /// this machine asks for; called in a thread of its own.
  Operation(const ServerOptions& options, const protocol::Endpoint& listen, const Device& device,
            MotorGuard& guard, std::function<void()> release_fault);

  /// Every tick, in order.
  void observe(const TickRecord& record);
  void stopping() { manager_.stopping(); }

 private:
  ServiceManager manager_;
  StateFile state_;
  OperatorSocket socket_;                     ///< In the folder that the state file has made.
  std::unique_ptr<FlightRecorder> recorder_;  ///< Null: no ticks are kept.
  MotorGuard& guard_;
  double guard_seen_ = 0;  ///< s.
};

}  // namespace hlm::server
