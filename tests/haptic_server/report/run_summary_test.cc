// Does the summary tell what the ticks were?
#include "hlm/haptic_server/report/run_summary.h"

#include <numbers>
#include <string>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;

TickRecord tick(double time, ServerState server) {
  TickRecord record;
  record.time = time;
  record.server = server;
  return record;
}

TEST_CASE("Rate, times, counts, peak force and drift of a session are summed up") {
  RunSummary summary;
  for (int i = 0; i <= 1000; ++i) {
    TickRecord r = tick(1e-3 * i, ServerState::kActive);
    r.lateness = i == 500 ? 150e-6 : 30e-6;
    r.execution = i == 501 ? 90e-6 : 15e-6;
    r.adopted = i % 20 == 0 ? 1u : 0u;
    r.F_command[1] = i == 300 ? -2.5 : 0.5;
    r.X_WD.p.x() = i == 400 ? 3e-3 : 0.25e-3;
    if (i == 600) r.X_WD.R = rotation_from_vector({0, 0, std::numbers::pi / 90});
    r.X_WT.p.y() = i == 400 ? -1e-3 : 0.0;
    r.overruns = 4;
    r.datagrams = 60;
    r.dropped_for[static_cast<std::size_t>(protocol::DropReason::kStale)] = 2;
    summary.observe(r);
  }
  CHECK(summary.text(0) ==
        "ticks          1001 in 1.00 s, 1000.00 Hz; 4 missed, 0 not recorded\n"
        "lateness       p50 30.2, p99 30.2, p99.9 30.2, max 150.0 us\n"
        "execution      p50 15.1, p99 15.1, p99.9 15.1, max 90.0 us\n"
        "datagrams      60, 2 dropped (2 stale); 51 updates adopted\n"
        "peak force     2.500 N\n"
        "device-proxy   largest 3.000 mm, 2.000 deg; last 0.250 mm, 0.000 deg\n"
        "proxy-tool     largest 1.000 mm, 0.000 deg; last 0.000 mm, 0.000 deg\n");
}

TEST_CASE("Drift counts only while a session runs") {
  RunSummary summary;
  for (const auto server : {ServerState::kOff, ServerState::kFading, ServerState::kFault}) {
    TickRecord r = tick(0, server);
    r.X_WD.p.x() = 1;
    summary.observe(r);
  }
  CHECK_THAT(summary.text(0), ContainsSubstring("device-proxy   largest 0.000 mm"));
}

TEST_CASE("The rate is that of the ticks that were recorded, as in the picture of their log") {
  RunSummary summary;
  for (int i = 0; i <= 50; ++i) summary.observe(tick(2e-3 * i, ServerState::kOff));
  CHECK_THAT(summary.text(99), ContainsSubstring("500.00 Hz; 0 missed, 99 not recorded"));
}

TEST_CASE("A run without ticks says so") {
  CHECK(RunSummary().text(0) == "no tick was recorded\n");
}

}  // namespace
}  // namespace hlm::server
