// The messages that server and client exchange, as plain values. PROTOCOL.md gives their bytes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/contact.h"
#include "common/tool_description.h"
#include "common/tool_model.h"

namespace hlm::protocol {

inline constexpr std::uint16_t kProtocolVersion = 1;
/// Largest UDP payload, bytes: below the smallest MTU in common use, so that no datagram fragments.
inline constexpr std::size_t kMaxDatagram = 1200;

enum class MessageType : std::uint8_t {
  kHello = 1,          ///< Client to server: asks for a session.
  kWelcome = 2,        ///< Server to client: grants it.
  kReject = 3,         ///< Server to client: refuses it and says why.
  kContactUpdate = 4,  ///< Client to server, after each step of the virtual environment.
  kProxyState = 5,     ///< Server to client, acknowledging each update.
  kGoodbye = 6,        ///< Either way: the session ends.
};

/// Client to server: the tool and where it is. Repeated until answered.
struct Hello {
  std::uint64_t nonce = 0;  ///< Drawn anew for each session; a repeated hello carries the same.
  ToolDescription tool;
  Configuration q;      ///< Initial configuration of the tool; the proxy starts there.
  double ve_rate = 60;  ///< Nominal step rate of the virtual environment, Hz.
  double epsilon = 0;   ///< Radius of the ε-active tool, m.
};

/// Server to client.
struct Welcome {
  std::uint64_t nonce = 0;          ///< Of the hello that is answered.
  double servo_rate = 1000;         ///< Rate of the local model, Hz.
  std::uint64_t configuration = 0;  ///< Fingerprint of the server's effective configuration.
};

enum class RejectReason : std::uint8_t {
  kVersion = 1,  ///< The hello's version is not kProtocolVersion.
  kBusy = 2,     ///< Another client holds the session.
  kTool = 3,     ///< The tool cannot be used; the text says why.
};

struct Reject {
  std::uint64_t nonce = 0;
  RejectReason reason = RejectReason::kBusy;
  std::uint16_t version = kProtocolVersion;  ///< The version that the server speaks.
  StaticVector<char, 200> text;              ///< UTF-8, for a person.
};

/// Client to server: the contacts near the tool, and the configuration for which they hold.
struct ContactUpdate {
  double ve_time = 0;           ///< Simulated time of the virtual environment, s.
  double ve_period = 0;         ///< Length of its latest step, s.
  double compute_time = 0;      ///< From sampling q_VE to sending this, s.
  std::uint64_t echo_step = 0;  ///< `step` of the newest proxy state received, 0 if none.
  double echo_hold = 0;         ///< From receiving that proxy state to sending this, s.
  Configuration q_VE;           ///< Tool configuration for which the contacts were computed.
  Velocity v_VE;                ///< Its generalised velocity.
  ReportedContacts contacts;
};

/// State of the proxy as a whole (METHOD 3).
enum class ProxyContactState : std::uint8_t { kFreeMotion = 0, kColliding = 1, kResting = 2 };

/// What the server is doing with its force.
enum class ServerState : std::uint8_t {
  kIdle = 0,     ///< No session; the device is disabled.
  kRunning = 1,  ///< Session with a live client.
  kSilent = 2,   ///< The client has been silent for too long; force fades to zero, or is zero.
  kFault = 3,    ///< Force is zero until a new session; `fault` says why.
};

enum class Fault : std::uint8_t {
  kNone = 0,
  kNonFinite = 1,  ///< The local model or the device gave a value that is not finite.
  kOverrun = 2,    ///< The loop missed more periods in a row than allowed.
  kDevice = 3,     ///< The device reported an error.
};

/// Server to client: the acknowledgement of an adopted update.
struct ProxyState {
  std::uint64_t acknowledged = 0;  ///< Sequence of the adopted update.
  std::uint64_t step = 0;  ///< Steps of the local model since the session began, this one included.
  double age = 0;          ///< Age the server attributed to the update's contacts, s.
  double update_send_time = 0;  ///< Send time of the acknowledged update, client's clock, s.
  double hold = 0;              ///< From receiving that update to sending this, s.
  ServerState server = ServerState::kIdle;
  Fault fault = Fault::kNone;
  ProxyContactState contact_state = ProxyContactState::kFreeMotion;
  std::uint16_t active_contacts = 0;     ///< Local contacts with separation <= 0.
  std::uint16_t predicted_contacts = 0;  ///< Local contacts with separation > 0.
  double smallest_separation = 0;        ///< Over all local contacts, m; +0 if there are none.
  Configuration q;                       ///< Of the proxy.
  Velocity v;                            ///< Of the proxy.
  Pose X_WD;                             ///< Device handle in the world.
  Twist V_WD = Twist::Zero();            ///< Its twist.
  Wrench F_env = Wrench::Zero();         ///< Contact wrench at the hand (Eqs. 8, 12), world axes.
  Wrench F_command = Wrench::Zero();     ///< Wrench commanded to the device, after limits.
  Wrench F_hand = Wrench::Zero();        ///< The hand's wrench as known to the controller.
  std::uint64_t overruns = 0;            ///< Missed periods since the server started.
  std::uint64_t updates = 0;             ///< Updates adopted in this session.
  std::uint64_t dropped = 0;  ///< Datagrams dropped since the server started, all reasons.
};

enum class GoodbyeReason : std::uint8_t { kFinished = 0, kShutdown = 1 };

struct Goodbye {
  GoodbyeReason reason = GoodbyeReason::kFinished;
};

}  // namespace hlm::protocol
