// Where the servo's scenes come from: a loader beside it, or a recording.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "hlm/common/tool_description.h"
#include "hlm/haptic_server/scene/scene.h"
#include "hlm/protocol/messages.h"

namespace hlm::server {

/// The loop's side of it.
class SceneSource {
 public:
  virtual ~SceneSource() = default;

  /// A session begins: what was brought for another counts no more.
  virtual void begin(const ToolDescription& tool) noexcept = 0;
  /// More of the session's stream. False if there is no room now: come again with it.
  virtual bool take(std::span<const std::byte> bytes) noexcept = 0;
  /// The session's newest scene, or null. The one that this returned before is gone then, if it was
  /// another one.
  virtual Scene* poll() noexcept = 0;
  /// Number of that scene; 0 if there is none.
  virtual std::uint32_t number() const noexcept = 0;
  /// The session's newest scene takes too long: there is none until a newer one is made. left_out:
  /// what there is no time for where the tool is now; nothing: its ticks were late.
  virtual void drop(const geometry::FinderCut& left_out) noexcept = 0;
  /// What has become of the stream, except what ServerSession fills in.
  virtual protocol::SceneState state() noexcept = 0;
};

}  // namespace hlm::server
