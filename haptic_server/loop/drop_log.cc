#include "hlm/loop/drop_log.h"

#include <cstddef>
#include <string>

#include <spdlog/fmt/fmt.h>

namespace hlm::server {

void DropLog::observe(const TickRecord& record) {
  constexpr double kPeriod = 1;  // s.
  if (record.time < next_) return;
  std::string fresh;
  for (auto i = static_cast<std::size_t>(protocol::kFirstSealingReason); i < logged_.size(); ++i) {
    const std::uint64_t count = record.dropped_for[i] - logged_[i];
    if (count == 0) continue;
    const auto reason = static_cast<protocol::DropReason>(i);
    fresh += fmt::format("{}{} {} ({})", fresh.empty() ? "" : ", ", count, name_of(reason),
                         meaning_of(reason));
    logged_[i] = record.dropped_for[i];
  }
  if (fresh.empty()) return;
  log_event(now_, record, spdlog::level::warn, "dropped datagrams: " + fresh);
  next_ = record.time + kPeriod;
}

}  // namespace hlm::server
