// What a page asks for, read and checked: docs/page_messages.md.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "hlm/page/live_settings.h"

namespace hlm::ve {

/// The hand of a simulated device: held at a target, or released.
struct HandRequest {
  std::optional<Pose> X_WTarget;  ///< None: released.
  bool grab = false;              ///< A hold begins; otherwise one goes on.
};
/// The settings from now on.
struct SettingsRequest {
  LiveSettings settings;
};
struct TelemetryRequest {
  bool on = false;
};
struct ResetRequest {
  std::optional<std::string> start;  ///< Start of the tool; none: the same as before.
};
/// In a pause the world goes on by one frame.
struct StepRequest {};
/// A body is pulled, or let go.
struct PullRequest {
  std::optional<BodyPull> pull;  ///< None: let go.
};
/// Another world, to be played as when the client starts with it.
struct SceneRequest {
  std::string name;        ///< One of WorldTraits::scenes.
  std::uint64_t page = 0;  ///< Page that makes the request.
};
/// The request cannot be granted: the field at fault, its value and what is allowed.
struct Refusal {
  std::string field;
  std::string value;
  std::string text;
};

using ParsedRequest = std::variant<HandRequest, SettingsRequest, TelemetryRequest, ResetRequest,
                                   StepRequest, PullRequest, SceneRequest, Refusal>;

/// What decides, of the world that is played, whether a request can be granted.
struct WorldTraits {
  std::size_t links = 1;            ///< Links of the session's tool.
  std::vector<std::string> starts;  ///< Starts of the tool besides the world's own place.
  std::vector<std::string> scenes;  ///< Worlds that may be played.
  std::vector<int> movable{};       ///< Bodies that can be pulled.
  bool environment = true;          ///< What is the client's may be set.
};

/// Never throws: a malformed request or a value out of range becomes a Refusal. present: the
/// settings in effect, some of which a request changes.
ParsedRequest parse_request(const std::string& text, const LiveSettings& present,
                            const WorldTraits& world);

}  // namespace hlm::ve
