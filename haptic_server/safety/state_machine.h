// Whether the server may render force now, and why not.
#pragma once

#include <cstdint>

#include "hlm/common/contact.h"
#include "hlm/common/vocabulary.h"
#include "hlm/haptic_server/safety/limiter.h"

namespace hlm::server {

/// What leads from one state to another.
enum class SafetyEvent : std::uint8_t {
  kGranted,   ///< A client gets a session; in a fault only where grants_session().
  kUpdated,   ///< A whole update came, with contacts that are not too old.
  kRisen,     ///< Force is no longer held back.
  kUnheard,   ///< Nothing of the client for too long, or no such update.
  kGoodbye,   ///< The client ends its session.
  kFadedOut,  ///< No force is left, and the client has ended its session.
  kFailed,    ///< A fault.
};

/// The server's safety as one state machine. Its transitions are the table in state_machine.cc;
/// force is wanted in kRamping and kActive alone.
class SafetyStateMachine {
 public:
  /// Time without a whole update after which contacts are too old, s, though parts of updates or
  /// controls show that the client lives. More lets force outlive its contacts, less makes slow
  /// environments flutter.
  static constexpr double kLongestWithoutUpdate = 0.25;

  /// dt: servo period, s.
  explicit SafetyStateMachine(double dt) noexcept : dt_(dt) {}

  ServerState state() const noexcept { return state_; }
  Fault fault() const noexcept { return fault_; }
  Fade fade() const noexcept { return fade_; }
  /// Whether the proxy moves on: in a session without a fault.
  bool simulates() const noexcept {
    return state_ != ServerState::kOff && state_ != ServerState::kFault;
  }

  /// Whether a client may have a session now: in a fault only if a person asks for it there, after
  /// release() where ends_at_device().
  bool grants_session(bool person_asks) const noexcept {
    return state_ != ServerState::kFault || (person_asks && (released_ || !ends_at_device(fault_)));
  }
  /// A person at the device's machine lets the present fault end.
  void release() noexcept { released_ = state_ == ServerState::kFault; }
  /// A session begins, and a fault ends. silence_time: s in which nothing is heard, after which
  /// force fades.
  void begin(double silence_time) noexcept;
  /// Something came of the client.
  void hear() noexcept { silence_ = 0; }
  /// An update of the client was refused.
  void refuse() noexcept { refused_ = true; }
  /// A whole update came, its contacts `age` s old; they give force up to `oldest`, s.
  void update(double silence_time, double age, double oldest = kOldestContacts) noexcept;
  /// A whole update came of a world that waits itself: there is no force before another one.
  void stand_by(double silence_time) noexcept;
  /// The client ends the session.
  void end() noexcept;
  /// The first fault is the one that is kept, but for one that ends_at_device() after one that does
  /// not. Ends what release() allowed.
  void fail(Fault fault) noexcept;
  /// Servo periods go by, more than one where ticks were missed; `level`: of the force.
  void tick(ForceLevel level, std::uint64_t periods = 1) noexcept;

 private:
  void happen(SafetyEvent event) noexcept;
  void lose(Fade why) noexcept;

  double dt_;
  double silence_time_ = 0;  ///< s.
  ServerState state_ = ServerState::kOff;
  Fault fault_ = Fault::kNone;
  Fade fade_ = Fade::kNone;
  double silence_ = 0;         ///< Time since anything was heard, or the session began, s.
  double without_update_ = 0;  ///< Time since the latest whole update, or the session's begin, s.
  bool released_ = false;      ///< The present fault may end.
  bool refused_ = false;       ///< An update was refused since the latest whole one.
};

}  // namespace hlm::server
