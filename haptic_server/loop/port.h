// The port to the device: what is read from it, what of a wrench it is given, and the energy that
// goes through it (docs/method.md 13).
#pragma once

#include <optional>

#include "hlm/haptic_server/control/controller.h"
#include "hlm/haptic_server/device/device.h"
#include "hlm/haptic_server/local_model/local_model.h"
#include "hlm/haptic_server/loop/servo_options.h"
#include "hlm/haptic_server/report/tick_record.h"
#include "hlm/haptic_server/safety/energy_account.h"
#include "hlm/haptic_server/safety/grip_port.h"
#include "hlm/haptic_server/safety/limiter.h"

namespace hlm::server {

/// What the device did in a tick: what a replay needs of it.
struct DeviceExchange {
  bool read = false;                 ///< It was read: there is a session.
  std::optional<DeviceState> state;  ///< Empty: it failed.
  bool written = true;               ///< It took the command.
};

class Port {
 public:
  /// `options` must be valid; `device` must outlive this.
  Port(const ServoOptions& options, Device& device) noexcept;

  /// A session begins with the proxy's hand frame at X_WH: motors on, no force yet.
  void begin(const Pose& X_WH) noexcept;
  /// A tick: whether force is wanted in it. It falls and rises as the limiter says.
  void allow(bool force) noexcept;
  /// The guard has taken the motors off since the tick before.
  void halt() noexcept { halted_ = true; }
  bool halted() const noexcept { return halted_; }
  /// A fault is over: force may rise again from zero.
  void settle() noexcept {
    limiter_.settle();
    grip_.settle();
  }
  /// No force at once, motors off.
  void cut() noexcept;
  /// Motors off, as a session ends.
  void disable() noexcept { device_.disable(); }

  /// Reads the device, and fills in the record; `first`: in the session's first step. Null: it
  /// failed, for the reason that cause() gives.
  const DeviceState* read(bool first, TickRecord& record) noexcept;
  /// Keeps the ledger, and turns the motors on again if the guard has taken them off. A fault where
  /// the handle, or what it was given, is beyond its limits.
  Fault observe(const DeviceState& device, TickRecord& record) noexcept;
  /// What the proxy's step explains: that of one which took the device's pose, or of one under the
  /// hand's wrench, from X_WP on; as EnergyAccount has it.
  void explain(const LocalModel& model) noexcept;
  void explain(const LocalModel& model, const Pose& X_WP, const Wrench& F_hand,
               const DeviceState& device, bool twice) noexcept;
  /// An update changed the energy in the springs of contacts, J.
  void adopted(double before, double after) noexcept { energy_.adopted(before, after); }
  /// The gripper of the next write() opens with so much, N at its finger, and with no more than
  /// GripPort allows; it rises and fades as force does.
  void grip(double force) noexcept;
  /// Gives the device what it may have of the wrenches u, the impulse's and the weight's. A fault
  /// where that is no number or the device does not take it.
  Fault write(const Wrench& u, const Wrench& impulse, const Wrench& weight,
              const DeviceState& device, TickRecord& record) noexcept;
  /// The impulse's part of the wrench, as it is spread over ticks.
  const Wrench& impulse_wrench() const noexcept { return limiter_.impulse_wrench(); }

  Device& device() noexcept { return device_; }
  const DeviceRatings& ratings() const noexcept { return device_.ratings(); }
  ForceLevel level() const noexcept { return limiter_.level(); }
  ForceLimit limited_by() const noexcept { return limiter_.limited_by(); }
  /// That the device gets, N.
  double largest_force() const noexcept { return limiter_.budget().max_force; }
  /// What gave too much, after Fault::kEnergy.
  const char* giver() const noexcept { return grip_.overdrawn() ? "by its gripper" : ""; }
  /// Why the device failed.
  const char* cause() const noexcept { return cause_ != nullptr ? cause_ : device_.cause(); }
  /// The exchange in the present tick.
  const DeviceExchange& exchange() const noexcept { return exchange_; }
  /// A tick begins.
  void clear() noexcept { exchange_ = {}; }

 private:
  void drop() noexcept;

  Device& device_;
  Limiter limiter_;
  EnergyAccount energy_;
  HandleLimits handle_;
  GripPort grip_;
  Pose X_WStart_;                ///< Handle, as the session began, or the clutch was let go.
  bool halted_ = false;          ///< The guard has taken the motors off since the tick before.
  bool clutched_ = false;        ///< Whether the device was clutched when last read.
  const char* cause_ = nullptr;  ///< Null: the device says it itself.
  DeviceExchange exchange_;
};

}  // namespace hlm::server
