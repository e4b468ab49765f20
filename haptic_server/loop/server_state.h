// Whether the server may render force now, and why not.
#pragma once

#include <algorithm>

#include "common/vocabulary.h"

namespace hlm::server {

/// The server's state machine:
///
///   kIdle    --begin()--> kRunning     a client was granted a session
///   kRunning --tick()---> kSilent      nothing heard for silence_time, or no update for longer
///   kRunning, kSilent --end()--> kSilent, and from there, once faded, to kIdle
///   kSilent  --update()-> kRunning     the client is back
///   any      --fail()---> kFault       latched; only begin() leaves it
///
/// Force is wanted in kRunning alone. Who calls begin() in kFault must know that a person asks.
class ServerStateMachine {
 public:
  /// Without a whole update for so long contacts are too old, s, though parts of updates or
  /// controls show that the client lives.
  static constexpr double kOldestContacts = 0.25;

  /// dt: servo period, s.
  explicit ServerStateMachine(double dt) noexcept : dt_(dt) {}

  ServerState state() const noexcept { return state_; }
  Fault fault() const noexcept { return fault_; }
  bool wants_force() const noexcept { return state_ == ServerState::kRunning; }
  /// Whether the proxy moves on: in a session without a fault.
  bool simulates() const noexcept {
    return state_ == ServerState::kRunning || state_ == ServerState::kSilent;
  }

  /// silence_time: s in which nothing is heard, after which force fades.
  void begin(double silence_time) noexcept {
    state_ = ServerState::kRunning;
    fault_ = Fault::kNone;
    ending_ = false;
    update(silence_time);
  }
  /// Something came of the client.
  void hear() noexcept { silence_ = 0; }
  /// A whole update came.
  void update(double silence_time) noexcept {
    silence_time_ = silence_time;
    silence_ = age_ = 0;
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
    age_ += dt_;
    const bool silent = silence_ > silence_time_ || age_ > std::max(silence_time_, kOldestContacts);
    if (state_ == ServerState::kRunning && silent) state_ = ServerState::kSilent;
    if (state_ == ServerState::kSilent && ending_ && faded) state_ = ServerState::kIdle;
  }

 private:
  double dt_;
  double silence_time_ = 0;  ///< s.
  ServerState state_ = ServerState::kIdle;
  Fault fault_ = Fault::kNone;
  double silence_ = 0;   ///< Since anything was heard, or the session's begin, s.
  double age_ = 0;       ///< Since the latest whole update, or the session's begin, s.
  bool ending_ = false;  ///< The client said goodbye.
};

}  // namespace hlm::server
