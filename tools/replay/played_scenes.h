// The scenes of a recording, each in force from the tick on from which it was.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "hlm/haptic_server/loop/servo.h"
#include "hlm/haptic_server/scene/loader.h"
#include "hlm/haptic_server/scene/source.h"
#include "hlm/protocol/scene_records.h"

namespace hlm::server {

/// One thread; allocates and throws nothing back. A loader reads as much as has come when it looks:
/// which commits become scenes is its thread's doing, and so is when. Here the notes say it.
class PlayedScenes final : public SceneSource {
 public:
  /// What was noted of the next tick.
  void set(const SceneExchange& noted) noexcept;
  /// The stream of the session that began last, as far as it is known, where no note says when the
  /// servo handed it on.
  void give(std::span<const std::byte> stream);

  void begin(const ToolDescription& tool) noexcept override;
  bool take(std::span<const std::byte> bytes) noexcept override;
  Scene* poll() noexcept override;
  std::uint32_t number() const noexcept override {
    return noted_.number == 0 ? 0 : loader_.number();
  }
  void drop(const geometry::FinderCut&) noexcept override {}  // The notes say when.
  protocol::SceneState state() noexcept override { return loader_.state(); }

  /// The first scene of the session that was in force then and cannot be made now, and why; empty
  /// if there is none.
  const std::string& missing() const noexcept { return missing_; }

 private:
  struct Chunk {
    std::vector<std::byte> bytes;
    std::uint32_t commit = 0;  ///< Number of the last commit that ends in it; 0: none does.
  };

  void keep(std::span<const std::byte> bytes);
  void make(std::uint32_t number);

  SceneLoader loader_;
  SceneExchange noted_;
  std::optional<protocol::SceneRecordReader> reader_;
  std::deque<Chunk> chunks_;  ///< Those that the loader has not got.
  std::string missing_;
};

}  // namespace hlm::server
