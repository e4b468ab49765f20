// What the user allows on the device.
#pragma once

#include <array>

#include "common/range.h"

namespace hlm::server {

/// The device's ratings count too.
struct LimiterOptions {
  double max_force = 12;    ///< N.
  double max_torque = 0.6;  ///< N·m.
  /// N/s: the usual device's whole force in 4 ms. Less makes stiff walls soft at the moment of
  /// touch; more lets a jump of the wanted force reach the hand as a blow.
  double max_force_rate = 3000;
  double max_torque_rate = 150;  ///< N·m/s, likewise.
  double fade_time = 0.02;       ///< From full force to none, s.
  double rise_time = 0.1;        ///< From none to full force, s.
};

inline constexpr std::array<NumberOf<LimiterOptions>, 6> kLimiterNumbers{{
    {{0.01, 1000, "N"},
     "force limit",
     &LimiterOptions::max_force,
     "Largest force on the device; its rating counts too"},
    {{1e-4, 100, "N·m"},
     "torque limit",
     &LimiterOptions::max_torque,
     "Largest torque on the device; its rating counts too"},
    {{1, 1e6, "N/s"},
     "force rate limit",
     &LimiterOptions::max_force_rate,
     "Fastest change of the force; the device's rating counts too"},
    {{0.01, 1e5, "N·m/s"},
     "torque rate limit",
     &LimiterOptions::max_torque_rate,
     "Fastest change of the torque; the device's rating counts too"},
    {{1e-3, 10, "s"},
     "fade time",
     &LimiterOptions::fade_time,
     "From full force to none, when the client is silent or leaves"},
    {{1e-3, 10, "s"}, "rise time", &LimiterOptions::rise_time, "From no force to full force"},
}};

}  // namespace hlm::server
