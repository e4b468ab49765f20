#include "hlm/protocol/assembler.h"

#include <bit>

namespace hlm::protocol {

namespace {

static_assert(kMaxParts <= 64, "one bit of arrived_ per part");

std::uint64_t bit_of(const Header& header) noexcept { return std::uint64_t{1} << header.part; }

}  // namespace

std::optional<DropReason> Assembler::judge(const Header& header) const noexcept {
  const std::uint64_t sequence = header.envelope.sequence;
  if (sequence == refused_) return DropReason::kMalformed;
  if (sequence < newest_ || sequence <= accepted_) return DropReason::kStale;
  if (sequence > newest_) return std::nullopt;
  if (header.parts != parts_) return DropReason::kMalformed;
  if (arrived_ & bit_of(header)) return DropReason::kStale;
  return std::nullopt;
}

std::optional<DropReason> Assembler::add(const Header& header, std::span<const std::byte> bytes,
                                         ReceiveStatistics& statistics) noexcept {
  if (const auto reason = judge(header)) return reason;
  if (header.envelope.sequence > newest_) {
    discard_incomplete(statistics);
    newest_ = header.envelope.sequence;
    parts_ = header.parts;
    arrived_ = 0;
  }
  copy(bytes, bytes_[header.part]);
  arrived_ |= bit_of(header);
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
