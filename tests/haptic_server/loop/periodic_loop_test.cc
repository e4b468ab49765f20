// Do ticks keep to their grid, and are missed periods counted?
#include "hlm/haptic_server/loop/periodic_loop.h"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <limits>
#include <thread>
#include <vector>

#include <pthread.h>
#include <sched.h>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;

constexpr double kRate = 100;  // Hz. Slow, so that a busy machine changes nothing but lateness.
constexpr double kPeriod = 1 / kRate;

/// Runs `count` ticks; `work(i)` is done in the i-th.
template <class Work>
std::vector<Timing> run(PeriodicLoop& loop, std::size_t count, Work&& work) {
  std::vector<Timing> timings;
  timings.reserve(count);
  loop.run([&](const Timing& timing) noexcept {
    timings.push_back(timing);
    work(timings.size() - 1);
    if (timings.size() == count) loop.stop();
  });
  return timings;
}

/// What holds for every sequence of ticks, however busy the machine is.
void check_grid(const std::vector<Timing>& timings) {
  std::uint64_t next = 0;
  std::uint64_t overruns = 0;
  for (const Timing& timing : timings) {
    CAPTURE(timing.tick);
    overruns += timing.missed;
    CHECK(timing.tick == next + timing.missed);
    CHECK(timing.overruns == overruns);
    CHECK(timing.scheduled == Approx(static_cast<double>(timing.tick) * kPeriod).margin(1e-12));
    CHECK(timing.begin >= timing.scheduled);
    CHECK(timing.begin < timing.scheduled + kPeriod);
    const double wake_up = static_cast<double>(next) * kPeriod;
    CHECK(timing.lateness == Approx(timing.begin - wake_up).margin(1e-12));
    next = timing.tick + 1;
  }
}

TEST_CASE("Ticks begin on the grid, none before its time") {
  PeriodicLoop loop({.rate = kRate});
  std::vector<double> began;
  const std::vector<Timing> timings =
      run(loop, 10, [&](std::size_t) { began.push_back(loop.elapsed()); });
  REQUIRE(timings.size() == 10);
  check_grid(timings);
  for (std::size_t i = 0; i < timings.size(); ++i) {
    CHECK(began[i] >= timings[i].begin);
  }
}

TEST_CASE("An overrun skips whole periods, counts them and keeps the phase") {
  PeriodicLoop loop({.rate = kRate});
  constexpr std::size_t kSlow = 3;
  const std::vector<Timing> timings = run(loop, 8, [](std::size_t i) {
    if (i == kSlow) std::this_thread::sleep_for(std::chrono::milliseconds(35));
  });
  check_grid(timings);
  CHECK(timings[kSlow + 1].missed >= 2);
  CHECK(timings[kSlow + 1].lateness >= 25e-3);
  CHECK(timings.back().overruns >= 2);
}

TEST_CASE("A tick that ends late by less than a period misses none") {
  PeriodicLoop loop({.rate = kRate});
  const std::vector<Timing> timings = run(loop, 4, [](std::size_t i) {
    if (i == 1) std::this_thread::sleep_for(std::chrono::milliseconds(12));
  });
  check_grid(timings);
  CHECK(timings[2].lateness >= 2e-3);
  // Only a machine that stalls for 8 ms more misses a period.
  if (timings[2].lateness < kPeriod) CHECK(timings[2].missed == 0);
}

TEST_CASE("The loop sleeps between its ticks, with and without a final spin") {
  const double spin = GENERATE(0.0, 0.1 * kPeriod);
  PeriodicLoop loop({.rate = kRate, .final_spin = spin});
  const auto cpu_time = [] {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  };
  const double before = cpu_time();
  check_grid(run(loop, 20, [](std::size_t) {}));
  CHECK(cpu_time() - before < 0.5 * 20 * kPeriod);
}

TEST_CASE("Without a choice the loop spins under SCHED_FIFO alone, and never for half a period") {
  const double rate = GENERATE(500.0, 1000.0, 4000.0, 8000.0);
  const double expected = std::min(100e-6, 0.4 / rate);
  const auto spin = [](const PeriodicLoopOptions& options) {
    PeriodicLoop loop(options);
    loop.run([&](const Timing&) noexcept { loop.stop(); });
    return loop.final_spin();
  };
  CHECK(spin({.rate = rate}) == 0);
  CHECK(spin({.rate = rate, .final_spin = 20e-6}) == 20e-6);
  std::thread([&] {
    const sched_param lowest{1};
    if (pthread_setschedparam(pthread_self(), SCHED_FIFO, &lowest) != 0) {
      WARN("skipped in part: no right to SCHED_FIFO");
      return;
    }
    CHECK(spin({.rate = rate}) == expected);
    CHECK(spin({.rate = rate, .final_spin = 0}) == 0);
  }).join();
}

TEST_CASE("Another thread ends the loop") {
  PeriodicLoop loop({.rate = kRate});
  std::atomic<int> ticks = 0;
  std::thread servo([&] { loop.run([&](const Timing&) noexcept { ++ticks; }); });
  while (ticks < 3) std::this_thread::yield();
  loop.stop();
  servo.join();
  CHECK(ticks >= 3);
}

TEST_CASE("A loop stopped beforehand does not tick") {
  PeriodicLoop loop({.rate = kRate});
  loop.stop();
  int ticks = 0;
  loop.run([&](const Timing&) noexcept { ++ticks; });
  CHECK(ticks == 0);
}

TEST_CASE("Rates and spins out of range are refused by name, value and range") {
  CHECK_FALSE(find_error(PeriodicLoopOptions{}));
  CHECK_FALSE(find_error(PeriodicLoopOptions{.rate = 8000, .final_spin = 62.5e-6}));
  CHECK(*find_error(PeriodicLoopOptions{.rate = 99}) == "rate 99 Hz must be 100 to 8000 Hz");
  CHECK(find_error(PeriodicLoopOptions{.rate = 8001}));
  CHECK(find_error(PeriodicLoopOptions{.rate = std::numeric_limits<double>::quiet_NaN()}));
  CHECK(*find_error(PeriodicLoopOptions{.rate = 1000, .final_spin = 0.6e-3}) ==
        "final spin 0.0006 s must be 0 to 0.0005 s, half a period");
  CHECK_THAT(*find_error(PeriodicLoopOptions{.final_spin = -1e-6}),
             ContainsSubstring("final spin -1e-06"));
}

}  // namespace
}  // namespace hlm::server
