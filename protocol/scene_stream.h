// The scene stream: bytes in order from client to server over datagrams that get lost, in numbered
// chunks that are sent again until they have come. What the bytes say is in scene_records.h.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>

#include "hlm/protocol/messages.h"
#include "hlm/protocol/scene_pace.h"
#include "hlm/protocol/statistics.h"

namespace hlm::protocol {

/// The server's end, in one session: a window of chunks, in whatever order they come. Nothing
/// allocates, waits or throws.
class SceneReceiver {
 public:
  /// A new session: its stream begins with chunk 0.
  void restart() noexcept;
  /// Keeps a chunk until it is consumed. Returns why it is dropped: stale if it has come before,
  /// malformed if it lies beyond the window, where no client is.
  std::optional<DropReason> take(const SceneChunk& chunk) noexcept;

  /// The data of the next chunk in order; empty if it has not come. Valid until the next call.
  std::span<const std::byte> front() const noexcept;
  /// The next chunk has been used. There must be one.
  void pop() noexcept;
  /// Fills in what has come: `next` and `bitmap`.
  void describe(SceneState& state) const noexcept;
  /// Whether a chunk has come since restart().
  bool has_begun() const noexcept { return has_begun_; }

 private:
  std::size_t slot(std::uint64_t number) const noexcept { return number % kSceneWindow; }
  bool holds(std::uint64_t number) const noexcept;

  std::array<ChunkData, kSceneWindow> data_;
  std::array<std::uint64_t, kSceneWindow / 64> held_{};  ///< One bit for each slot.
  std::uint64_t next_ = 0;                               ///< The first chunk not consumed.
  bool has_begun_ = false;
};

/// The client's end, in one session: what waits and what is under way. queue() allocates, the
/// others do not. Times are in s, of any steady origin.
class SceneSender {
 public:
  /// Most bytes that may wait or be under way.
  static constexpr std::size_t kMostQueued = std::size_t{64} << 20u;

  /// A new session: forgets all that was queued.
  void restart() noexcept;
  /// Appends to the stream. False, with nothing appended, if more than kMostQueued would wait.
  [[nodiscard]] bool queue(std::span<const std::uint8_t> bytes);

  /// Hands at most `budget` chunks to `send(const SceneChunk&)`: those that were lost, then new
  /// ones, as the server's window has room; fewer after losses (ScenePace). Returns how many.
  template <class Send>
  std::size_t send(double now, std::size_t budget, Send send) {
    const std::size_t room = begin(now, budget);
    for (std::size_t sent = 0; sent < room; ++sent) {
      const SceneChunk* const chunk = next(now);
      if (chunk == nullptr) return sent;
      send(*chunk);
    }
    return room;
  }
  /// What the server says of the chunks. False, and nothing done, if it has taken chunks that were
  /// not sent. A state that is older than one before does no harm.
  bool receive(double now, const SceneState& state) noexcept;

  /// Bytes that the server has not taken.
  std::size_t waiting() const noexcept { return waiting_; }
  /// Number of the first chunk that the server has not taken.
  std::uint64_t first() const noexcept { return first_; }
  const ScenePace& pace() const noexcept { return pace_; }
  /// Chunks sent in this session, and how many of these had been sent before.
  std::uint64_t sent() const noexcept { return sent_; }
  std::uint64_t repeated() const noexcept { return repeated_; }

 private:
  struct Chunk {
    SceneChunk message;
    double sent_at = 0;  ///< The latest time, s.
    bool was_repeated = false;
    bool has_come = false;
    bool is_lost = false;
  };

  std::size_t begin(double now, std::size_t budget) noexcept;
  const SceneChunk* next(double now) noexcept;

  std::deque<Chunk> chunks_;  ///< From chunk `first_` on.
  std::uint64_t first_ = 0;
  std::size_t under_way_ = 0;  ///< Chunks at the front that were sent, at most kSceneWindow.
  std::size_t waiting_ = 0;
  std::size_t checked_ = 0;  ///< Chunks that this call has looked at.
  ScenePace pace_;
  std::uint64_t sent_ = 0;
  std::uint64_t repeated_ = 0;
};

}  // namespace hlm::protocol
