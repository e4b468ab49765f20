// A simulated impedance device with a hand on it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "hlm/common/range.h"
#include "hlm/common/spatial.h"
#include "hlm/common/vocabulary.h"
#include "hlm/haptic_server/device/amplifier.h"
#include "hlm/haptic_server/device/device.h"
#include "hlm/haptic_server/device/hand.h"

namespace hlm::server {

/// How the handle can move.
enum class DeviceFreedom {
  kPlanar,   ///< x, y and rotation about z. The rest stays as it was at align().
  kSpatial,  ///< All six.
};

}  // namespace hlm::server

namespace hlm {

template <>
inline constexpr std::array<Word<server::DeviceFreedom>, 2> kWords<server::DeviceFreedom>{{
    {server::DeviceFreedom::kPlanar, "planar", "x, y and rotation about z"},
    {server::DeviceFreedom::kSpatial, "spatial", "all six"},
}};

}  // namespace hlm

namespace hlm::server {

/// Longest delay between a command and its effect, ticks.
inline constexpr int kMaxDelay = 64;
inline constexpr Range kDeviceDelays{0, kMaxDelay, "ticks"};

struct SimulatedDeviceOptions {
  DeviceFreedom freedom = DeviceFreedom::kPlanar;
  double mass = 1;                 ///< kg.
  double inertia = 2e-3;           ///< kg·m², about every axis.
  double damping = 5;              ///< N·s/m.
  double angular_damping = 5e-3;   ///< N·m·s/rad.
  double dry_friction = 0.2;       ///< N: at rest it holds less than that.
  double dry_friction_torque = 0;  ///< N·m.

  // Ratings. The motors saturate at the force and the torque; the others are for the server to
  // respect.
  double max_force = 12;              ///< N.
  double max_torque = 0.6;            ///< N·m.
  double max_force_rate = 12e3;       ///< N/s: the whole force in 1 ms.
  double max_torque_rate = 600;       ///< N·m/s.
  double max_stiffness = 10e3;        ///< N/m: what its damping renders passively at 1 kHz.
  double max_angular_stiffness = 10;  ///< N·m/rad.

  double position_step = 0;  ///< Encoder step of each coordinate, m; 0: exact.
  double angle_step = 0;     ///< Step of each component of the rotation vector, rad; 0: exact.
  /// Cut-off of the first-order low-pass on the velocity from finite differences, Hz. With encoder
  /// steps, infinite means unfiltered differences; without, the exact velocity.
  double velocity_cutoff = std::numeric_limits<double>::infinity();

  int delay = 0;                     ///< A command acts this many ticks later.
  bool measures_hand_wrench = true;  ///< False: as if it had no sensor.
  bool switched_on = true;           ///< False: as if a person had its enable switch open.
  std::string amplifier{};           ///< File of its amplifier; empty: none.
};

inline constexpr std::array<NumberOf<SimulatedDeviceOptions>, 15> kSimulatedDeviceNumbers{{
    {{0.05, 1000, "kg"}, "mass", &SimulatedDeviceOptions::mass, "Mass"},
    {{1e-4, 100, "kg·m²"}, "inertia", &SimulatedDeviceOptions::inertia, "Inertia about every axis"},
    {{0, 1e4, "N·s/m"}, "damping", &SimulatedDeviceOptions::damping, "Damping"},
    {{0, 100, "N·m·s/rad"},
     "angular damping",
     &SimulatedDeviceOptions::angular_damping,
     "Angular damping"},
    {{0, 1000, "N"}, "friction", &SimulatedDeviceOptions::dry_friction, "Dry friction"},
    {{0, 100, "N·m"},
     "friction torque",
     &SimulatedDeviceOptions::dry_friction_torque,
     "Dry friction torque"},
    {{0.01, Range::kInfinite, "N"}, "max force", &SimulatedDeviceOptions::max_force, "Rated force"},
    {{1e-4, Range::kInfinite, "N·m"},
     "max torque",
     &SimulatedDeviceOptions::max_torque,
     "Rated torque"},
    {{1, Range::kInfinite, "N/s"},
     "max force rate",
     &SimulatedDeviceOptions::max_force_rate,
     "Rated change of force"},
    {{0.01, Range::kInfinite, "N·m/s"},
     "max torque rate",
     &SimulatedDeviceOptions::max_torque_rate,
     "Rated change of torque"},
    {{1, Range::kInfinite, "N/m"},
     "max stiffness",
     &SimulatedDeviceOptions::max_stiffness,
     "Rated stiffness"},
    {{1e-3, Range::kInfinite, "N·m/rad"},
     "max angular stiffness",
     &SimulatedDeviceOptions::max_angular_stiffness,
     "Rated angular stiffness"},
    {{0, 0.01, "m"},
     "position step",
     &SimulatedDeviceOptions::position_step,
     "Encoder step; 0 is exact"},
    {{0, 0.1, "rad"},
     "angle step",
     &SimulatedDeviceOptions::angle_step,
     "Encoder step of angles; 0 is exact"},
    {{0.1, Range::kInfinite, "Hz"},
     "velocity cutoff",
     &SimulatedDeviceOptions::velocity_cutoff,
     "Cut-off of the velocity filter"},
}};

/// Why options cannot be used, naming the option, its value and its range; empty if valid.
std::optional<std::string> find_error(const SimulatedDeviceOptions& options);

/// What such a device is rated for.
DeviceRatings ratings_of(const SimulatedDeviceOptions& options) noexcept;

/// A rigid handle with isotropic inertia, viscous damping and dry friction that sticks, moved by
/// its motors and by a hand. Each write() moves it by one servo period, enabled or not. The hand
/// acts within the device's freedom only. Two devices with equal inputs move bit for bit alike.
class SimulatedDevice final : public Device, private GuidedHand {
 public:
  /// `options` must be valid (find_error). dt: servo period, s, > 0. Starts at the world's origin.
  SimulatedDevice(const SimulatedDeviceOptions& options, HandScript hand, double dt);

