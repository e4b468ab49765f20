// The columns of a tick log: which signal of the record each is, under which name, in order. Writer
// and readers visit the same list.
#pragma once

#include "hlm/haptic_server/device/device_columns.h"
#include "hlm/haptic_server/report/tick_record.h"

namespace hlm::server {

inline constexpr Suffixes<1> kSeconds{"_s"};
inline constexpr Suffixes<1> kMetres{"_m"};

inline constexpr Suffixes<1> kJoules{"_J"};
inline constexpr Suffixes<4> kLedger{"_given_J", "_taken_J", "_explained_J", "_tank_J"};

inline double component(const PortLedger& port, std::size_t i) noexcept {
  return std::array{port.given, port.taken, port.explained, port.tank}[i];
}

/// visit(name, member of TickRecord, suffixes): all signals, in the order of a log's columns.
template <class Visit>
constexpr void visit_signals(Visit&& visit) {
  visit_step<TickRecord>(visit);
  visit("time", &TickRecord::time, kSeconds);
  visit("server_state", &TickRecord::server, kPlain);
  visit("fault", &TickRecord::fault, kPlain);
  visit("fade", &TickRecord::fade, kPlain);
  visit("contact_state", &TickRecord::contact_state, kPlain);
  visit_device<TickRecord>(visit);
  visit("proxy", &TickRecord::X_WP, kPose);
  visit("proxy", &TickRecord::V_WP, kTwist);
  visit("tool", &TickRecord::X_WT, kPose);
  visit("env", &TickRecord::F_env, kWrench);
  visit("command", &TickRecord::F_command, kWrench);
  visit("force_limit", &TickRecord::limit, kPlain);
  visit("port", &TickRecord::port, kLedger);
  visit("brought", &TickRecord::brought, kJoules);
  visit("active_contacts", &TickRecord::active_contacts, kPlain);
  visit("predicted_contacts", &TickRecord::predicted_contacts, kPlain);
  visit("smallest_separation", &TickRecord::smallest_separation, kMetres);
  visit("scene", &TickRecord::scene, kPlain);
  visit("scene_placements", &TickRecord::placements, kPlain);
  visit("scene_pieces", &TickRecord::pieces, kPlain);
  visit("scene_left_out", &TickRecord::left_out, kPlain);
  visit("adopted", &TickRecord::adopted, kPlain);
  visit("age", &TickRecord::age, kSeconds);
  visit("lateness", &TickRecord::lateness, kSeconds);
  visit("execution", &TickRecord::execution, kSeconds);
  visit("overruns", &TickRecord::overruns, kPlain);
  visit("datagrams", &TickRecord::datagrams, kPlain);
  visit("dropped", &TickRecord::dropped, kPlain);
}

}  // namespace hlm::server
