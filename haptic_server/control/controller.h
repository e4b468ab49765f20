// The controller between device and proxy (docs/method.md 6, paper Sec. II), and the couplings of
// other methods, to compare with.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "hlm/common/range.h"
#include "hlm/common/tuning.h"
#include "hlm/haptic_server/device/device.h"
#include "hlm/haptic_server/local_model/local_model.h"

namespace hlm::server {

/// Gains of the position channels.
struct ControllerGains {
  double stiffness = 1500;        ///< K_c, translation, N/m.
  double damping = 30;            ///< B_c, translation, N·s/m.
  double angular_stiffness = 1;   ///< K_c, rotation, N·m/rad.
  double angular_damping = 0.03;  ///< B_c, rotation, N·m·s/rad.
};

inline constexpr std::array<NumberOf<ControllerGains>, 4> kGainNumbers{{
    {range_of(&Tuning::coupling_stiffness), "coupling stiffness", &ControllerGains::stiffness,
     "K_c, translation"},
    {range_of(&Tuning::coupling_damping), "coupling damping", &ControllerGains::damping,
     "B_c, translation"},
    {range_of(&Tuning::coupling_angular_stiffness), "coupling angular stiffness",
     &ControllerGains::angular_stiffness, "K_c, rotation"},
    {range_of(&Tuning::coupling_angular_damping), "coupling angular damping",
     &ControllerGains::angular_damping, "B_c, rotation"},
}};

/// Hand frame of a tool in the world, and its twist.
struct HandMotion {
  Pose X_WH;
  Twist V_WH = Twist::Zero();
};

class Controller {
 public:
  Controller(ControllerKind kind, const ControllerGains& gains) noexcept;

  ControllerKind kind() const noexcept { return kind_; }

  /// What acts on the proxy at the hand, with e = x_D - x_P: F_h + K_c e + B_c ė, less the terms
  /// that the kind leaves out.
  HandInput to_proxy(const DeviceState& device, const HandMotion& proxy) const noexcept;

  /// The wrench u for the device: F_env - K_c e - B_c ė, less the terms that the kind leaves out.
  /// Whatever the kind, a hand that holds the tool still carries its weight just once: from F_env,
  /// or from the proxy that hangs from the coupling.
  Wrench to_device(const DeviceState& device, const HandMotion& proxy,
                   const HandMotion& engine_tool, const ContactWrench& felt) const noexcept;

  /// Whether the hand's wrench acts on the proxy.
  bool passes_hand_wrench(const DeviceState& device) const noexcept {
    return kind_ == ControllerKind::kFourChannel && device.F_hand.has_value();
  }
  /// Whether the tool's weight is a part of the device's wrench; if not, the coupling hands it on.
  bool bears_weight(const DeviceState& device) const noexcept {
    return passes_hand_wrench(device) || traits(kind_).replaces_proxy;
  }

 private:
  Wrench coordination(const DeviceState& device, const HandMotion& partner) const noexcept;

  ControllerKind kind_;
  Vector6 stiffness_;
  Vector6 damping_;
};

/// Configuration and velocity of a tool whose hand is at the device, for direct coupling. Empty if
/// the tool has more than one moving joint: the pose would not tell how it is bent.
struct ToolAtHand {
  Configuration q;
  Velocity v;
};
std::optional<ToolAtHand> tool_at_hand(const ToolModel& tool, const Pose& X_WH,
                                       const Twist& V_WH) noexcept;

/// Why gains cannot be used, naming the gain, its value and its range; empty if valid.
std::optional<std::string> find_error(const ControllerGains& gains);

}  // namespace hlm::server
