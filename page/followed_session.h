// A session of another program, as far as that tells of it (client/page_wire.h), and what a page is
// shown of it.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "hlm/client/page_wire.h"
#include "hlm/page/page_messages.h"
#include "hlm/protocol/client_session.h"
#include "hlm/protocol/scene_records.h"

namespace hlm::ve {

class FollowedSession {
 public:
  /// Telemetry goes on to this, its bodies by their places in world().
  explicit FollowedSession(protocol::TelemetryObserver& telemetry) : telemetry_(telemetry) {}

  /// A packet of the session. What this version does not understand is left out.
  void take(std::span<const std::byte> packet);

  /// Whether there is a tool to be shown.
  bool has_tool() const noexcept { return !tool_.description.links.empty(); }
  /// Whether world() is another one since the last call.
  bool world_changed() noexcept { return std::exchange(world_changed_, false); }
  /// The tool's links, the world, and the bodies that have been somewhere.
  PageWorld world() const;
  /// What has come since the last one. Its state is valid until the next packet.
  PageFrame frame();
  /// A session of the server has begun since the last call: with this.
  std::optional<protocol::Welcome> take_welcome() { return std::exchange(begun_, std::nullopt); }

 private:
  void take_message(std::span<const std::byte> bytes);
  template <class Message>
  void take_as(std::span<const protocol::DatagramBytes> parts);
  void take(const protocol::Hello& hello);
  void take(const protocol::Welcome& welcome);
  void take(const protocol::Reject& reject) { rejected_ = reject; }
  void take(const protocol::ProxyState& state) { state_ = state; }
  void take(const protocol::ContactUpdate& update);
  void take(const protocol::Ticks& ticks) { telemetry_.observe(ticks); }
  void take(protocol::LocalState state);
  void begin_scene();
  void take_scene(std::span<const std::byte> records);
  void end_scene();

  std::vector<PageShape> shapes_of(SideKind kind, std::uint32_t index) const;
  std::vector<PageShape> stand_in() const;
  /// Place of a body in world().
  std::optional<std::uint32_t> place_of(std::uint32_t body) const;

  protocol::TelemetryObserver& telemetry_;
  PageTool tool_;
  double epsilon_ = 0;
  page_wire::Status status_;
  std::optional<protocol::Welcome> welcome_;
  std::optional<protocol::Welcome> begun_;
  std::optional<protocol::Reject> rejected_;
  std::optional<protocol::ProxyState> state_;
  std::vector<Pose> X_WL_;                         ///< Of the tool's links.
  std::map<std::uint32_t, Pose> X_WB_;             ///< Of bodies, by their numbers.
  std::size_t reported_ = 0;                       ///< Contacts of the tool in the latest update.
  protocol::SceneRecordReader reader_;             ///< Of the scene that is coming.
  std::map<std::uint64_t, PageShape> geometries_;  ///< By their hashes.
  std::vector<protocol::ScenePlacement> coming_;
  std::map<std::uint64_t, PageShape> coming_geometries_;
  std::vector<protocol::ScenePlacement> placements_;
  bool world_changed_ = false;
};

}  // namespace hlm::ve
