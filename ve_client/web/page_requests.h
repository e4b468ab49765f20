// What a page asks for, read and checked.
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "ve_client/web/live_settings.h"

namespace hlm::ve {

/// The hand of a simulated device is held at a target, or let go.
struct HandRequest {
  std::optional<Pose> X_WTarget;
};
/// These settings hold from now on.
struct SettingsRequest {
  LiveSettings settings;
};
struct TelemetryRequest {
  bool on = false;
};
struct ResetRequest {
  std::optional<std::string> start;  ///< Of the tool; none: the same as before.
};
/// Cannot be done: the field at fault, its value and what is allowed.
struct Refusal {
  std::string field;
  std::string value;
  std::string text;
};

using ParsedRequest =
    std::variant<HandRequest, SettingsRequest, TelemetryRequest, ResetRequest, Refusal>;

/// What of the tool decides whether a request can be met.
struct ToolTraits {
  std::size_t links = 1;
  std::vector<std::string> starts;  ///< Where it may begin, beside where the world places it.
};

/// Never throws: what is not as it should be becomes a Refusal. present: the settings in effect, of
/// which a request changes some.
ParsedRequest parse_request(const std::string& text, const LiveSettings& present,
                            const ToolTraits& tool);

}  // namespace hlm::ve
