#include "protocol/assembler.h"

#include <bit>

namespace hlm::protocol {

static_assert(kMaxParts <= 64, "one bit of arrived_ per part");

std::optional<DropReason> Assembler::add(const Header& header, std::span<const std::byte> bytes,
                                         ReceiveStatistics& statistics) noexcept {
  const std::uint64_t sequence = header.envelope.sequence;
  const std::uint64_t bit = std::uint64_t{1} << header.part;
  if (sequence == refused_) return DropReason::kMalformed;
  if (is_stale(header)) return DropReason::kStale;
  if (sequence > newest_) {
    discard_incomplete(statistics);
    newest_ = sequence;
    parts_ = header.parts;
    arrived_ = 0;
  }
  if (header.parts != parts_) return DropReason::kMalformed;
  if (arrived_ & bit) return DropReason::kStale;
  copy(bytes, bytes_[header.part]);
  arrived_ |= bit;
  return std::nullopt;
}

void Assembler::refuse(std::uint64_t sequence, ReceiveStatistics& statistics) noexcept {
  refused_ = sequence;
  if (newest_ != sequence) return;
  discard_incomplete(statistics);
  newest_ = accepted_;
  parts_ = 0;
  arrived_ = 0;
}

void Assembler::restart(ReceiveStatistics& statistics) noexcept {
  discard_incomplete(statistics);
  accepted_ = newest_ = refused_ = 0;
  parts_ = 0;
  arrived_ = 0;
}

std::size_t Assembler::arrived_count() const noexcept {
  return static_cast<std::size_t>(std::popcount(arrived_));
}

void Assembler::discard_incomplete(ReceiveStatistics& statistics) noexcept {
  if (!complete()) statistics.drop(DropReason::kIncomplete, arrived_count());
}

}  // namespace hlm::protocol
