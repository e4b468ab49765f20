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
  kControl = 7,        ///< Client to server: what the person there asks for.
  kTicks = 8,          ///< Server to client, if asked for: signals of consecutive steps.
  kLocalState = 9,     ///< Server to client, if asked for: the local contacts.
};

/// How a contact's separation carries over an update (METHOD 2).
enum class UpdateRule : std::uint8_t {
  kRetain = 0,  ///< `paper`, but load that `paper` would drop at once is released slowly.
  kPaper = 1,   ///< Eqs. 4-6: s⁺ = max(σ, min(s_p, 0)).
  kIntermediateRepresentation = 2,  ///< Berkelman et al. 1999: s⁺ = σ, active contacts only.
  kPlaneRecovery = 3,  ///< Mark et al. 1996 (VRPN): the depth is kept, then ramped to σ.
};

/// What stands between device and proxy (METHOD 6), and what others do.
enum class ControllerKind : std::uint8_t {
  kFourChannel = 0,     ///< Positions and wrenches both ways; needs the hand's wrench.
  kThreeChannel = 1,    ///< As four channels, without the hand's wrench on the proxy.
  kVirtualCoupler = 2,  ///< Positions only.
  kDirect = 3,          ///< No coordination: the device takes the proxy's place.

  // The rivals. The device takes the proxy's place, which the environment's tool T follows.
  /// Berkelman et al. 1999: as direct, but contacts restrict translation only; a coupler to T
  /// restricts rotation.
  kRotationCoupler = 4,
  /// Colgate et al. 1995: no local contacts; a coupler between device and T, evaluated each step.
  kEngineCoupler = 5,
  /// No local contacts; the spring by which the device draws T, as T's engine sees both, held until
  /// the next update.
  kEngineForce = 6,
};

/// Whether the device takes the proxy's place, for which the tool must have one link.
constexpr bool replaces_proxy(ControllerKind kind) noexcept {
  switch (kind) {
    case ControllerKind::kFourChannel:
    case ControllerKind::kThreeChannel:
    case ControllerKind::kVirtualCoupler:
      return false;
    case ControllerKind::kDirect:
    case ControllerKind::kRotationCoupler:
    case ControllerKind::kEngineCoupler:
    case ControllerKind::kEngineForce:
      return true;
  }
  return false;
}

/// What of the physics can change during a session.
struct Tuning {
  UpdateRule update_rule = UpdateRule::kRetain;
  ControllerKind controller = ControllerKind::kFourChannel;
  double stiffness = 4000;                 ///< k_lc of each contact, N/m.
  double damping = 30;                     ///< b_lc, N·s/m.
  double friction = 0.3;                   ///< μ_k, and μ_s where this is changed.
  double restitution = 0;                  ///< e.
  double coupling_stiffness = 1500;        ///< K_c, translation, N/m.
  double coupling_damping = 30;            ///< B_c, translation, N·s/m.
  double coupling_angular_stiffness = 1;   ///< K_c, rotation, N·m/rad.
  double coupling_angular_damping = 0.03;  ///< B_c, rotation, N·m·s/rad.

  bool operator==(const Tuning&) const = default;
};

/// What a control may set a number of the tuning to.
struct TuningRange {
  const char* name;
  double Tuning::*number;
  double least;
  double most;
  const char* unit;
};
inline constexpr std::array<TuningRange, 8> kTuningRanges{{
    {"stiffness", &Tuning::stiffness, 1, 1e6, "N/m"},
    {"damping", &Tuning::damping, 0, 1e4, "N·s/m"},
    {"friction", &Tuning::friction, 0, 10, ""},
    {"restitution", &Tuning::restitution, 0, 1, ""},
    {"coupling_stiffness", &Tuning::coupling_stiffness, 0, 1e5, "N/m"},
    {"coupling_damping", &Tuning::coupling_damping, 0, 1e3, "N·s/m"},
    {"coupling_angular_stiffness", &Tuning::coupling_angular_stiffness, 0, 1e3, "N·m/rad"},
    {"coupling_angular_damping", &Tuning::coupling_angular_damping, 0, 10, "N·m·s/rad"},
}};

