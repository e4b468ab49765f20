// The messages that server and client exchange, as plain values. PROTOCOL.md gives their bytes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "hlm/common/contact.h"
#include "hlm/common/freedoms.h"
#include "hlm/common/joint_drive.h"
#include "hlm/common/static_vector.h"
#include "hlm/common/tool_description.h"
#include "hlm/common/tool_model.h"
#include "hlm/common/tuning.h"
#include "hlm/common/vocabulary.h"

namespace hlm::protocol {

inline constexpr std::uint16_t kProtocolVersion = 2;
/// Largest UDP payload, bytes: below the smallest MTU in common use, so that no datagram fragments.
inline constexpr std::size_t kMaxDatagram = 1200;
/// Kept free in each datagram for sealing it: a counter, a tag, a receiver's index.
inline constexpr std::size_t kSealRoom = 32;
/// Longest text for a person, bytes of UTF-8.
inline constexpr std::size_t kMaxText = 200;
using Text = StaticVector<char, kMaxText>;

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
  kRefusal = 10,       ///< Server to client: why an update, or a contact of it, was not used.
  kImpulses = 11,      ///< Server to client: what the tool has done to movable bodies.
  kSceneChunk = 12,    ///< Client to server: a piece of the scene stream.
  kSceneState = 13,    ///< Server to client: how far that has come, and what was made of it.
  kHeldBodies = 14,    ///< Server to client: where the bodies are that the hand holds.
};

/// Client to server: the tool and where it is. Repeated until answered.
struct Hello {
  std::uint64_t nonce = 0;  ///< Drawn again for each session; a repeated hello carries the same.
  ToolDescription tool;
  Configuration q;            ///< Initial configuration of the tool; the proxy starts there.
  double ve_rate = 60;        ///< Nominal step rate of the virtual environment, Hz.
  double epsilon = 0;         ///< Radius of the ε-active tool, m.
  bool clears_fault = false;  ///< A person asks for this session: it ends a fault of the server.
};

/// Which parts of an update a server uses. A client need not send the others.
struct Capabilities {
  bool movable_bodies = false;  ///< Bodies of an update and their contacts; otherwise a contact's
                                ///< point moves with its v_WC.
  bool axes = false;            ///< Before 0.5: contacts on all axes of a pair.
  bool self_contacts = false;   ///< Contacts between two links of the tool.
  bool scenes = false;          ///< Shapes and placements, by the scene stream.
  bool holds = false;           ///< Inertias, too: the server moves what the hand holds.
  bool guides = false;          ///< Tools may have curves, and updates drives.

  bool operator==(const Capabilities&) const = default;
};

/// What a client may want to know of the haptic device.
struct DeviceReport {
  Text name{};
  /// Ratings: N, N·m, N/m, N·m/rad; 0 where the device has none.
  double max_force = 0;
  double max_torque = 0;
  double max_stiffness = 0;
  double max_angular_stiffness = 0;
  double scale = 1;                  ///< Metres in the world for each metre of the handle.
  std::uint8_t buttons = 0;          ///< How many it has.
  bool gripper = false;              ///< Whether it measures a gripper's opening.
  bool renders_torque = true;        ///< False: a device of three degrees of freedom.
  bool measures_hand = false;        ///< Whether F_hand is known.
  bool guidable = false;             ///< Whether a control can hold its hand.
  Freedoms freedoms = kAllFreedoms;  ///< Directions in which its handle moves.
  bool observes_hand = false;        ///< Whether F_hand is estimated, not measured.
};

/// Server to client.
struct Welcome {
  std::uint64_t nonce = 0;        ///< Nonce of the hello that is answered.
  double servo_rate = 1000;       ///< Rate of the local model, Hz.
  std::uint64_t fingerprint = 0;  ///< Fingerprint of the server's effective options.
  Tuning tuning{};                ///< Tuning in effect as the session begins.
  double silence_time = 0.25;     ///< Force fades when the client is silent for this long, s.
  double fade_time = 0.02;        ///< How long the fade from full force takes, s.
  double least_update_rate = 4;   ///< Below this force comes and goes, Hz.
  Capabilities capabilities{};
  DeviceReport device{};
};

enum class RejectReason : std::uint8_t { kVersion = 1, kBusy = 2, kTool = 3, kFault = 4 };

