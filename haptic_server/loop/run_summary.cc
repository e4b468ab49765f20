#include "haptic_server/loop/run_summary.h"

#include <algorithm>
#include <numbers>

#include <spdlog/fmt/fmt.h>

namespace hlm::server {
namespace {

constexpr double kMicroseconds = 1e6;
constexpr double kMillimetres = 1e3;
constexpr double kDegrees = 180 / std::numbers::pi;

std::string describe(const Histogram& times) {
  return fmt::format("p50 {:.1f}, p99 {:.1f}, p99.9 {:.1f}, max {:.1f} us",
                     kMicroseconds * times.quantile(0.5), kMicroseconds * times.quantile(0.99),
                     kMicroseconds * times.quantile(0.999), kMicroseconds * times.max());
}

}  // namespace

RunSummary::Drift RunSummary::drift(const Pose& X_WA, const Pose& X_WB) noexcept {
  const Vector6 e = displacement(X_WA, X_WB);
  return {e.head<3>().norm(), e.tail<3>().norm()};
}

void RunSummary::DriftRecord::observe(const Pose& X_WA, const Pose& X_WB) noexcept {
  last = drift(X_WA, X_WB);
  largest.distance = std::max(largest.distance, last.distance);
  largest.angle = std::max(largest.angle, last.angle);
}

std::string RunSummary::DriftRecord::text() const {
  return fmt::format("largest {:.3f} mm, {:.3f} deg; last {:.3f} mm, {:.3f} deg",
                     kMillimetres * largest.distance, kDegrees * largest.angle,
                     kMillimetres * last.distance, kDegrees * last.angle);
}

void RunSummary::observe(const TickRecord& record) noexcept {
  if (lateness_.count() == 0) first_time_ = record.time;
  lateness_.record(record.lateness);
  execution_.record(record.execution);
  last_ = record;
  if (record.adopted != 0) ++updates_;
  peak_force_ = std::max(peak_force_, record.F_command.head<3>().norm());
  if (record.server != ServerState::kRunning) return;
  device_proxy_.observe(record.X_WD, record.X_WP);
  proxy_tool_.observe(record.X_WP, record.X_WT);
}

std::string RunSummary::text(std::uint64_t lost) const {
  const std::uint64_t ticks = lateness_.count();
  if (ticks == 0) return "no tick was recorded\n";
  const double duration = last_.time - first_time_;
  const double rate = duration > 0 ? static_cast<double>(ticks - 1 + lost) / duration : 0;
  return fmt::format(
      "ticks          {} in {:.2f} s, {:.2f} Hz; {} missed, {} not recorded\n"
      "lateness       {}\n"
      "execution      {}\n"
      "datagrams      {}, {} dropped; {} updates adopted\n"
      "peak force     {:.3f} N\n"
      "device-proxy   {}\n"
      "proxy-tool     {}\n",
      ticks, duration, rate, last_.overruns, lost, describe(lateness_), describe(execution_),
      last_.datagrams, last_.dropped, updates_, peak_force_, device_proxy_.text(),
      proxy_tool_.text());
}

}  // namespace hlm::server