/// Whether all numbers are in their ranges.
constexpr bool is_in_range(const Tuning& tuning) noexcept {
  for (const TuningRange& range : kTuningRanges) {
    const double value = tuning.*range.number;
    if (!(value >= range.least && value <= range.most)) return false;
  }
  return true;
}

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
  Tuning tuning{};                  ///< In effect as the session begins.
  bool guidable = false;            ///< Whether a control can hold the hand of the device.
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
  std::uint64_t control = 0;  ///< Sequence of the control in effect, 0 if none.
};

/// Client to server: the whole of what the person at the environment asks for. It takes effect with
/// the next update of a higher sequence that the server takes, so that a recorded session shows in
/// which step.
struct Control {
  bool telemetry = false;  ///< Send ticks and local states.
  bool holds = false;      ///< The person holds the hand of a simulated device at X_WTarget.
  Pose X_WTarget;
  bool tuned = false;  ///< `tuning` is in effect; otherwise what the server was started with.
  Tuning tuning{};

  bool operator==(const Control&) const = default;
};

/// What keeps the commanded wrench from being the wanted one.
enum class ForceLimit : std::uint8_t { kNone = 0, kForce = 1, kTorque = 2, kRate = 3, kFade = 4 };

/// Signals of one step of the servo, for charts. Forces only; about the hand's frame, world axes.
struct TickSignals {
  Vector3 F_env = Vector3::Zero();
  Vector3 F_command = Vector3::Zero();
  Vector3 F_hand = Vector3::Zero();
  double torque = 0;               ///< Magnitude of the commanded torque, N·m.
  double smallest_separation = 0;  ///< m; 0 without contacts.
  double device_proxy = 0;         ///< Distance, m.
  double proxy_tool = 0;           ///< Distance, m.
  double lateness = 0;             ///< Wake-up after the scheduled time, s.
  double execution = 0;            ///< Of the step before, s.
  double age = 0;                  ///< Of the newest contacts when they were taken, s.
  std::uint16_t active_contacts = 0;
  std::uint16_t predicted_contacts = 0;
  bool adopted = false;                  ///< An update was taken in this step.
  ForceLimit limit = ForceLimit::kNone;  ///< Of the commanded wrench.
};

inline constexpr std::size_t kTicksPerMessage = 8;

/// Server to client: consecutive steps.
struct Ticks {
  std::uint64_t first_step = 1;
  StaticVector<TickSignals, kTicksPerMessage> ticks;
};

/// State of a local contact (METHOD 3, paper Sec. IV-A).
enum class ContactState : std::uint8_t {
  kImpending = 0,    ///< s > 0.
  kColliding = 1,    ///< s <= 0, v_n <= 0, and impending at the step before.
  kPenetrating = 2,  ///< s <= 0, v_n <= 0, and not impending at the step before.
  kSeparating = 3,   ///< s <= 0, v_n > 0.
};

/// A contact as the local model has it, world axes.
struct LocalContactReport {
  std::uint16_t link = 0;
  ContactState state = ContactState::kImpending;
  bool retained = false;           ///< Its load is being released.
  Vector3 c_W = Vector3::Zero();   ///< Point of the constraint, m.
  Vector3 n_W = Vector3::UnitZ();  ///< Unit normal, from the environment to the tool.
  Vector3 p_W = Vector3::Zero();   ///< The local contact point, m.
  double s = 0;                    ///< Separation, m.
  Vector3 f_W = Vector3::Zero();   ///< Force on the tool, N.
};

/// Server to client, with an acknowledgement: at most kMaxContacts of the local contacts.
struct LocalState {
  std::uint64_t step = 0;
  ForceLimit limit = ForceLimit::kNone;
  StaticVector<LocalContactReport, kMaxContacts> contacts;
};

enum class GoodbyeReason : std::uint8_t { kFinished = 0, kShutdown = 1 };

struct Goodbye {
  GoodbyeReason reason = GoodbyeReason::kFinished;
};

}  // namespace hlm::protocol