struct Reject {
  std::uint64_t nonce = 0;
  RejectReason reason = RejectReason::kBusy;
  std::uint16_t version = kProtocolVersion;  ///< The version that the server speaks.
  Text text;                                 ///< UTF-8, for a person.
};

/// Client to server: the contacts near the tool, and the configuration for which they hold.
struct ContactUpdate {
  double ve_time = 0;           ///< Simulated time of the virtual environment, s.
  double ve_period = 0;         ///< Length of its latest step, s.
  double compute_time = 0;      ///< Time from sampling q_VE to sending this, s.
  std::uint64_t echo_step = 0;  ///< `step` of the latest proxy state received, 0 if none.
  double echo_hold = 0;         ///< Time from the arrival of that proxy state to sending this, s.
  /// The bodies' state contains the impulses up to this step; it may lie between two.
  double impulse_step = 0;
  Configuration q_VE;  ///< Tool configuration for which the contacts were computed.
  Velocity v_VE;       ///< Generalised velocity of the tool.
  MovableBodies bodies;
  ReportedContacts contacts;
  BodyPoses poses;          ///< Of bodies whose shapes the server has.
  AccelerationRates rates;  ///< Of `bodies`; that of others is 0.
  /// What else pushes the tool; several on one link add up.
  ExternalWrenches external;
  Ownerships owners;  ///< Of `poses`; of those that are not named 0.
  /// 0: the contacts are those of everything near. Otherwise they are those of what has no shape in
  /// the scene in force, and this is the latest commit that had been queued.
  std::uint32_t scene = 0;
  JointDrives drives;  ///< Of the tool's joints.
};

/// Server to client: an update, or one contact of it, was not used. At most one in 0.1 s.
struct Refusal {
  std::uint64_t refused = 0;  ///< Sequence of the update.
  UpdateError error = UpdateError::kNone;
  bool whole = true;        ///< The update as a whole; otherwise only contact `item` of it.
  std::uint16_t item = 0;   ///< Index in the list that the error is in.
  std::uint64_t count = 0;  ///< Updates refused as a whole in this session.
};

/// The impulse of the tool on one body since the session began: N·s and N·m·s about the body's
/// centre of mass, world axes. A total, so that a lost datagram loses nothing.
struct BodyImpulse {
  std::uint32_t body = 0;
  Vector6 P_W = Vector6::Zero();
};

/// Server to client, with an acknowledgement where there are bodies.
struct Impulses {
  std::uint64_t step = 0;  ///< Step of the local model: the totals contain it.
  StaticVector<BodyImpulse, kMaxBodies> bodies;
};

/// A body that the server moves, or has moved and gives back: the environment puts it there.
struct HeldBody {
  std::uint32_t body = 0;
  std::uint32_t number = 0;   ///< Of Ownership. Odd: held; even: given back, with this state.
  Pose X_WB;                  ///< Its frame in the world.
  Twist V_W = Twist::Zero();  ///< Twist at that frame's origin, world axes, m/s and rad/s.
};
/// So many fit into a datagram.
inline constexpr std::size_t kMaxHeldInMessage = 8;

/// Server to client, with an acknowledgement: all bodies that are held, or given back without the
/// environment having said so, in one or more messages.
struct HeldBodies {
  std::uint64_t step = 0;  ///< Step of the local model.
  StaticVector<HeldBody, kMaxHeldInMessage> bodies;
};

