// What was received, and what was dropped for which reason.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace hlm::protocol {

enum class DropReason : std::uint8_t {
  kTruncated,       ///< Shorter than its header or its length field says, or longer than allowed.
  kNotOurs,         ///< Wrong magic.
  kVersion,         ///< Another version.
  kMalformed,       ///< A field out of its range, or a length that does not fit the contents.
  kNonFinite,       ///< A number that is not finite.
  kForeignSession,  ///< Not the session's id or not its peer.
  kStale,           ///< Not newer than what was taken before; duplicates too.
  kIncomplete,      ///< A part whose message was overtaken by a newer one.
  kUnexpected,      ///< A message that this side never takes.
};
inline constexpr std::size_t kDropReasons = 9;

/// The field's name in reports, for example "foreign session".
std::string_view name(DropReason reason) noexcept;

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

/// For example "3 dropped (2 stale, 1 malformed)", or "0 dropped". `dropped`: counts by DropReason.
std::string describe_drops(const std::array<std::uint64_t, kDropReasons>& dropped);

}  // namespace hlm::protocol
