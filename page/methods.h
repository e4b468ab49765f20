// The methods that a page offers: what each sets, and which is in effect.
#pragma once

#include "hlm/common/methods.h"
#include "hlm/page/live_settings.h"

namespace hlm::ve {

/// Whether a tool with this many links can have the controller.
constexpr bool suits(ControllerKind kind, std::size_t links) noexcept {
  return links == 1 || !traits(kind).replaces_proxy;
}

inline LiveSettings with_method(const Method& method, LiveSettings settings) {
  settings.tuning.update_rule = method.update_rule;
  settings.tuning.controller = method.controller;
  settings.frame.epsilon = method.epsilon;
  settings.frame.shapes = method.shapes;
  return settings;
}

/// The method by which all is set as it is; null if there is none.
inline const Method* method_in_effect(const LiveSettings& settings) {
  for (const Method& method : kMethods) {
    if (method.on_page && settings.frame.shapes == method.shapes &&
        settings.tuning.update_rule == method.update_rule &&
        settings.tuning.controller == method.controller &&
        (method.shapes || settings.frame.epsilon == method.epsilon)) {
      return &method;
    }
  }
  return nullptr;
}

}  // namespace hlm::ve