/// Server to client: the acknowledgement of an adopted update.
struct ProxyState {
  std::uint64_t acknowledged = 0;  ///< Sequence of the adopted update.
  /// Periods of the loop since the session began, this one and missed ones included.
  std::uint64_t step = 0;
  double age = 0;               ///< Age the server attributed to the update's contacts, s.
  double update_send_time = 0;  ///< Send time of the acknowledged update, client's clock, s.
  double hold = 0;              ///< Time from the arrival of that update to sending this, s.
  ServerState server = ServerState::kOff;
  Fault fault = Fault::kNone;
  ProxyContactState contact_state = ProxyContactState::kFreeMotion;
  std::uint16_t active_contacts = 0;     ///< Local contacts with separation <= 0.
  std::uint16_t predicted_contacts = 0;  ///< Local contacts with separation > 0.
  double smallest_separation = 0;        ///< Over all local contacts, m; +0 if there are none.
  Configuration q;                       ///< Configuration of the proxy.
  Velocity v;                            ///< Velocity of the proxy.
  Pose X_WD;                             ///< Device handle in the world.
  Twist V_WD = Twist::Zero();            ///< Twist of the device handle.
  Wrench F_env = Wrench::Zero();         ///< Contact wrench at the hand (Eqs. 8, 12), world axes.
  Wrench F_command = Wrench::Zero();     ///< Wrench commanded to the device, after limits.
  Wrench F_hand = Wrench::Zero();        ///< The hand's wrench as known to the controller.
  std::uint64_t overruns = 0;            ///< Missed periods since the server started.
  std::uint64_t updates = 0;             ///< Updates adopted in this session.
  std::uint64_t dropped = 0;  ///< Datagrams dropped since the server started, all reasons.
  std::uint64_t control = 0;  ///< Sequence of the control in effect, 0 if none.
  ForceLimit limit = ForceLimit::kNone;  ///< What keeps F_command from being the wanted wrench.
  bool hand_measured = false;            ///< Whether F_hand is known.
  std::uint32_t buttons = 0;             ///< Bit i: button i of the device is down.
  double gripper = 0;                    ///< Opening of the device's gripper, 0 closed to 1 open.
  double scale = 1;                      ///< Metres in the world for each metre of the handle.
  Fade fade = Fade::kNone;               ///< Why force fades, or waits at zero.
  // Energy that has passed the device port since the session began, J.
  double given = 0;            ///< Energy given to the hand.
  double taken = 0;            ///< Energy taken from the hand.
  double explained = 0;        ///< Explained part of given - taken: weight, constraints that move.
  double tank = 0;             ///< What may still be given beyond that.
  double brought = 0;          ///< Energy that updates have brought into contacts' springs.
  bool hand_observed = false;  ///< Whether F_hand is estimated, not measured.
  /// Share, 0 to 1, of the stiffness and damping that the control asks for that is not in effect,
  /// because the device does not support it: of the coupling, or of all contacts together where the
  /// controller does not couple translation.
  double lowered = 0;
  std::uint32_t scene = 0;  ///< Number of the scene in force, 0 none.
  /// Force of contacts that opens the gripper, N or N·m of its coordinate; 0 without a drive.
  double grip = 0;
};

/// How the hand's wrench is known, as status line, state file and page say it.
constexpr std::string_view hand_source(bool known, bool observed) noexcept {
  if (!known) return "unknown";
  return observed ? "observed" : "measured";
}

/// Client to server: all that the person at the environment asks for. It takes effect with the next
/// update of a higher sequence that the server takes, so that a recorded session shows the step.
struct Control {
  bool telemetry = false;  ///< Send ticks and local states.
  bool holds = false;      ///< The person holds the hand of a simulated device at X_WTarget.
  Pose X_WTarget;
  bool tuned = false;  ///< `tuning` is in effect; otherwise what the server was started with.
  Tuning tuning{};

  bool operator==(const Control&) const = default;
};

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
  double execution = 0;            ///< Execution time of the step before, s.
  double age = 0;                  ///< Age of the latest contacts when they were taken, s.
  std::uint16_t active_contacts = 0;
  std::uint16_t predicted_contacts = 0;
  bool adopted = false;                  ///< An update was taken in this step.
  ForceLimit limit = ForceLimit::kNone;  ///< Limit on the commanded wrench.
};

inline constexpr std::size_t kTicksPerMessage = 8;

/// Server to client: consecutive steps.
struct Ticks {
  std::uint64_t first_step = 1;
  StaticVector<TickSignals, kTicksPerMessage> ticks;
};

/// A contact as the local model has it, world axes.
struct LocalContactReport {
  std::uint64_t identity = 0;
  ContactSide a;
  ContactSide b;
  ContactState state = ContactState::kImpending;
  bool retained = false;           ///< The contact's load is being released.
  Vector3 c_W = Vector3::Zero();   ///< Point of the constraint, m.
  Vector3 n_W = Vector3::UnitZ();  ///< Unit normal, from b to a.
  Vector3 p_W = Vector3::Zero();   ///< The local contact point, m.
  double s = 0;                    ///< Separation, m.
  Vector3 f_W = Vector3::Zero();   ///< Force on a, N.
};

