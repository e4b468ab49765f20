#include "hlm/protocol/scene_stream.h"

#include <algorithm>
#include <cassert>

namespace hlm::protocol {
namespace {

bool has_bit(const std::array<std::uint64_t, kSceneWindow / 64>& bits, std::size_t index) noexcept {
  return ((bits[index / 64] >> (index % 64)) & 1u) != 0;
}

bool says_came(const SceneState& state, std::uint64_t number) noexcept {
  if (number < state.next) return true;
  return number - state.next < kSceneWindow && has_bit(state.bitmap, number - state.next);
}

}  // namespace

void SceneReceiver::restart() noexcept {
  held_ = {};
  next_ = 0;
  has_begun_ = false;
}

bool SceneReceiver::holds(std::uint64_t number) const noexcept {
  return has_bit(held_, slot(number));
}

std::optional<DropReason> SceneReceiver::take(const SceneChunk& chunk) noexcept {
  if (chunk.number < next_) return DropReason::kStale;
  if (chunk.number - next_ >= kSceneWindow || chunk.data.empty()) return DropReason::kMalformed;
  if (holds(chunk.number)) return DropReason::kStale;
  const std::size_t at = slot(chunk.number);
  data_[at].resize(chunk.data.size(), boost::container::default_init);
  std::ranges::copy(chunk.data, data_[at].begin());
  held_[at / 64] |= std::uint64_t{1} << (at % 64);
  has_begun_ = true;
  return std::nullopt;
}

std::span<const std::byte> SceneReceiver::front() const noexcept {
  if (!holds(next_)) return {};
  const ChunkData& data = data_[slot(next_)];
  return {data.data(), data.size()};
}

void SceneReceiver::pop() noexcept {
  assert(holds(next_));
  const std::size_t at = slot(next_);
  held_[at / 64] &= ~(std::uint64_t{1} << (at % 64));
  ++next_;
}

void SceneReceiver::describe(SceneState& state) const noexcept {
  state.next = next_;
  state.bitmap = {};
  for (std::size_t i = 0; i < kSceneWindow; ++i) {
    if (holds(next_ + i)) state.bitmap[i / 64] |= std::uint64_t{1} << (i % 64);
  }
}

void SceneSender::restart() noexcept {
  chunks_.clear();
  first_ = 0;
  under_way_ = waiting_ = 0;
  pace_ = {};
  sent_ = repeated_ = 0;
}

bool SceneSender::queue(std::span<const std::uint8_t> bytes) {
  if (bytes.size() > kMostQueued - waiting_) return false;
  waiting_ += bytes.size();
  const auto all = std::as_bytes(bytes);
  for (std::size_t taken = 0; taken < all.size();) {
    const bool has_open =
        chunks_.size() > under_way_ && chunks_.back().message.data.size() < kChunkSize;
    if (!has_open) {
      const std::uint64_t number = first_ + chunks_.size();
      chunks_.emplace_back().message.number = number;
    }
    ChunkData& data = chunks_.back().message.data;
    const auto part = all.subspan(taken, std::min(all.size() - taken, kChunkSize - data.size()));
    data.insert(data.end(), part.begin(), part.end());
    taken += part.size();
  }
  return true;
}

/// How many chunks may be sent in this call; marks those that were not heard of for too long.
std::size_t SceneSender::begin(double now, std::size_t budget) noexcept {
  checked_ = 0;
  const std::size_t room = pace_.begin(now, budget);
  bool any = false;
  for (std::size_t i = 0; i < under_way_; ++i) {
    Chunk& chunk = chunks_[i];
    if (chunk.has_come || chunk.is_lost || !pace_.is_late(now, chunk.sent_at)) continue;
    chunk.is_lost = any = true;
  }
  if (any) pace_.lose(now, true);
  return room;
}

/// The chunk to be sent next, counted as sent; null if there is none.
const SceneChunk* SceneSender::next(double now) noexcept {
  while (checked_ < under_way_ && !chunks_[checked_].is_lost) ++checked_;
  const bool is_new = checked_ == under_way_;
  if (is_new && (under_way_ == chunks_.size() || under_way_ == kSceneWindow)) return nullptr;
  if (is_new) ++under_way_;
  Chunk& chunk = chunks_[checked_++];
  chunk.was_repeated = !is_new;
  chunk.is_lost = false;
  chunk.sent_at = now;
  ++sent_;
  if (!is_new) ++repeated_;
  return &chunk.message;
}

bool SceneSender::receive(double now, const SceneState& state) noexcept {
  if (state.next > first_ + under_way_) return false;
  for (std::size_t i = 0; i < under_way_; ++i) {
    Chunk& chunk = chunks_[i];
    if (chunk.has_come || !says_came(state, first_ + i)) continue;
    chunk.has_come = true;
    chunk.is_lost = false;
    pace_.arrived(now, chunk.sent_at, chunk.was_repeated);
  }
  for (; first_ < state.next; ++first_, --under_way_) {
    waiting_ -= chunks_.front().message.data.size();
    chunks_.pop_front();
  }
  bool any = false;
  for (std::size_t i = 0; i < under_way_; ++i) {
    Chunk& chunk = chunks_[i];
    if (chunk.has_come || chunk.is_lost || !pace_.is_overtaken(chunk.sent_at)) continue;
    chunk.is_lost = any = true;
  }
  if (any) pace_.lose(now, false);
  return true;
}

}  // namespace hlm::protocol
