// Which scene the session has, and whether contacts are found in it.
#pragma once

#include <cstdint>
#include <optional>

#include "hlm/haptic_server/local_model/local_model.h"
#include "hlm/haptic_server/loop/clocks.h"
#include "hlm/haptic_server/report/tick_record.h"
#include "hlm/haptic_server/scene/source.h"
#include "hlm/protocol/server_session.h"

namespace hlm::server {

/// Scene state of a tick, recorded for replay.
struct SceneExchange {
  std::uint32_t number = 0;  ///< Number of the scene in force, 0 none.
  std::uint32_t chunks = 0;  ///< Chunks of the scene stream that were handed on.

  bool operator==(const SceneExchange&) const = default;
};

/// Without a source nothing happens: clients send contacts.
class SceneUse {
 public:
  /// source: null: clients send no scenes.
  explicit SceneUse(SceneSource* source) noexcept : source_(source) {}

  bool offered() const noexcept { return source_ != nullptr; }
  /// A session with such a tool begins.
  void begin(const ToolDescription& tool) noexcept;
  /// A tick: forwards new chunks of the scene stream and adopts the newest scene. Drops one that
  /// takes too long.
  void load(const protocol::ServerSession::Inbox& inbox, protocol::ServerSession& link,
            std::optional<LocalModel>& model, Clocks& clocks, const Timing& timing) noexcept;
  /// Whether contacts are found in the scene, or are those that the environment reports. Those of
  /// one that is dropped stay as they are until others come.
  void use(bool wanted, std::optional<LocalModel>& model, Clocks& clocks) noexcept;
  /// What has become of the stream goes to the client.
  void acknowledge(double now, protocol::ServerSession& link) noexcept;

  /// Number of the scene in force; 0 if there is none.
  std::uint32_t number() const noexcept { return source_ != nullptr ? source_->number() : 0; }
  /// Fills in the record's scene, if there is one.
  void describe(const LocalModel& model, TickRecord& record) const noexcept;
  /// The scene state of the latest tick.
  const SceneExchange& exchange() const noexcept { return exchange_; }

 private:
  SceneSource* source_;
  Scene* scene_ = nullptr;  ///< The newest of the session.
  bool wanted_ = false;     ///< The latest update leaves its contacts to a scene.
  SceneExchange exchange_;
};

}  // namespace hlm::server
