// The columns of a tick: what charts, tables and files show of each step, in one list.
#pragma once

#include <array>
#include <limits>

#include "hlm/protocol/messages.h"

namespace hlm::protocol {

/// One number of each step. `value` is NaN where a step has none.
struct TickColumn {
  const char* name;
  const char* unit;  ///< SI; empty for counts, flags and enumerations.
  double (*value)(const TickSignals&);
};

/// Forces about the hand's frame, world axes; see TickSignals for the rest.
inline constexpr std::array<TickColumn, 17> kTickColumns{{
    {"F_env", "N", [](const TickSignals& t) { return t.F_env.norm(); }},
    {"F_env_x", "N", [](const TickSignals& t) { return t.F_env.x(); }},
    {"F_env_y", "N", [](const TickSignals& t) { return t.F_env.y(); }},
    {"F_env_z", "N", [](const TickSignals& t) { return t.F_env.z(); }},
    {"F_command", "N", [](const TickSignals& t) { return t.F_command.norm(); }},
    {"F_hand", "N", [](const TickSignals& t) { return t.F_hand.norm(); }},
    {"torque", "N·m", [](const TickSignals& t) { return t.torque; }},
    {"smallest_separation", "m",
     [](const TickSignals& t) {
       const bool any = t.active_contacts + t.predicted_contacts > 0;
       return any ? t.smallest_separation : std::numeric_limits<double>::quiet_NaN();
     }},
    {"device_proxy", "m", [](const TickSignals& t) { return t.device_proxy; }},
    {"proxy_tool", "m", [](const TickSignals& t) { return t.proxy_tool; }},
    {"lateness", "s", [](const TickSignals& t) { return t.lateness; }},
    {"execution", "s", [](const TickSignals& t) { return t.execution; }},
    {"age", "s", [](const TickSignals& t) { return t.age; }},
    {"active_contacts", "", [](const TickSignals& t) { return t.active_contacts * 1.0; }},
    {"predicted_contacts", "", [](const TickSignals& t) { return t.predicted_contacts * 1.0; }},
    {"adopted", "", [](const TickSignals& t) { return t.adopted ? 1.0 : 0.0; }},
    {"limit", "", [](const TickSignals& t) { return static_cast<double>(t.limit); }},
}};

}  // namespace hlm::protocol
