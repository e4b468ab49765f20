// A simulated impedance device with a hand on it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "common/spatial.h"
#include "common/vocabulary.h"
#include "haptic_server/device/device.h"
#include "haptic_server/device/hand.h"

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

struct SimulatedDeviceOptions {
  DeviceFreedom freedom = DeviceFreedom::kPlanar;
  double mass = 1;                 ///< kg, 0.05 to 1000.
  double inertia = 2e-3;           ///< kg·m², about every axis, 1e-4 to 100.
  double damping = 5;              ///< N·s/m, 0 to 1e4.
  double angular_damping = 5e-3;   ///< N·m·s/rad, 0 to 100.
  double dry_friction = 0.2;       ///< N, 0 to 1000: at rest it holds less than that.
  double dry_friction_torque = 0;  ///< N·m, 0 to 100.

  // Ratings. The motors saturate at the force and the torque; the others are for the server to
  // respect.
  double max_force = 12;              ///< N, >= 0.01.
  double max_torque = 0.6;            ///< N·m, >= 1e-4.
  double max_force_rate = 12e3;       ///< N/s, >= 1: the whole force in 1 ms.
  double max_torque_rate = 600;       ///< N·m/s, >= 0.01.
  double max_stiffness = 10e3;        ///< N/m, >= 1: what its damping renders passively at 1 kHz.
  double max_angular_stiffness = 10;  ///< N·m/rad, >= 1e-3.

  double position_step = 0;  ///< Encoder step of each coordinate, m, 0 (exact) to 0.01.
  double angle_step = 0;     ///< Of each component of the rotation vector, rad, 0 (exact) to 0.1.
  /// Cut-off of the first-order low-pass on the velocity from finite differences, Hz, >= 0.1. With
  /// encoder steps, infinite means unfiltered differences; without, the exact velocity.
  double velocity_cutoff = std::numeric_limits<double>::infinity();

  int delay = 0;                     ///< A command acts this many ticks later, 0 to kMaxDelay.
  bool measures_hand_wrench = true;  ///< False: as if it had no sensor.
};

/// Why options cannot be used, naming the option, its value and its range; empty if valid.
std::optional<std::string> find_error(const SimulatedDeviceOptions& options);

/// A rigid handle with isotropic inertia, viscous damping and dry friction that sticks, moved by
/// its motors and by a hand. Each write() moves it by one servo period, enabled or not. The hand
/// acts within the device's freedom only. Two devices with equal inputs move bit for bit alike.
class SimulatedDevice final : public Device {
 public:
  /// `options` must be valid (find_error). dt: servo period, s, > 0. Starts at the world's origin.
  SimulatedDevice(const SimulatedDeviceOptions& options, HandScript hand, double dt);

  const DeviceRatings& ratings() const noexcept override { return ratings_; }
  bool measures_hand_wrench() const noexcept override { return options_.measures_hand_wrench; }
  /// Puts the handle at X_WH, at rest; the hand's script begins anew.
  void align(const Pose& X_WH) noexcept override;
  /// Commands from before are forgotten.
  void enable() noexcept override;
  /// Motors off; the hand still moves the handle.
  void disable() noexcept override { enabled_ = false; }
  bool guidable() const noexcept override { return true; }
  /// While held, a firm hand (the default Grip) draws the handle to the target, and the script's
  /// hand does nothing; its time goes on.
  void guide(const std::optional<Pose>& X_WTarget) noexcept override { X_WGuide_ = X_WTarget; }
  std::optional<DeviceState> read() noexcept override;
  /// False, and no motion, if F is not finite.
  bool write(const Wrench& F) noexcept override;

 private:
  /// Free motion under a constant force for one substep, v⁺ = decay v + gain F, exact.
  struct Kick {
    double decay;
    double gain;      ///< s/kg or s/(kg·m²).
    double friction;  ///< Dry friction, N or N·m.

    Vector3 velocity(const Vector3& v, const Vector3& F) const noexcept;
  };
  static Kick kick(double inertia, double damping, double friction, double h) noexcept;

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
  int substeps_;  ///< In a period.
  double h_;      ///< Length of one, s.
  Kick linear_;
  Kick angular_;
  double filter_gain_;  ///< Share of the newest difference in the sensed velocity.

  std::uint64_t steps_ = 0;  ///< Substeps since align(): the hand's time is steps_ * h_.
  Pose X_WStart_;            ///< Handle at align(): the encoders' zero.
  Pose X_WD_;
  Twist V_WD_ = Twist::Zero();
  Pose X_WD_sensed_;
  Twist V_WD_sensed_ = Twist::Zero();

  std::optional<Pose> X_WGuide_;

  bool enabled_ = false;
  /// Commands under way; the newest is at newest_.
  std::array<Wrench, kMaxDelay + 1> commands_;
  std::size_t newest_ = 0;
};

}  // namespace hlm::server