/// Largest number of local contacts that telemetry reports.
inline constexpr std::size_t kMaxReportedContacts = 64;

/// Server to client, with an acknowledgement: the local contacts.
struct LocalState {
  std::uint64_t step = 0;
  StaticVector<LocalContactReport, kMaxReportedContacts> contacts;
};

/// Largest number of bytes of a chunk of the scene stream.
inline constexpr std::size_t kChunkSize = 1024;
/// Chunks that a server has room for, from the first that it has not taken.
inline constexpr std::size_t kSceneWindow = 256;
using ChunkData = StaticVector<std::byte, kChunkSize>;

/// Client to server: a piece of the scene stream (scene_records.h). A number always carries the
/// same data.
struct SceneChunk {
  std::uint64_t number = 0;  ///< From 0 in each session.
  ChunkData data;            ///< 1 to kChunkSize bytes.
};

/// Why the scene stream was refused: the rest of it is ignored in its session.
enum class SceneError : std::uint8_t {
  kNone = 0,
  kMalformed = 1,
  kHash = 2,
  kUnknownShape = 3,
  kDuplicate = 4,
  kUnknownPlacement = 5,
  kLimit = 6,
  kGeometry = 7,
  kSide = 8,
  kOrder = 9,
  kSlow = 10,
};

/// Server to client: how far the scene stream has come, and what was made of it.
struct SceneState {
  std::uint64_t next = 0;  ///< All chunks below have been taken.
  /// Bit i of word w: chunk next + 64 w + i has come.
  std::array<std::uint64_t, kSceneWindow / 64> bitmap{};
  std::uint32_t scene = 0;           ///< Number of the scene in force, 0 none.
  std::uint32_t received_scene = 0;  ///< Number of the latest commit that was read, 0 none.
  std::uint32_t shapes = 0;          ///< Shapes that the server holds; likewise the next two.
  std::uint32_t placements = 0;
  std::uint64_t bytes = 0;
  SceneError error = SceneError::kNone;
  std::uint32_t item = 0;  ///< Id of the placement that the error is about; otherwise 0.
  Text text;               ///< The same for a person, UTF-8.
};

enum class GoodbyeReason : std::uint8_t { kFinished = 0, kShutdown = 1 };

struct Goodbye {
  GoodbyeReason reason = GoodbyeReason::kFinished;
};

}  // namespace hlm::protocol

namespace hlm {

template <>
inline constexpr std::array<Word<protocol::RejectReason>, 4> kWords<protocol::RejectReason>{{
    {protocol::RejectReason::kVersion, "version", "the server speaks another version"},
    {protocol::RejectReason::kBusy, "busy", "another session is alive"},
    {protocol::RejectReason::kTool, "tool", "the tool cannot be used"},
    {protocol::RejectReason::kFault, "fault", "a fault waits for a person to end it"},
}};

template <>
inline constexpr std::array<Word<protocol::SceneError>, 11> kWords<protocol::SceneError>{{
    {protocol::SceneError::kNone, "none", "no error"},
    {protocol::SceneError::kMalformed, "malformed", "a record is not as the standard says"},
    {protocol::SceneError::kHash, "hash", "a shape's hash is not that of its bytes"},
    {protocol::SceneError::kUnknownShape, "unknown_shape",
     "a placement of a shape that is not there"},
    {protocol::SceneError::kDuplicate, "duplicate", "another placement has the same id"},
    {protocol::SceneError::kUnknownPlacement, "unknown_placement",
     "a record about a placement that is not there"},
    {protocol::SceneError::kLimit, "limit", "more than the server holds"},
    {protocol::SceneError::kGeometry, "geometry", "a shape that cannot be used as it is placed"},
    {protocol::SceneError::kSide, "side", "a placement on a link that the tool does not have"},
    {protocol::SceneError::kOrder, "order", "the number of a commit is not above the one before"},
    {protocol::SceneError::kSlow, "slow", "the scene's contacts take longer than a tick"},
}};

template <>
inline constexpr std::array<Word<protocol::GoodbyeReason>, 2> kWords<protocol::GoodbyeReason>{{
    {protocol::GoodbyeReason::kFinished, "finished", "the sender has finished"},
    {protocol::GoodbyeReason::kShutdown, "shutdown", "the sender's program ends"},
}};

}  // namespace hlm
