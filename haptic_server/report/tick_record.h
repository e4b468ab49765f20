// Every signal of one servo tick, as written to the tick log.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "hlm/common/spatial.h"
#include "hlm/common/tool_model.h"
#include "hlm/common/vocabulary.h"
#include "hlm/haptic_server/device/device.h"
#include "hlm/haptic_server/safety/energy_tank.h"
#include "hlm/protocol/datagram_link.h"
#include "hlm/protocol/statistics.h"

namespace hlm::server {

struct TickRecord {
  std::uint64_t session = 0;
  std::uint64_t step = 0;  ///< Steps since the session began; 0 without a session.
  double time = 0;         ///< Time since the server started, s.
  ServerState server = ServerState::kOff;
  Fault fault = Fault::kNone;
  Fade fade = Fade::kNone;
  ProxyContactState contact_state = ProxyContactState::kFreeMotion;
  Pose X_WD;  ///< Device handle.
  Twist V_WD = Twist::Zero();
  bool hand_measured = false;  ///< F_hand is known.
  bool hand_observed = false;  ///< It is an estimate.
  Wrench F_hand = Wrench::Zero();
  Pose X_WP;  ///< Hand frame of the proxy.
  Twist V_WP = Twist::Zero();
  Pose X_WT;                             ///< Hand frame of the VE's tool, from the latest update.
  Wrench F_env = Wrench::Zero();         ///< Contact wrench at the hand, impulses included.
  Wrench F_command = Wrench::Zero();     ///< Wrench to the device, after limits.
  ForceLimit limit = ForceLimit::kNone;  ///< What keeps it from being the wanted wrench.
  PortLedger port;                       ///< Up to this tick's reading of the device.
  double port_bound = 0;  ///< Most that the port gives beyond taken, J. Not in the tick log.
  double port_power = 0;  ///< And in the long run, W. Not in the tick log.
  double brought = 0;     ///< Energy that updates have brought into contacts' springs so far, J.
  int active_contacts = 0;
  int predicted_contacts = 0;
  double smallest_separation = 0;  ///< m; 0 without contacts.
  std::uint32_t scene = 0;         ///< Number of the scene in force; 0 none.
  std::uint32_t placements = 0;    ///< Shapes in that scene,
  std::uint32_t pieces = 0;        ///< and the convex pieces of which they are made.
  std::uint32_t left_out = 0;   ///< Pairs of these and contacts for which there was not the time.
  std::uint64_t adopted = 0;    ///< Sequence of the update adopted in this tick, or 0.
  double age = 0;               ///< Age attributed to it, s.
  double lateness = 0;          ///< Wake-up after the scheduled time, s.
  double execution = 0;         ///< Time from wake-up to the end of the tick, s.
  std::uint64_t overruns = 0;   ///< Missed periods since the server started.
  std::uint64_t datagrams = 0;  ///< Datagrams received since the server started.
  std::uint64_t dropped = 0;    ///< Datagrams dropped of those.
  /// The same by DropReason; like session_open not in the tick log.
  std::array<std::uint64_t, protocol::kDropReasons> dropped_for{};
  /// Why the latest update was refused; empty if it was taken. Not in the tick log.
  std::string_view refusal;
  std::uint32_t buttons = 0;  ///< Bit i: button i of the device is pressed. Not in the tick log.
  double gripper = 0;         ///< Opening of the gripper, 0 closed to 1 open. Not in the tick log.
  double scale = 1;           ///< Metres in the world per metre of the handle. Not in the tick log.
  DeviceHealth health = DeviceHealth::kGood;  ///< Not in the tick log.
  const char* cause = "";  ///< Cause of that health, or of a device fault. Not in the tick log.
  Freedoms missing_freedoms = 0;  ///< Freedoms of the tool, not the device. Not in the tick log.
  double stiffness = 0;           ///< Stiffness of a contact in effect, N/m. Not in the tick log.
  double lowered = 0;         ///< Share lowered, as in protocol::ProxyState. Not in the tick log.
  bool uses_contacts = true;  ///< The controller in effect uses contacts. Not in the tick log.
  bool session_open = false;  ///< A client holds the session and has not said goodbye.
  protocol::Endpoint client;  ///< Of the session, or of the latest. Not in the tick log.
};

}  // namespace hlm::server
