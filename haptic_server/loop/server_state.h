// Whether the server may render force now, and why not.
#pragma once

#include "common/vocabulary.h"

namespace hlm::server {

/// The server's state machine:
///
///   kIdle    --begin()--> kRunning     a client was granted a session
///   kRunning --tick()---> kSilent      no update for silence_time
///   kRunning, kSilent --end()--> kSilent, and from there, once faded, to kIdle
///   kSilent  --update()-> kRunning     the client is back
///   any      --fail()---> kFault       latched; only begin() leaves it
///
/// Force is wanted in kRunning alone.
class ServerStateMachine {
 public:
  /// silence_time: s without an update after which force fades; dt: servo period, s.
  ServerStateMachine(double silence_time, double dt) noexcept
      : silence_time_(silence_time), dt_(dt) {}

  ServerState state() const noexcept { return state_; }
  Fault fault() const noexcept { return fault_; }
  bool wants_force() const noexcept { return state_ == ServerState::kRunning; }
  /// Whether the proxy moves on: in a session without a fault.
  bool simulates() const noexcept {
    return state_ == ServerState::kRunning || state_ == ServerState::kSilent;
  }

  void begin() noexcept {
    state_ = ServerState::kRunning;
    fault_ = Fault::kNone;
    ending_ = false;
    silence_ = 0;
  }
  void update() noexcept {
    silence_ = 0;
    if (state_ == ServerState::kSilent && !ending_) state_ = ServerState::kRunning;
  }
  void end() noexcept {
    if (state_ == ServerState::kRunning) state_ = ServerState::kSilent;
    ending_ = true;
  }
  void fail(Fault fault) noexcept {
    if (state_ == ServerState::kFault) return;
    state_ = ServerState::kFault;
    fault_ = fault;
  }
  /// One servo period goes by; faded: no force is left.
  void tick(bool faded) noexcept {
    silence_ += dt_;
    if (state_ == ServerState::kRunning && silence_ > silence_time_) state_ = ServerState::kSilent;
    if (state_ == ServerState::kSilent && ending_ && faded) state_ = ServerState::kIdle;
  }

 private:
  double silence_time_;
  double dt_;
  ServerState state_ = ServerState::kIdle;
  Fault fault_ = Fault::kNone;
  double silence_ = 0;   ///< Since the latest update or the session's begin, s.
  bool ending_ = false;  ///< The client said goodbye.
};

}  // namespace hlm::server
