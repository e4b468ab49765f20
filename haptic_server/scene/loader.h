// Makes scenes of what a session's scene stream brings, beside the loop.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include <boost/lockfree/spsc_queue.hpp>

#include "hlm/common/latest_value.h"
#include "hlm/common/tool_description.h"
#include "hlm/haptic_server/scene/maker.h"
#include "hlm/haptic_server/scene/scene.h"
#include "hlm/haptic_server/scene/source.h"
#include "hlm/protocol/messages.h"
#include "hlm/protocol/scene_store.h"

namespace hlm::server {

/// What passes between the loop and the loader, and what that works on.
namespace loading {

struct Session {
  std::uint64_t number = 0;
  ToolDescription tool;
};
struct Chunk {
  std::uint64_t session = 0;
  std::size_t size = 0;
  std::array<std::byte, protocol::kChunkSize> bytes;
};
struct Progress {
  std::uint64_t session = 0;
  protocol::SceneState state = {};
};

}  // namespace loading

/// Two threads share it: the loop, which never waits or allocates here, and one that reads, which
/// makes the scenes too (work()), or has others make them (next_order(), finish()). At most two
/// scenes exist: the one in force and the next.
class SceneLoader final : public SceneSource {
 public:
  SceneLoader();
  ~SceneLoader() override;
  SceneLoader(const SceneLoader&) = delete;
  SceneLoader& operator=(const SceneLoader&) = delete;

  // For the loop.
  void begin(const ToolDescription& tool) noexcept override;
  bool take(std::span<const std::byte> bytes) noexcept override;
  Scene* poll() noexcept override;
  std::uint32_t number() const noexcept override { return is_usable() ? in_force_->number : 0; }
  void drop(const geometry::FinderCut& left_out) noexcept override {
    is_dropped_ = true;
    left_out_ = left_out;
  }
  protocol::SceneState state() noexcept override;

  // For the other thread, which may also be the loop's own in virtual time.
  /// Reads what has come, and makes the newest scene of it.
  void work();
  /// Reads it, and leaves its scene to the next work(): what is read meanwhile may replace it.
  void read();
  /// What of the scenes that were read is to be made, once: the newest.
  std::optional<SceneOrder> next_order();
  /// What came of such an order. Of a session that is over it counts no more.
  void finish(SceneOutcome outcome);
  /// The session whose stream is read.
  std::uint64_t reads() const noexcept { return reading_.number; }

 private:
  using Session = loading::Session;
  using Chunk = loading::Chunk;
  using Made = MadeScene;
  using Progress = loading::Progress;

  /// Whether another session has begun than the one whose stream is read.
  bool is_over() const noexcept {
    return begun_number_.load(std::memory_order_acquire) != reading_.number;
  }
  bool is_usable() const noexcept {
    return in_force_ && in_force_->session == session_ && !is_dropped_;
  }
  void begin_reading();
  void keep_commit();
  void read_chunk(std::span<const std::byte> bytes);
  void refuse(protocol::SceneFault fault);
  void say();

  // The loop's.
  std::uint64_t session_ = 0;
  std::unique_ptr<Made> in_force_;
  bool is_dropped_ = false;         ///< That one is used no more.
  geometry::FinderCut left_out_{};  ///< Why, if it never was used.

  // Between the two.
  LatestValue<Session> begun_;
  std::atomic<std::uint64_t> begun_number_ = 0;
  boost::lockfree::spsc_queue<Chunk> chunks_;
  std::atomic<Made*> made_ = nullptr;   ///< The next scene.
  std::atomic<Made*> spent_ = nullptr;  ///< One that the loop has given back.
  LatestValue<Progress> progress_;

  // The other thread's.
  Session reading_;
  std::optional<protocol::SceneRecordReader> reader_;
  std::optional<protocol::SceneStore> store_;
  bool commits_ = false;             ///< The record read last was a commit.
  std::optional<SceneOrder> order_;  ///< By the latest one, as long as nobody has taken it.
  SceneMaker maker_;                 ///< Of work().
};

}  // namespace hlm::server
