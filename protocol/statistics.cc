#include "protocol/statistics.h"

namespace hlm::protocol {

std::string_view name(DropReason reason) noexcept {
  switch (reason) {
    case DropReason::kTruncated:
      return "truncated";
    case DropReason::kNotOurs:
      return "not ours";
    case DropReason::kVersion:
      return "version";
    case DropReason::kMalformed:
      return "malformed";
    case DropReason::kNonFinite:
      return "non-finite";
    case DropReason::kForeignSession:
      return "foreign session";
    case DropReason::kStale:
      return "stale";
    case DropReason::kIncomplete:
      return "incomplete";
    case DropReason::kUnexpected:
      return "unexpected";
  }
  return "unknown";
}

std::string describe_drops(const std::array<std::uint64_t, kDropReasons>& dropped) {
  std::uint64_t total = 0;
  std::string reasons;
  for (std::size_t i = 0; i < kDropReasons; ++i) {
    if (dropped[i] == 0) continue;
    total += dropped[i];
    reasons += (reasons.empty() ? " (" : ", ") + std::to_string(dropped[i]) + ' ';
    reasons += name(static_cast<DropReason>(i));
  }
  return std::to_string(total) + " dropped" + (reasons.empty() ? "" : reasons + ')');
}

}  // namespace hlm::protocol
