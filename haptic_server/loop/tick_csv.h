// The tick log's text form: a header line with names and units, then one line for each tick.
//
// Columns, in this order, separated by commas (W world; quaternions as w, x, y, z):
//   session, step, time_s, server_state, fault, contact_state,
//   device_{x,y,z}_m, device_q{w,x,y,z}, device_v{x,y,z}_m_per_s, device_w{x,y,z}_rad_per_s,
//   hand_measured (0 or 1), hand_force_{x,y,z}_N, hand_torque_{x,y,z}_N_m,
//   proxy_{x,y,z}_m, proxy_q{w,x,y,z}, proxy_v{x,y,z}_m_per_s, proxy_w{x,y,z}_rad_per_s,
//   tool_{x,y,z}_m, tool_q{w,x,y,z},
//   env_force_{x,y,z}_N, env_torque_{x,y,z}_N_m, command_force_{x,y,z}_N,
//   command_torque_{x,y,z}_N_m, active_contacts, predicted_contacts, smallest_separation_m,
//   adopted, age_s, lateness_s, execution_s, overruns, datagrams, dropped
// Numbers are the shortest text that reads back to the same double; states are the words of
// common/vocabulary.h.
#pragma once

#include <string>

#include "haptic_server/loop/tick_record.h"

namespace hlm::server {

/// The header line, with its line end.
std::string tick_csv_header();
/// Appends the line of one tick, with its line end.
void append_tick_csv(const TickRecord& record, std::string& text);

}  // namespace hlm::server
