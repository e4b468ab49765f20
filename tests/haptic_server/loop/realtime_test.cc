// Does the servo thread get what it asks for, and does it learn what it does not get?
#include "hlm/haptic_server/loop/realtime.h"

#include <array>
#include <functional>
#include <stdexcept>
#include <string>
#include <thread>

#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "hlm/haptic_server/loop/cpu_latency.h"
#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;

int scheduler() { return sched_getscheduler(0) & ~SCHED_RESET_ON_FORK; }

/// Runs `body` in a thread of its own, since scheduling is a property of the thread.
void in_thread(const std::function<void()>& body) { std::thread(body).join(); }

/// What `body` returns in a process that has no right to real time.
std::string without_rights(const std::function<std::string()>& body) {
  std::array<int, 2> pipe_ends{};
  REQUIRE(pipe(pipe_ends.data()) == 0);
  const pid_t child = fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    constexpr uid_t kNobody = 65534;
    const rlimit none{};
    setrlimit(RLIMIT_RTPRIO, &none);
    if (geteuid() == 0 && setresuid(kNobody, kNobody, kNobody) != 0) _exit(1);
    const std::string text = body();
    const auto written = write(pipe_ends[1], text.data(), text.size());
    _exit(written == static_cast<ssize_t>(text.size()) ? 0 : 1);
  }
  close(pipe_ends[1]);
  std::string text(4096, '\0');
  const auto length = read(pipe_ends[0], text.data(), text.size());
  close(pipe_ends[0]);
  int status = 0;
  REQUIRE(waitpid(child, &status, 0) == child);
  REQUIRE(status == 0);
  text.resize(length > 0 ? static_cast<std::size_t>(length) : 0);
  return text;
}

TEST_CASE("`off` leaves the thread as it was") {
  in_thread([] {
    const RealtimeGrant grant = enter_realtime({.policy = RealtimePolicy::kOff});
    CHECK_FALSE(grant.fifo);
    CHECK_FALSE(grant.locked_memory);
    CHECK(grant.warning.empty());
    CHECK(scheduler() == SCHED_OTHER);
  });
}

TEST_CASE("`prefer` tells what was granted, and it is so") {
  in_thread([] {
    constexpr int kPriority = 7;
    const RealtimeGrant grant =
        enter_realtime({.policy = RealtimePolicy::kPrefer, .priority = kPriority});
    CHECK(prctl(PR_GET_TIMERSLACK) <= 1);  // ns; under SCHED_FIFO always 0.
    CHECK(scheduler() == (grant.fifo ? SCHED_FIFO : SCHED_OTHER));
    CHECK(grant.warning.empty() == (grant.fifo && grant.locked_memory));
    if (!grant.fifo) {
      WARN("skipped in part, without the right to SCHED_FIFO: " << grant.warning);
      return;
    }
    sched_param parameters{};
    sched_getparam(0, &parameters);
    CHECK(parameters.sched_priority == kPriority);
    in_thread([] { CHECK(scheduler() == SCHED_OTHER); });
  });
  munlockall();
}

TEST_CASE("`prefer` without rights says what is refused and how to get it") {
  const std::string answer = without_rights([] {
    const RealtimeGrant grant = enter_realtime({.policy = RealtimePolicy::kPrefer, .priority = 40});
    return grant.fifo ? std::string("granted") : grant.warning;
  });
  CHECK_THAT(answer, ContainsSubstring("SCHED_FIFO priority 40 (Operation not permitted)"));
  CHECK_THAT(answer, ContainsSubstring("setcap cap_sys_nice,cap_ipc_lock+ep /"));
}

TEST_CASE("`prefer` without rights has precise timers all the same") {
  const std::string slack = without_rights([] {
    enter_realtime({.policy = RealtimePolicy::kPrefer});
    return std::to_string(prctl(PR_GET_TIMERSLACK));
  });
  CHECK(slack == "1");  // ns.
}

TEST_CASE("Without rights processors may sleep, and it is said how to change that") {
  const std::string answer = without_rights([] {
    CpuLatencyLimit limit;
    limit.set(true);
    return limit.holds() ? std::string("held") : CpuLatencyLimit::find_refusal();
  });
  CHECK_THAT(answer, ContainsSubstring("/dev/cpu_dma_latency") && ContainsSubstring("udev"));
}

TEST_CASE("`require` without rights refuses to start and says what to do") {
  const std::string answer = without_rights([]() -> std::string {
    try {
      enter_realtime({.policy = RealtimePolicy::kRequire, .priority = 40});
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "granted";
  });
  CHECK_THAT(answer, ContainsSubstring("real time is required"));
  CHECK_THAT(answer, ContainsSubstring("SCHED_FIFO priority 40 (Operation not permitted)"));
  CHECK_THAT(answer, ContainsSubstring("setcap cap_sys_nice,cap_ipc_lock+ep /"));
  CHECK_THAT(answer, ContainsSubstring("--realtime=prefer"));
}

TEST_CASE("Priorities out of range are refused by name, value and range") {
  CHECK_FALSE(find_error(RealtimeOptions{}));
  CHECK(*find_error(RealtimeOptions{.priority = 0}) == "priority 0 must be 1 to 99");
  CHECK(find_error(RealtimeOptions{.priority = 100}));
}

}  // namespace
}  // namespace hlm::server
