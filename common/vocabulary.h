// The words of the domain: each enumeration next to the one table of its names. Options, tick logs,
// the live page, plots and experiments read these tables; the wire carries the values.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace hlm {

template <class Enum>
struct Word {
  Enum value;
  std::string_view name;         ///< What files and options say.
  std::string_view meaning;      ///< Meaning for a person, one clause.
  std::string_view remedy = {};  ///< What a person can do if something went wrong, one clause.
};

/// The table of an enumeration, in the order of its values.
template <class Enum>
inline constexpr std::nullptr_t kWords = nullptr;

/// The value's name; "unknown" for a value that a newer peer has sent.
template <class Enum>
constexpr std::string_view name_of(Enum value) noexcept {
  for (const Word<Enum>& word : kWords<Enum>) {
    if (word.value == value) return word.name;
  }
  return "unknown";
}

template <class Enum>
constexpr std::string_view meaning_of(Enum value) noexcept {
  for (const Word<Enum>& word : kWords<Enum>) {
    if (word.value == value) return word.meaning;
  }
  return "not known to this version";
}

template <class Enum>
constexpr std::string_view remedy_of(Enum value) noexcept {
  for (const Word<Enum>& word : kWords<Enum>) {
    if (word.value == value) return word.remedy;
  }
  return "see the server's log";
}

/// Whether the value is one that this version knows.
template <class Enum>
constexpr bool is_known(Enum value) noexcept {
  for (const Word<Enum>& word : kWords<Enum>) {
    if (word.value == value) return true;
  }
  return false;
}

/// The value of that name; empty if there is none.
template <class Enum>
constexpr std::optional<Enum> value_of(std::string_view name) noexcept {
  for (const Word<Enum>& word : kWords<Enum>) {
    if (word.name == name) return word.value;
  }
  return std::nullopt;
}

/// How a contact's separation carries over an update (docs/method.md 2).
enum class UpdateRule : std::uint8_t {
  kRetain = 0,
  kPaper = 1,                       ///< Eqs. 4-6: s⁺ = max(σ, min(s_p, 0)).
  kIntermediateRepresentation = 2,  ///< Berkelman et al. 1999: s⁺ = σ, active contacts only.
  kPlaneRecovery = 3,               ///< Mark et al. 1996 (VRPN).
};
template <>
inline constexpr std::array<Word<UpdateRule>, 4> kWords<UpdateRule>{{
    {UpdateRule::kRetain, "retain",
     "as paper, but load that would drop at once is released slowly"},
    {UpdateRule::kPaper, "paper", "an update never raises a contact's force"},
    {UpdateRule::kIntermediateRepresentation, "intermediate_representation",
     "each update replaces the touching contacts"},
    {UpdateRule::kPlaneRecovery, "plane_recovery",
     "the depth is kept, then ramped to the reported one"},
}};

/// What an update rule does, for all who must know.
struct UpdateRuleTraits {
  /// Eqs. 4-6: the proxy's deformation goes on, so that no update raises a contact's force. Else
  /// the separation is the reported one.
  bool keeps_deformation = true;
  /// Load that would drop at once is released step by step, also where a contact is no longer
  /// reported, and deformation heals at the cost of what the contacts have taken.
  bool releases_load = false;
  /// A change of depth, up or down, is spread over `recovery_steps` steps.
  bool ramps_depth = false;
  /// Contacts that do not touch are left out. The others come penetrating: that is no collision.
  bool active_only = false;
};

constexpr UpdateRuleTraits traits(UpdateRule rule) noexcept {
  switch (rule) {
    case UpdateRule::kRetain:
      return {.releases_load = true};
    case UpdateRule::kPaper:
      return {};
    case UpdateRule::kIntermediateRepresentation:
      return {.keeps_deformation = false, .active_only = true};
    case UpdateRule::kPlaneRecovery:
      return {.keeps_deformation = false, .ramps_depth = true};
  }
  return {};
}