  std::string_view name() const noexcept override;
  const DeviceRatings& ratings() const noexcept override { return ratings_; }
  bool measures_hand_wrench() const noexcept override { return options_.measures_hand_wrench; }
  /// Puts the handle at X_WH, at rest; the hand's script begins again.
  void align(const Pose& X_WH) noexcept override;
  /// Commands from before are forgotten.
  void enable() noexcept override;
  /// Motors off; the hand still moves the handle.
  void disable() noexcept override;
  /// While held, a firm hand (the default Grip) draws the handle to the target, and the script's
  /// hand does nothing; its time goes on.
  GuidedHand* guided_hand() noexcept override { return this; }
  std::optional<DeviceState> read() noexcept override;
  /// False, and no motion, if F is not finite.
  bool write(const Wrench& F) noexcept override;
  void halt() noexcept override { amplifier_.halt(); }

 private:
  /// Free motion under a constant force for one substep, v⁺ = decay v + gain F, exact.
  struct Kick {
    double decay;
    double gain;      ///< s/kg or s/(kg·m²).
    double friction;  ///< Dry friction, N or N·m.

    Vector3 velocity(const Vector3& v, const Vector3& F) const noexcept;
  };
  static Kick kick(double inertia, double damping, double friction, double h) noexcept;

  void hold(const Pose& X_WTarget) noexcept override { X_WGuide_ = X_WTarget; }
  void release() noexcept override { X_WGuide_.reset(); }

  Wrench motor_wrench(const Wrench& commanded) noexcept;
  Wrench hand_wrench(double t) const noexcept;
  void drift(double h) noexcept;
  void substep(const Wrench& F_motor) noexcept;
  void sense() noexcept;
  bool senses_exactly() const noexcept;
  Pose quantised(const Pose& X_WD) const noexcept;

  SimulatedDeviceOptions options_;
  DeviceRatings ratings_;
  Hand hand_;
  double dt_;
  int substeps_;  ///< Steps in a period.
  double h_;      ///< Length of one, s.
  Kick linear_;
  Kick angular_;
  double filter_gain_;  ///< Share of the latest difference in the sensed velocity.

  std::uint64_t steps_ = 0;  ///< Substeps since align(): the hand's time is steps_ * h_.
  Pose X_WStart_;            ///< Handle at align(): the encoders' zero.
  Pose X_WD_;
  Twist V_WD_ = Twist::Zero();
  Pose X_WD_sensed_;
  Twist V_WD_sensed_ = Twist::Zero();

  std::optional<Pose> X_WGuide_;

  Amplifier amplifier_;
  bool enabled_ = false;
  bool saturated_ = false;  ///< The motors gave less than the latest due command.
  /// Commands under way; the latest is at newest_.
  std::array<Wrench, kMaxDelay + 1> commands_;
  std::size_t newest_ = 0;
};

}  // namespace hlm::server
