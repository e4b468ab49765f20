#include "hlm/haptic_server/loop/realtime.h"

#include <cerrno>
#include <cstddef>
#include <filesystem>
#include <stdexcept>
#include <system_error>

#include <pthread.h>
#include <sched.h>
#include <spdlog/fmt/fmt.h>
#include <sys/mman.h>
#include <sys/prctl.h>

namespace hlm::server {
namespace {

/// Stack that the tick may use without a page fault, bytes. Above what it needs with the most
/// bodies and contacts, below the 8 MB that a thread has.
constexpr std::size_t kStack = 2 * 1024 * 1024;
constexpr std::size_t kPage = 4096;

/// Touches the stack's next pages, so that they are in RAM.
[[gnu::noinline]] void prefault_stack() noexcept {
  [[maybe_unused]] volatile std::byte stack[kStack];
  for (std::size_t i = 0; i < kStack; i += kPage) stack[i] = std::byte{0};
}

/// 0 or the error's number.
int set_fifo(int priority) noexcept {
  sched_param parameters{};
  parameters.sched_priority = priority;
  return pthread_setschedparam(pthread_self(), SCHED_FIFO | SCHED_RESET_ON_FORK, &parameters);
}

/// 0 or the error's number.
int lock_memory() noexcept { return mlockall(MCL_CURRENT) == 0 ? 0 : errno; }

std::string program() {
  std::error_code error;
  const auto path = std::filesystem::read_symlink("/proc/self/exe", error);
  return error ? "PROGRAM" : path.string();
}

std::string describe_refusals(int priority, int fifo_error, int lock_error) {
  std::string refusals;
  if (fifo_error != 0) {
    refusals += fmt::format("SCHED_FIFO priority {} ({})", priority,
                            std::generic_category().message(fifo_error));
  }
  if (lock_error != 0) {
    if (!refusals.empty()) refusals += " and ";
    refusals += fmt::format("locked memory ({})", std::generic_category().message(lock_error));
  }
  return refusals;
}

}  // namespace

std::optional<std::string> find_error(const RealtimeOptions& options) {
  return find_error("priority", options.priority, kPriorities);
}

RealtimeGrant enter_realtime(const RealtimeOptions& options) {
  RealtimeGrant grant;
  if (options.policy == RealtimePolicy::kOff) return grant;

  prctl(PR_SET_TIMERSLACK, 1UL);  // ns; needs no rights.
  prefault_stack();
  const int lock_error = lock_memory();
  const int fifo_error = set_fifo(options.priority);
  grant.locked_memory = lock_error == 0;
  grant.fifo = fifo_error == 0;
  if (grant.fifo && grant.locked_memory) return grant;

  const std::string refusals = describe_refusals(options.priority, fifo_error, lock_error);
  if (options.policy == RealtimePolicy::kRequire) {
    throw std::runtime_error(
        fmt::format("real time is required but the system refuses {}: run as root, grant it with "
                    "'setcap cap_sys_nice,cap_ipc_lock+ep {}', or use --realtime=prefer or off",
                    refusals, program()));
  }
  grant.warning = fmt::format(
      "not real-time: the system refuses {}; 'setcap cap_sys_nice,cap_ipc_lock+ep {}' grants it",
      refusals, program());
  return grant;
}

}  // namespace hlm::server
