#include "hlm/haptic_server/report/run_summary.h"

#include <algorithm>

#include <spdlog/fmt/fmt.h>

namespace hlm::server {
namespace {

constexpr double kMicroseconds = 1e6;

std::string describe(const Histogram& times) {
  return fmt::format("p50 {:.1f}, p99 {:.1f}, p99.9 {:.1f}, max {:.1f} us",
                     kMicroseconds * times.quantile(0.5), kMicroseconds * times.quantile(0.99),
                     kMicroseconds * times.quantile(0.999), kMicroseconds * times.max());
}

}  // namespace

void RunSummary::observe(const TickRecord& record) noexcept {
  if (lateness_.count() == 0) first_time_ = record.time;
  lateness_.record(record.lateness);
  execution_.record(record.execution);
  last_ = record;
  if (record.adopted != 0) ++updates_;
  peak_force_ = std::max(peak_force_, record.F_command.head<3>().norm());
  if (!renders_force(record.server)) return;
  device_proxy_.observe(record.X_WD, record.X_WP);
  proxy_tool_.observe(record.X_WP, record.X_WT);
}

std::string RunSummary::text(std::uint64_t lost) const {
  const std::uint64_t ticks = lateness_.count();
  if (ticks == 0) return "no tick was recorded\n";
  const double duration = last_.time - first_time_;
  const double rate = duration > 0 ? static_cast<double>(ticks - 1) / duration : 0;
  return fmt::format(
      "ticks          {} in {:.2f} s, {:.2f} Hz; {} missed, {} not recorded\n"
      "lateness       {}\n"
      "execution      {}\n"
      "datagrams      {}, {}; {} updates adopted\n"
      "peak force     {:.3f} N\n"
      "device-proxy   {}\n"
      "proxy-tool     {}\n",
      ticks, duration, rate, last_.overruns, lost, describe(lateness_), describe(execution_),
      last_.datagrams, protocol::describe_drops(last_.dropped_for), updates_, peak_force_,
      describe(device_proxy_), describe(proxy_tool_));
}

}  // namespace hlm::server
