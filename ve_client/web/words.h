// The page's words for enumerations, in the order of their values, and the facts that go with them.
#pragma once

#include <array>
#include <cstddef>

#include "protocol/messages.h"

namespace hlm::ve {

inline constexpr std::array kUpdateRules{"retain", "paper", "intermediate_representation",
                                         "plane_recovery"};
inline constexpr std::array kControllers{"four_channel", "three_channel",    "virtual_coupler",
                                         "direct",       "rotation_coupler", "engine_coupler",
                                         "engine_force"};
inline constexpr std::array kServerStates{"idle", "running", "silent", "fault"};
inline constexpr std::array kFaults{"none", "non_finite", "overrun", "device"};
inline constexpr std::array kProxyStates{"free_motion", "colliding", "resting"};
inline constexpr std::array kContactStates{"impending", "colliding", "penetrating", "separating"};
inline constexpr std::array kLimits{"none", "force", "torque", "rate", "fade"};

template <class Enum, std::size_t count>
const char* word(Enum value, const std::array<const char*, count>& words) {
  return words.at(static_cast<std::size_t>(value));
}

/// Whether local contacts have a part in the force; otherwise it is the engine's alone.
constexpr bool uses_contacts(protocol::ControllerKind kind) noexcept {
  return kind != protocol::ControllerKind::kEngineCoupler &&
         kind != protocol::ControllerKind::kEngineForce;
}

/// Whether a tool of so many links can have the controller.
constexpr bool suits(protocol::ControllerKind kind, std::size_t links) noexcept {
  return links == 1 || !protocol::replaces_proxy(kind);
}

}  // namespace hlm::ve
