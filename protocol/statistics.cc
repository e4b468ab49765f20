#include "hlm/protocol/statistics.h"

namespace hlm::protocol {

std::string describe_drops(const std::array<std::uint64_t, kDropReasons>& dropped) {
  std::uint64_t total = 0;
  std::string reasons;
  for (std::size_t i = 0; i < kDropReasons; ++i) {
    if (dropped[i] == 0) continue;
    total += dropped[i];
    reasons += (reasons.empty() ? " (" : ", ") + std::to_string(dropped[i]) + ' ';
    reasons += name_of(static_cast<DropReason>(i));
  }
  return std::to_string(total) + " dropped" + (reasons.empty() ? "" : reasons + ')');
}

}  // namespace hlm::protocol
