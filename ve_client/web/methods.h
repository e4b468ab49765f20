// The methods that a page offers by name: what each sets.
#pragma once

#include <array>

#include "ve_client/web/live_settings.h"

namespace hlm::ve {

struct Method {
  const char* name;
  UpdateRule update_rule;
  ControllerKind controller;
  double epsilon;          ///< m.
  double largest_epsilon;  ///< m; 0: epsilon does not grow.
};

inline constexpr std::array<Method, 6> kMethods{{
    {"lm5", UpdateRule::kRetain, ControllerKind::kFourChannel, 0.005, 0},
    {"lm-adaptive", UpdateRule::kRetain, ControllerKind::kFourChannel, 0.005, 0.08},
    {"lm0", UpdateRule::kRetain, ControllerKind::kFourChannel, 0, 0},
    {"ir", UpdateRule::kIntermediateRepresentation, ControllerKind::kDirect, 0, 0},
    {"coupler", UpdateRule::kRetain, ControllerKind::kEngineCoupler, 0, 0},
    {"engine", UpdateRule::kRetain, ControllerKind::kEngineForce, 0, 0},
}};

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
