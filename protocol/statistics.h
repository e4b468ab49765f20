// What was received, and what was dropped for which reason.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "hlm/common/vocabulary.h"

namespace hlm::protocol {

enum class DropReason : std::uint8_t {
  kTruncated,
  kNotOurs,
  kVersion,
  kMalformed,
  kNonFinite,
  kForeignSession,
  kStale,
  kIncomplete,
  kUnexpected,
  kSealed,
  kUnsealed,
  kWrongKey,
  kAltered,
  kReplayed,
  kTooOld,
  kHandshakeRate,
};

/// First of the reasons that are about seals and keys.
inline constexpr DropReason kFirstSealingReason = DropReason::kSealed;

}  // namespace hlm::protocol

namespace hlm {

template <>
inline constexpr std::array<Word<protocol::DropReason>, 16> kWords<protocol::DropReason>{{
    {protocol::DropReason::kTruncated, "truncated",
     "shorter than its header or its length says, or longer than allowed"},
    {protocol::DropReason::kNotOurs, "not ours", "another magic"},
    {protocol::DropReason::kVersion, "version", "another version"},
    {protocol::DropReason::kMalformed, "malformed",
     "a field out of its range, or a length that does not fit the contents"},
    {protocol::DropReason::kNonFinite, "non-finite", "a number that is not finite"},
    {protocol::DropReason::kForeignSession, "foreign session",
     "another session's id, or from another peer"},
    {protocol::DropReason::kStale, "stale", "not newer than what was taken before"},
    {protocol::DropReason::kIncomplete, "incomplete",
     "a part whose message was overtaken by a newer one"},
    {protocol::DropReason::kUnexpected, "unexpected", "a message that this side never takes"},
    {protocol::DropReason::kSealed, "sealed", "sealed with a key, and this side has none"},
    {protocol::DropReason::kUnsealed, "unsealed", "not sealed, from a sender without a key"},
    {protocol::DropReason::kWrongKey, "wrong key", "a handshake with another key, or altered"},
    {protocol::DropReason::kAltered, "altered", "sealed with another key, or altered under way"},
    {protocol::DropReason::kReplayed, "replayed", "a copy of what was taken before"},
    {protocol::DropReason::kTooOld, "too old", "sealed too long ago to tell whether it is a copy"},
    {protocol::DropReason::kHandshakeRate, "handshake rate", "more handshakes than are answered"},
}};

}  // namespace hlm

namespace hlm::protocol {

inline constexpr std::size_t kDropReasons = kWords<DropReason>.size();

struct ReceiveStatistics {
  std::uint64_t datagrams = 0;
  std::array<std::uint64_t, kDropReasons> dropped{};

  void drop(DropReason reason, std::uint64_t count = 1) noexcept {
    dropped[static_cast<std::size_t>(reason)] += count;
  }
  std::uint64_t count(DropReason reason) const noexcept {
    return dropped[static_cast<std::size_t>(reason)];
  }
  std::uint64_t total_dropped() const noexcept {
    std::uint64_t sum = 0;
    for (const std::uint64_t count : dropped) sum += count;
    return sum;
  }
};

/// A sentence such as "3 dropped (2 stale, 1 malformed)", or "0 dropped". `dropped`: by DropReason.
std::string describe_drops(const std::array<std::uint64_t, kDropReasons>& dropped);

}  // namespace hlm::protocol
