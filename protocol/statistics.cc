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

}  // namespace hlm::protocol
