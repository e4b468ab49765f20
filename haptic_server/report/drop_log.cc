#include "hlm/haptic_server/report/drop_log.h"

#include <cstddef>
#include <string>

#include <spdlog/fmt/fmt.h>

namespace hlm::server {
namespace {

/// What networks do to good datagrams.
bool is_usual(protocol::DropReason reason) {
  return reason == protocol::DropReason::kStale || reason == protocol::DropReason::kIncomplete;
}

}  // namespace

void DropLog::observe(const TickRecord& record) {
  constexpr double kPeriod = 1;  // s.
  if (record.time < next_) return;
  std::string fresh;
  for (std::size_t i = 0; i < logged_.size(); ++i) {
    const std::uint64_t count = record.dropped_for[i] - logged_[i];
    const auto reason = static_cast<protocol::DropReason>(i);
    if (count == 0 || is_usual(reason)) continue;
    fresh += fmt::format("{}{} {} ({})", fresh.empty() ? "" : ", ", count, name_of(reason),
                         meaning_of(reason));
    logged_[i] = record.dropped_for[i];
  }
  if (fresh.empty()) return;
  log_event(now_, record, spdlog::level::warn, "dropped datagrams: " + fresh);
  next_ = record.time + kPeriod;
}

}  // namespace hlm::server
