// The columns of a tick log that a device can be played back from: which step of which session it
// was, and what was read from the device. The log's writer begins with them, replay needs no
// others.
//
// A signal's name and a suffix make a column's name; the suffix holds component and unit. Frames
// are the world's, poses are position and quaternion.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>
#include <type_traits>

#include "hlm/common/spatial.h"

namespace hlm::server {

template <std::size_t count>
using Suffixes = std::array<std::string_view, count>;

inline constexpr Suffixes<1> kPlain{""};
inline constexpr Suffixes<7> kPose{"_x_m", "_y_m", "_z_m", "_qw", "_qx", "_qy", "_qz"};
inline constexpr Suffixes<6> kTwist{"_vx_m_per_s",   "_vy_m_per_s",   "_vz_m_per_s",
                                    "_wx_rad_per_s", "_wy_rad_per_s", "_wz_rad_per_s"};
inline constexpr Suffixes<6> kWrench{"_force_x_N",    "_force_y_N",    "_force_z_N",
                                     "_torque_x_N_m", "_torque_y_N_m", "_torque_z_N_m"};

/// visit(name, member of Record, suffixes): which step of which session this is.
template <class Record, class Visit>
constexpr void visit_step(Visit&& visit) {
  visit("session", &Record::session, kPlain);
  visit("step", &Record::step, kPlain);
}

/// What was read from the device.
template <class Record, class Visit>
constexpr void visit_device(Visit&& visit) {
  visit("device", &Record::X_WD, kPose);
  visit("device", &Record::V_WD, kTwist);
  visit("hand_measured", &Record::hand_measured, kPlain);
  visit("hand_observed", &Record::hand_observed, kPlain);
  visit("hand", &Record::F_hand, kWrench);
}

/// The component of a signal that its i-th suffix names.
template <class Value>
auto& component(Value& value, std::size_t i) noexcept {
  using Signal = std::remove_const_t<Value>;
  if constexpr (std::is_same_v<Signal, Pose>) {
    if (i < 3) return value.p[static_cast<Eigen::Index>(i)];
    // Eigen keeps a quaternion as x, y, z, w.
    return value.R.coeffs()[static_cast<Eigen::Index>(i == 3 ? 3 : i - 4)];
  } else if constexpr (std::is_same_v<Signal, Vector6>) {
    return value[static_cast<Eigen::Index>(i)];
  } else {
    return value;
  }
}

}  // namespace hlm::server
