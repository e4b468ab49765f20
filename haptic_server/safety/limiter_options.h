// What the user allows on the device.
#pragma once

#include <array>

#include "hlm/common/range.h"

namespace hlm::server {

/// The device's ratings count too.
struct LimiterOptions {
  double max_force = 12;    ///< N.
  double max_torque = 0.6;  ///< N·m.
  /// N/s: the usual device's whole force in 4 ms. Less makes stiff walls soft at the moment of
  /// touch; more lets a jump of the wanted force reach the hand as a blow.
  double max_force_rate = 3000;
  double max_torque_rate = 150;  ///< Rate of the torque, N·m/s.
  double fade_time = 0.02;       ///< Time from full force to none, s.
  double rise_time = 0.1;        ///< Time from none to full force, s.
  /// W given to the hand: the usual device's whole force at 1.25 m/s. Less lets fast platforms and
  /// heavy tools that are lowered feel weak.
  double max_power = 15;
  double max_turning_power = 3;  ///< Power of the torque, W: 0.6 N·m at 5 rad/s.
  /// J that the device may give beyond what it took and what is explained. Less damps what springs
  /// back where it should not, more lets an unstable contact shake the hand for longer.
  double max_energy = 0.5;
  /// J and W at the handle for what the client says pushes it: walls, bodies and weight. It is the
  /// client's word alone. Less makes doors and conveyors weak; more lets a client that lies carry
  /// the handle away.
  double claim_energy = 2;
  double claim_power = 1;
};

inline constexpr std::array<NumberOf<LimiterOptions>, 11> kLimiterNumbers{{
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
    {{0.1, 1e4, "W"},
     "power limit",
     &LimiterOptions::max_power,
     "Largest power that the force gives to the hand; the device's rating counts too"},
    {{0.01, 1e3, "W"},
     "turning power limit",
     &LimiterOptions::max_turning_power,
     "Largest power that the torque gives to the hand; the device's rating counts too"},
    {{1e-3, 1e6, "J"},
     "energy budget",
     &LimiterOptions::max_energy,
     "Energy that the hand may get beyond what is explained, before force is damped; the device's "
     "rated force over 42 mm counts too"},
    {{0, 1e6, "J"},
     "claim energy",
     &LimiterOptions::claim_energy,
     "Energy that the hand may get at a stretch from walls, bodies and weight, as the client says; "
     "the device's rated force over 170 mm counts too"},
    {{0, 1e4, "W"},
     "claim power",
     &LimiterOptions::claim_power,
     "Power that it may get from those in the long run; the device's rated force at 85 mm/s counts "
     "too"},
}};

}  // namespace hlm::server
