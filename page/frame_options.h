// What a frame of the virtual environment does besides the simulation, and within which bounds.
#pragma once

#include <array>
#include <optional>

#include "hlm/common/range.h"
#include "hlm/common/spatial.h"
#include "hlm/common/tool_count.h"

namespace hlm::ve {

inline constexpr Range kEpsilons{0, 0.2, "m"};

/// What draws a movable body by one of its points, as with a spring and a damper: a person's mouse.
struct BodyPull {
  int body = 0;                        ///< Index among the world's bodies.
  Vector3 p_B = Vector3::Zero();       ///< The point, in the body's frame, m.
  Vector3 target_W = Vector3::Zero();  ///< Where it is drawn to, m.
};

struct FrameOptions {
  double pace = 1;  ///< Of the world's time beside the hand's: see WorldPace.
  /// A server that has the world's shapes (HapticClient::offer_scene) finds contacts itself.
  /// Otherwise those within ε are sent, one manifold for each pair of shapes.
  bool shapes = true;
  double epsilon = 0.005;  ///< ε of contacts that are sent, m, >= 0.
  /// Artificial delay, s, >= 0: the update is held this long after the tool was sampled, as if the
  /// engine needed that long for its contacts. compute_time includes it, as it would there.
  double delay = 0;
  /// For each tool: its contacts carry the friction of the materials where the world states it;
  /// otherwise its server's own holds everywhere.
  std::array<bool, kMostTools> report_friction{true, true};
  std::optional<BodyPull> pull{};  ///< Empty: nothing is pulled.
  double opening = 1;              ///< Of grippers whose device has none, 0 closed to 1 open.
  /// The tool pushes bodies in the engine as it follows the proxy, and the server takes them for
  /// moving constraints: what a server without movable bodies gets. For comparisons.
  bool push_by_following = false;
};

}  // namespace hlm::ve
