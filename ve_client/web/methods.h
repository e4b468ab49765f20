// The methods that a page offers: their words, and what each sets.
#pragma once

#include <array>

#include "ve_client/web/live_settings.h"

namespace hlm::ve {

struct Method {
  const char* name;
  const char* label;
  const char* help;  ///< One phrase for a person.
  UpdateRule update_rule;
  ControllerKind controller;
  double epsilon;          ///< m.
  double largest_epsilon;  ///< m; 0: epsilon does not grow.
};

inline constexpr std::array<Method, 6> kMethods{{
    {"lm5", "LM 5 mm", "Local model; contacts are sent up to 5 mm before they are touched",
     UpdateRule::kRetain, ControllerKind::kFourChannel, 0.005, 0},
    {"lm-adaptive", "LM adaptive", "Local model; epsilon grows with speed and delay",
     UpdateRule::kRetain, ControllerKind::kFourChannel, 0.005, 0.08},
    {"lm0", "LM 0", "Local model without prediction: only touching contacts are sent",
     UpdateRule::kRetain, ControllerKind::kFourChannel, 0, 0},
    {"ir", "IR", "Intermediate representation: planes that stay until the next update",
     UpdateRule::kIntermediateRepresentation, ControllerKind::kDirect, 0, 0},
    {"coupler", "Coupler to engine", "A spring and damper to the engine's tool",
     UpdateRule::kRetain, ControllerKind::kEngineCoupler, 0, 0},
    {"engine", "Direct to engine", "The engine's contact force, held between frames",
     UpdateRule::kRetain, ControllerKind::kEngineForce, 0, 0},
}};

/// Whether a tool of so many links can have the controller.
constexpr bool suits(ControllerKind kind, std::size_t links) noexcept {
  return links == 1 || !traits(kind).replaces_proxy;
}

inline LiveSettings with_method(const Method& method, LiveSettings settings) {
  settings.tuning.update_rule = method.update_rule;
  settings.tuning.controller = method.controller;
  settings.frame.epsilon = method.epsilon;
  settings.frame.largest_epsilon = method.largest_epsilon;
  return settings;
}

/// The method by which all is set as it is; null if there is none.
inline const Method* method_in_effect(const LiveSettings& settings) {
  for (const Method& method : kMethods) {
    if (settings.tuning.update_rule == method.update_rule &&
        settings.tuning.controller == method.controller &&
        settings.frame.epsilon == method.epsilon &&
        settings.frame.largest_epsilon == method.largest_epsilon) {
      return &method;
    }
  }
  return nullptr;
}

}  // namespace hlm::ve
