// The columns of a tick log: which signal of the record each is, under which name, in order. Writer
// and readers visit the same list.
//
// A signal's name and a suffix make a column's name; the suffix holds component and unit. Frames
// are the world's, poses are position and quaternion.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>
#include <type_traits>

#include "haptic_server/loop/tick_record.h"

namespace hlm::server {

template <std::size_t count>
using Suffixes = std::array<std::string_view, count>;

inline constexpr Suffixes<1> kPlain{""};
inline constexpr Suffixes<1> kSeconds{"_s"};
inline constexpr Suffixes<1> kMetres{"_m"};
inline constexpr Suffixes<7> kPose{"_x_m", "_y_m", "_z_m", "_qw", "_qx", "_qy", "_qz"};
inline constexpr Suffixes<6> kTwist{"_vx_m_per_s",   "_vy_m_per_s",   "_vz_m_per_s",
                                    "_wx_rad_per_s", "_wy_rad_per_s", "_wz_rad_per_s"};
inline constexpr Suffixes<6> kWrench{"_force_x_N",    "_force_y_N",    "_force_z_N",
                                     "_torque_x_N_m", "_torque_y_N_m", "_torque_z_N_m"};

/// visit(name, member of TickRecord, suffixes): which step of which session this is.
template <class Visit>
constexpr void visit_step(Visit&& visit) {
  visit("session", &TickRecord::session, kPlain);
  visit("step", &TickRecord::step, kPlain);
}

/// What was read from the device.
template <class Visit>
constexpr void visit_device(Visit&& visit) {
  visit("device", &TickRecord::X_WD, kPose);
  visit("device", &TickRecord::V_WD, kTwist);
  visit("hand_measured", &TickRecord::hand_measured, kPlain);
  visit("hand", &TickRecord::F_hand, kWrench);
}

/// All signals, in the order of a log's columns.
template <class Visit>
constexpr void visit_signals(Visit&& visit) {
  visit_step(visit);
  visit("time", &TickRecord::time, kSeconds);
  visit("server_state", &TickRecord::server, kPlain);
  visit("fault", &TickRecord::fault, kPlain);
  visit("contact_state", &TickRecord::contact_state, kPlain);
  visit_device(visit);
  visit("proxy", &TickRecord::X_WP, kPose);
  visit("proxy", &TickRecord::V_WP, kTwist);
  visit("tool", &TickRecord::X_WT, kPose);
  visit("env", &TickRecord::F_env, kWrench);
  visit("command", &TickRecord::F_command, kWrench);
  visit("force_limit", &TickRecord::limit, kPlain);
  visit("active_contacts", &TickRecord::active_contacts, kPlain);
  visit("predicted_contacts", &TickRecord::predicted_contacts, kPlain);
  visit("smallest_separation", &TickRecord::smallest_separation, kMetres);
  visit("adopted", &TickRecord::adopted, kPlain);
  visit("age", &TickRecord::age, kSeconds);
  visit("lateness", &TickRecord::lateness, kSeconds);
  visit("execution", &TickRecord::execution, kSeconds);
  visit("overruns", &TickRecord::overruns, kPlain);
  visit("datagrams", &TickRecord::datagrams, kPlain);
  visit("dropped", &TickRecord::dropped, kPlain);
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
