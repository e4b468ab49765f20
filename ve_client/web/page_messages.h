// What ve_client sends to a page, as JSON or, for ticks, as bytes: docs/page_messages.md.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hlm/client/haptic_client.h"
#include "hlm/protocol/messages.h"
#include "hlm/scene/scene.h"
#include "hlm/ve/frame.h"
#include "hlm/web/live_settings.h"

namespace hlm::ve {

/// A world and its tool, as they begin.
struct WorldView {
  const VirtualEnvironment& environment;
  const Scene& scene;                       ///< What is played,
  const std::vector<SceneSummary>& scenes;  ///< and what may be, this one included.
  const std::string& start;  ///< One of its starts; empty: where the world places it.
  const protocol::Welcome* welcome = nullptr;  ///< Null before the server has answered.
};
/// The message `world`.
std::string world_message(const WorldView& view);

/// What a frame shows.
struct FrameView {
  const VirtualEnvironment& environment;
  const HapticClient& client;
  const protocol::ProxyState* state = nullptr;     ///< Latest one of the session, null at first.
  const protocol::LocalState* contacts = nullptr;  ///< Latest contacts, null without telemetry.
  const FrameResult& result;
  const LiveSettings& settings;
  bool held = false;  ///< A page holds the hand.
  /// Why the server gives no session; empty in one, and before it has said.
  std::optional<protocol::Reject> rejected{};
  std::string recording{};  ///< Name of the latest flight recording; empty: none is known here.
};
std::string frame_message(const FrameView& view);

std::string refused_message(const std::string& field, const std::string& value,
                            const std::string& text);

/// Rows of consecutive steps: a float32 for each of kTickColumns, after a header of 16 bytes.
class TickBatch {
 public:
  void add(const protocol::Ticks& ticks);
  bool empty() const { return count_ == 0; }
  /// Whether these ticks follow those that are in it.
  bool continues(const protocol::Ticks& ticks) const {
    return count_ == 0 || ticks.first_step == first_step_ + count_;
  }
  /// The message, and none is left.
  std::string take();

 private:
  std::uint64_t first_step_ = 0;
  std::uint64_t count_ = 0;
  std::string rows_;
};

}  // namespace hlm::ve
