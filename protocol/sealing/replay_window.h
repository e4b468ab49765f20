// Which of a sender's counters were taken: each once, in any order within a window.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "hlm/protocol/statistics.h"

namespace hlm::protocol {

/// The sliding window of RFC 6479: a ring of blocks of bits, one block more than the window is
/// wide, so that it moves on by whole blocks.
class ReplayWindow {
 public:
  /// Counters at most this far behind the largest are still taken. Wider lets datagrams be
  /// reordered more; at a thousand datagrams a second this is a second.
  static constexpr std::uint64_t kWidth = 1024;

  /// Why a datagram with that counter must not be taken.
  std::optional<DropReason> judge(std::uint64_t counter) const noexcept {
    if (counter >= next_) return std::nullopt;
    if (next_ - counter > kWidth) return DropReason::kTooOld;
    if ((block(counter) & bit(counter)) != 0) return DropReason::kReplayed;
    return std::nullopt;
  }

  /// A datagram with that counter, which judge() lets pass, was taken: only now that it opened.
  void mark(std::uint64_t counter) noexcept {
    if (counter >= next_) {
      const std::uint64_t newest = next_ == 0 ? 0 : (next_ - 1) / kBits;
      const std::uint64_t passed = counter / kBits - newest;
      for (std::uint64_t i = 1; i <= passed && i <= kBlocks; ++i) {
        blocks_[(newest + i) % kBlocks] = 0;
      }
      next_ = counter + 1;
    }
    blocks_[counter / kBits % kBlocks] |= bit(counter);
  }

 private:
  static constexpr std::uint64_t kBits = 64;
  static constexpr std::uint64_t kBlocks = kWidth / kBits + 1;

  static std::uint64_t bit(std::uint64_t counter) noexcept {
    return std::uint64_t{1} << counter % kBits;
  }
  std::uint64_t block(std::uint64_t counter) const noexcept {
    return blocks_[counter / kBits % kBlocks];
  }

  std::uint64_t next_ = 0;  ///< One more than the largest that was taken.
  std::array<std::uint64_t, kBlocks> blocks_{};
};

}  // namespace hlm::protocol
