// What the server asks of a haptic device.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>

#include "hlm/common/freedoms.h"
#include "hlm/common/spatial.h"
#include "hlm/common/vocabulary.h"

namespace hlm::server {

/// How a device is that has not failed.
enum class DeviceHealth {
  kGood,
  kSaturated,  ///< The motors give less than was commanded.
  kLate,       ///< Commands reach it too late or too seldom for its own time guard.
  kForceOff,   ///< The device's own safety, or its switch, holds the motors off.
};

}  // namespace hlm::server

namespace hlm {

template <>
inline constexpr std::array<Word<server::DeviceHealth>, 4> kWords<server::DeviceHealth>{{
    {server::DeviceHealth::kGood, "good", "it works"},
    {server::DeviceHealth::kSaturated, "saturated", "its motors give less than was commanded"},
    {server::DeviceHealth::kLate, "late", "commands reach it too late or too seldom"},
    {server::DeviceHealth::kForceOff, "force_off", "its own safety holds the motors off"},
}};

}  // namespace hlm

namespace hlm::server {

/// What a device can do, in the units of the world; powers are those at the handle. A value that a
/// device does not rate is infinite.
struct DeviceRatings {
  double max_force = std::numeric_limits<double>::infinity();  ///< N.
  double continuous_force =
      std::numeric_limits<double>::infinity();                  ///< What it gives for ever, N.
  double max_torque = std::numeric_limits<double>::infinity();  ///< N·m; 0: it takes no torque.
  double max_force_rate = std::numeric_limits<double>::infinity();     ///< N/s.
  double max_torque_rate = std::numeric_limits<double>::infinity();    ///< N·m/s.
  double max_power = std::numeric_limits<double>::infinity();          ///< Power of the force, W.
  double max_turning_power = std::numeric_limits<double>::infinity();  ///< Power of the torque, W.
  double max_stiffness = std::numeric_limits<double>::infinity();      ///< Renderable, N/m.
  double max_angular_stiffness = std::numeric_limits<double>::infinity();  ///< N·m/rad.
  double mass = 0;                   ///< Apparent mass at the handle, kg; 0 if unknown.
  double inertia = 0;                ///< Apparent inertia at the handle, kg·m²; 0 if unknown.
  double damping = 0;                ///< Physical damping at the handle, N·s/m.
  std::uint8_t buttons = 0;          ///< How many it has.
  bool gripper = false;              ///< Whether it measures the opening of one.
  double max_gripper_force = 0;      ///< What that gives, N; 0: it takes no force.
  double gripper_travel = 0;         ///< Way of its finger from closed to open, m; 0: unknown.
  Freedoms freedoms = kAllFreedoms;  ///< Directions in which its handle moves.
  double scale = 1;                  ///< Metres in the world for each metre of the handle.
  double rotation_scale = 1;         ///< Radians in the world for each radian of the handle.
  /// Time without a command after which the device takes its motors off by itself, s.
  double time_guard = std::numeric_limits<double>::infinity();
  bool halts = false;  ///< Whether Device::halt() takes its motors off.
  /// How often it exchanges state and command, Hz; infinite: as often as it is asked.
  double exchange_rate = std::numeric_limits<double>::infinity();
  /// Delay from a command to its effect, and from a pose to its report, in all, s; added to the
  /// period in which the command is held.
  double delay = 0;
  /// How much later the twist that is read is than the pose, s: half the window of a mean, 1 / (2π
  /// f) of a filter of first order that cuts off at f.
  double velocity_lag = 0;
  double position_step = 0;  ///< Step of its encoders at the handle, m; 0: none that is known.
  /// By how much the twist that is read changes at one such step, m/s, and at one of its
  /// orientation, rad/s. They decide how much damping is quiet.
  double speed_step = 0;
  double turn_step = 0;

  /// N·m in the world for each N·m at the handle: so work in the world is `scale` times that at the
  /// handle, in translation and in rotation.
  double torque_scale() const noexcept { return scale / rotation_scale; }
};

struct DeviceState {
  Pose X_WD;                   ///< Handle in the world.
  Twist V_WD = Twist::Zero();  ///< Twist of the handle, world axes.
  /// The hand's wrench on the handle, world axes, about the handle's origin; empty where nobody
  /// knows it.
  std::optional<Wrench> F_hand;
  bool hand_observed = false;     ///< F_hand is not measured but estimated, from the motion.
  std::uint32_t buttons = 0;      ///< Bit i: button i is pressed.
  std::optional<double> gripper;  ///< 0 closed to 1 open; empty: it has none.
  DeviceHealth health = DeviceHealth::kGood;
  bool warm = false;  ///< Its motors say that they get warm: less force lets them cool.
  /// The hand moves the handle alone, to elsewhere in its workspace: no force is wanted.
  bool clutched = false;
};

/// The hand of a simulated device, for a person far away to hold. Called from the servo thread.
class GuidedHand {
 public:
  /// The hand draws the handle to X_WTarget until release().
  virtual void hold(const Pose& X_WTarget) noexcept = 0;
  virtual void release() noexcept = 0;

 protected:
  ~GuidedHand() = default;
};

/// One open haptic device. Poses, twists and wrenches are those of the world, except where a driver
/// says otherwise (PoseFrame). What is noexcept is called from the servo thread and neither
/// waits beyond the device's own exchange nor allocates. The destructor stops the motors and closes
/// the device, off the servo thread.
class Device {
 public:
  virtual ~Device() = default;

  /// Name for a person: "simulated planar device". Valid as long as the device.
  virtual std::string_view name() const noexcept = 0;
  virtual const DeviceRatings& ratings() const noexcept = 0;
  /// Whether DeviceState::F_hand will be filled.
  virtual bool measures_hand_wrench() const noexcept = 0;
  /// Whether it is filled with an estimate.
  virtual bool observes_hand_wrench() const noexcept { return false; }
  /// Finds where the handle is, before the first tick and off the servo thread: may take seconds,
  /// and may move the device. Throws std::runtime_error that says what is wrong.
  virtual void calibrate() {}
  /// Reports the handle's present pose as X_WH from here on, and motions relative to it; a
  /// simulated device starts its life again there, at rest.
  virtual void align(const Pose& X_WH) noexcept = 0;
  virtual void enable() noexcept = 0;
  /// Motors off. Wrenches are ignored until enable().
  virtual void disable() noexcept = 0;
  /// Null where a person holds the device.
  virtual GuidedHand* guided_hand() noexcept { return nullptr; }
  /// Present state; empty if the device failed.
  virtual std::optional<DeviceState> read() noexcept = 0;
  /// Commands the wrench that the device exerts on the hand at the handle's origin, world axes,
  /// until the next call. False if the device failed.
  virtual bool write(const Wrench& F) noexcept = 0;
  /// Force with which the gripper opens, N, from the next write() until the next call or enable(),
  /// which is none; limited by its rating. Nothing where it takes no force.
  virtual void grip(double /*force*/) noexcept {}
  /// What is wrong, in words for a person: why the latest read() or write() failed, or why its
  /// health is not good; empty where the device does not say. Text of static storage duration.
  virtual const char* cause() const noexcept { return ""; }
  /// Motors off at once, because the program dies or stands still; commands are ignored until
  /// enable(). Called in handlers of fatal signals, while the servo thread may be anywhere, and in
  /// a process that was forked after the device had been opened: a driver may do nothing here but
  /// async-signal-safe calls on what such a process inherits, descriptors and shared memory. A
  /// device that cannot be stopped so does not rate `halts`; only its own time guard ends its
  /// force.
  virtual void halt() noexcept {}
};

}  // namespace hlm::server