/// What stands between device and proxy (docs/method.md 6), and what others do.
enum class ControllerKind : std::uint8_t {
  kFourChannel = 0,
  kThreeChannel = 1,
  kVirtualCoupler = 2,
  kDirect = 3,

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
template <>
inline constexpr std::array<Word<ControllerKind>, 7> kWords<ControllerKind>{{
    {ControllerKind::kFourChannel, "four_channel",
     "positions and wrenches both ways; needs the hand's wrench"},
    {ControllerKind::kThreeChannel, "three_channel",
     "as four_channel, without the hand's wrench on the proxy"},
    {ControllerKind::kVirtualCoupler, "virtual_coupler", "positions only"},
    {ControllerKind::kDirect, "direct", "no coordination: the device takes the proxy's place"},
    {ControllerKind::kRotationCoupler, "rotation_coupler",
     "as direct, but a coupler to the environment's tool restricts rotation"},
    {ControllerKind::kEngineCoupler, "engine_coupler",
     "no local contacts: a coupler to the environment's tool"},
    {ControllerKind::kEngineForce, "engine_force",
     "no local contacts: the engine's force, held between updates"},
}};

/// What a controller does, for all who must know.
struct ControllerTraits {
  bool replaces_proxy = false;  ///< The device takes the proxy's place: needs a tool of one link.
  bool uses_contacts = true;    ///< Contacts of the local model act.
  bool couples_translation = true;  ///< K_c and B_c of translation are rendered.
  bool couples_rotation = true;     ///< K_c and B_c of rotation are rendered.
};

constexpr ControllerTraits traits(ControllerKind kind) noexcept {
  switch (kind) {
    case ControllerKind::kFourChannel:
    case ControllerKind::kThreeChannel:
    case ControllerKind::kVirtualCoupler:
      return {};
    case ControllerKind::kDirect:
      return {.replaces_proxy = true, .couples_translation = false, .couples_rotation = false};
    case ControllerKind::kRotationCoupler:
      return {.replaces_proxy = true, .couples_translation = false};
    case ControllerKind::kEngineCoupler:
    case ControllerKind::kEngineForce:
      return {.replaces_proxy = true, .uses_contacts = false};
  }
  return {};
}

/// State of a local contact (docs/method.md 3, paper Sec. IV-A).
enum class ContactState : std::uint8_t {
  kImpending = 0,
  kColliding = 1,
  kPenetrating = 2,
  kSeparating = 3,
};
template <>
inline constexpr std::array<Word<ContactState>, 4> kWords<ContactState>{{
    {ContactState::kImpending, "impending", "s > 0"},
    {ContactState::kColliding, "colliding", "s <= 0, v_n <= 0, and impending at the step before"},
    {ContactState::kPenetrating, "penetrating",
     "s <= 0, v_n <= 0, and not impending at the step before"},
    {ContactState::kSeparating, "separating", "s <= 0, v_n > 0"},
}};

/// State of the proxy as a whole (docs/method.md 3).
enum class ProxyContactState : std::uint8_t { kFreeMotion = 0, kColliding = 1, kResting = 2 };
template <>
inline constexpr std::array<Word<ProxyContactState>, 3> kWords<ProxyContactState>{{
    {ProxyContactState::kFreeMotion, "free_motion", "all contacts are impending"},
    {ProxyContactState::kColliding, "colliding", "at least one contact collides"},
    {ProxyContactState::kResting, "resting", "there is contact, and none collides"},
}};

/// What the server is doing with its force (haptic_server/safety/state_machine.h).
enum class ServerState : std::uint8_t {
  kOff = 0,
  kActive = 1,
  kFading = 2,
  kFault = 3,
  kArming = 4,
  kRamping = 5,
};
template <>
inline constexpr std::array<Word<ServerState>, 6> kWords<ServerState>{{
    {ServerState::kOff, "off", "no session; the device is disabled"},
    {ServerState::kActive, "active", "a session with a live client, and all the force it asks for"},
    {ServerState::kFading, "fading", "force fades to zero, and comes back with the client"},
    {ServerState::kFault, "fault", "force is zero until a person asks for a new session"},
    {ServerState::kArming, "arming", "a session has begun; no force before contacts are known"},
    {ServerState::kRamping, "ramping", "force rises to what is asked for"},
}};

/// Whether force is rendered, be it held back while it rises.
constexpr bool renders_force(ServerState state) noexcept {
  return state == ServerState::kRamping || state == ServerState::kActive;
}

/// Why force is zero until a person asks for a new session.
enum class Fault : std::uint8_t {
  kNone = 0,
  kNonFinite = 1,
  kOverrun = 2,
  kDevice = 3,
  kImplausible = 4,
  kOperatorStop = 5,
  kHandleSpeed = 6,
  kWorkspace = 7,
  kEnergy = 8,
};
template <>
inline constexpr std::array<Word<Fault>, 9> kWords<Fault>{{
    {Fault::kNone, "none", "no fault"},
    {Fault::kNonFinite, "non_finite", "a value of the local model or the device is not finite",
     "lower the stiffness, or check what the device measures"},
    {Fault::kOverrun, "overrun", "the loop stood still for longer than allowed",
     "give the server free cores, real-time rights or a lower rate"},
    {Fault::kDevice, "device", "the device failed", "check its cable, power and enable switch"},
    {Fault::kImplausible, "implausible",
     "the proxy is faster than a hand, or far from the device's handle",
     "check how fast constraints and bodies of the environment move"},
    {Fault::kOperatorStop, "operator_stop", "an operator stopped the force",
     "ask whoever stopped it whether all is clear"},
    {Fault::kHandleSpeed, "handle_speed", "the handle is faster than allowed",
     "check what moves it, or raise --handle-speed-limit or --handle-rate-limit"},
    {Fault::kWorkspace, "workspace", "the handle is too far from where the session began",
     "check what moved it, or raise --workspace"},
    {Fault::kEnergy, "energy", "the device gave more energy than explained, and was not to be held",
     "lower stiffness or delay, or raise --energy-budget"},
}};

/// Whether only a person at the device's machine ends the fault, and no packet: all that concern
/// whoever holds the handle, and not just the client's numbers.
constexpr bool ends_at_device(Fault fault) noexcept {
  return fault != Fault::kNone && fault != Fault::kNonFinite && fault != Fault::kImplausible;
}

/// What comes to a tick from the device's machine: from a person there, or from the motors' guard.
enum class Intervention : std::uint8_t {
  kNone = 0,
  kStop = 1,
  kClear = 2,
  kHalted = 3,
  kUnguarded = 4,
};
template <>
inline constexpr std::array<Word<Intervention>, 5> kWords<Intervention>{{
    {Intervention::kNone, "none", "nothing"},
    {Intervention::kStop, "stop", "stops the force: a fault, whatever the state"},
    {Intervention::kClear, "clear",
     "lets the fault end, with the next session that a person asks for"},
    {Intervention::kHalted, "halted", "the guard took the motors off while the loop stood still"},
    {Intervention::kUnguarded, "unguarded", "nothing looks whether the loop goes on: no force"},
}};

/// Why force fades, or waits at zero, in a session that may get it back by itself.
enum class Fade : std::uint8_t {
  kNone = 0,
  kClientSilent = 1,
  kContactsOld = 2,
  kUpdatesInvalid = 3,
  kClientLeft = 4,
};
template <>
inline constexpr std::array<Word<Fade>, 5> kWords<Fade>{{
    {Fade::kNone, "none", "nothing fades"},
    {Fade::kClientSilent, "client_silent", "nothing of the client came for too long",
     "check that it runs and that the network loses little, or raise its frame rate"},
    {Fade::kContactsOld, "contacts_old", "the newest contacts are too old",
     "lower the delay, or the time that the environment takes for a frame"},
    {Fade::kUpdatesInvalid, "updates_invalid", "the client's updates are refused",
     "see the reasons that the client reports"},
    {Fade::kClientLeft, "client_left", "the client ended the session", "start it again"},
}};

/// What keeps the commanded wrench from being the wanted one.
enum class ForceLimit : std::uint8_t {
  kNone = 0,
  kForce = 1,
  kTorque = 2,
  kRate = 3,
  kFade = 4,
  kPower = 5,
  kEnergy = 6,
};
template <>
inline constexpr std::array<Word<ForceLimit>, 7> kWords<ForceLimit>{{
    {ForceLimit::kNone, "none", "nothing"},
    {ForceLimit::kForce, "force", "the force limit"},
    {ForceLimit::kTorque, "torque", "the torque limit"},
    {ForceLimit::kRate, "rate", "the limit on the change of force"},
    {ForceLimit::kFade, "fade", "a fade"},
    {ForceLimit::kPower, "power", "the limit on the power given to the hand"},
    {ForceLimit::kEnergy, "energy", "the passivity controller"},
}};

/// Why an update of contacts, or a contact of it, was not used.
enum class UpdateError : std::uint8_t {
  kNone = 0,
  kLayout = 1,
  kNonFinite = 2,
  kTool = 3,
  kQuaternion = 4,
  kRange = 5,
  kNormal = 6,
  kSide = 7,
  kDuplicate = 8,
  kDrive = 9,
};
template <>
inline constexpr std::array<Word<UpdateError>, 10> kWords<UpdateError>{{
    {UpdateError::kNone, "none", "no error"},
    {UpdateError::kLayout, "layout", "its bytes are not laid out as the standard says"},
    {UpdateError::kNonFinite, "non_finite", "a number is not finite"},
    {UpdateError::kTool, "tool", "q or v does not have the tool's number of coordinates"},
    {UpdateError::kQuaternion, "quaternion",
     "a quaternion, of q or of a body's pose, is not of length 1 within 1e-3"},
    {UpdateError::kRange, "range", "a number is outside its range"},
    {UpdateError::kNormal, "normal", "the normal is not of length 1 within 1e-3"},
    {UpdateError::kSide, "side",
     "a link that the tool does not have, or a contact of the tool without it on side a"},
    {UpdateError::kDuplicate, "duplicate",
     "another contact of the update has the same identity, or another body or pose the same id"},
    {UpdateError::kDrive, "drive",
     "a drive on a joint that has not one coordinate, or a second one"},
}};

}  // namespace hlm
