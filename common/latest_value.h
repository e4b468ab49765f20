// The latest value that one thread leaves for another.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace hlm {

/// A triple buffer: one thread puts, one other reads, neither waits nor allocates, and a value is
/// never seen half written. Values in between are lost. An age needs a time in the value.
template <class Value>
class LatestValue {
 public:
  /// Puts a value, from the writing thread.
  void put(const Value& value) noexcept {
    slots_[writing_] = value;
    const std::uint8_t before =
        middle_.exchange(static_cast<std::uint8_t>(writing_ | kFresh), std::memory_order_acq_rel);
    writing_ = before & kSlot;
  }
  /// The value put last, from the reading thread; Value{} before that. Valid until the next call.
  const Value& get() noexcept {
    if ((middle_.load(std::memory_order_relaxed) & kFresh) != 0) {
      reading_ =
          middle_.exchange(static_cast<std::uint8_t>(reading_), std::memory_order_acq_rel) & kSlot;
    }
    return slots_[reading_];
  }

 private:
  static constexpr std::uint8_t kSlot = 3;
  static constexpr std::uint8_t kFresh = 4;  ///< The reader has not seen the middle slot.
  static_assert(std::atomic<std::uint8_t>::is_always_lock_free);

  std::array<Value, 3> slots_{};
  std::atomic<std::uint8_t> middle_ = 1;  ///< The slot that nobody uses, and whether it is fresh.
  std::size_t writing_ = 0;               ///< Slot of the writing thread.
  std::size_t reading_ = 2;               ///< Slot of the reading thread.
};

}  // namespace hlm
