// Puts the parts of a message together, in whatever order they come: whole or not at all, and only
// the latest message.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "hlm/protocol/codec.h"
#include "hlm/protocol/statistics.h"

namespace hlm::protocol {

/// Assembles the messages of one sender in one session. Never allocates or throws.
class Assembler {
 public:
  /// Why a part is to be dropped, whatever its contents; empty if it is wanted.
  std::optional<DropReason> judge(const Header& header) const noexcept;
  /// Adds a part that was found good (decode_part()). Returns why it is dropped, as judge() does;
  /// empty if it was added. A part of a newer message discards an incomplete older one, whose parts
  /// are counted as incomplete.
  std::optional<DropReason> add(const Header& header, std::span<const std::byte> bytes,
                                ReceiveStatistics& statistics) noexcept;
  /// The complete message is used: only newer ones count from here on.
  void accept() noexcept { accepted_ = newest_; }
  /// The message of this sequence, complete or not, cannot be used: it leaves no trace, and no part
  /// of it counts any more. Parts of it that wait for others are counted as incomplete.
  void refuse(std::uint64_t sequence, ReceiveStatistics& statistics) noexcept;
  /// Forgets everything: the next message may have any sequence.
  void restart(ReceiveStatistics& statistics) noexcept;

  /// Whether a part of the message of this sequence has come, and it is the latest.
  bool holds(std::uint64_t sequence) const noexcept { return parts_ > 0 && newest_ == sequence; }
  /// Whether all parts of the latest message have come.
  bool complete() const noexcept { return parts_ > 0 && arrived_count() == parts_; }
  /// All parts in order, if complete().
  std::span<const DatagramBytes> parts() const noexcept { return {bytes_.data(), parts_}; }

 private:
  std::size_t arrived_count() const noexcept;
  void discard_incomplete(ReceiveStatistics& statistics) noexcept;

  std::array<DatagramBytes, kMaxParts> bytes_;
  std::uint64_t accepted_ = 0;  ///< Sequence of the latest message that was used.
  std::uint64_t newest_ = 0;    ///< Sequence of the latest message of which a part has come.
  std::uint64_t refused_ = 0;   ///< Sequence of the latest message that was refused.
  std::size_t parts_ = 0;
  std::uint64_t arrived_ = 0;  ///< Bit i: part i has come.
};

}  // namespace hlm::protocol
