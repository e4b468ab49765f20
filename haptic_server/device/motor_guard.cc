#include "hlm/device/motor_guard.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <ctime>
#include <new>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

namespace hlm::server {
namespace {

/// Signals by which a program ends through a fault of its own.
constexpr std::array<int, 7> kFatalSignals{SIGSEGV, SIGBUS,  SIGFPE, SIGILL,
                                           SIGABRT, SIGXCPU, SIGSYS};
/// Those meant for the server, which the other process outlives.
constexpr std::array<int, 7> kSignalsOfServer{SIGHUP,  SIGINT,  SIGQUIT, SIGTERM,
                                              SIGUSR1, SIGUSR2, SIGPIPE};
/// The server looks for a gap this many times within the longest that is allowed.
constexpr double kLooksPerGap = 5;

std::atomic<Device*> guarded = nullptr;
static_assert(std::atomic<Device*>::is_always_lock_free);
std::array<struct sigaction, kFatalSignals.size()> usual_actions;

/// Signal handlers need some stack where the thread's own has overflowed.
alignas(16) std::array<std::byte, 1 << 16> handler_stack;

/// Async-signal-safe. A fault of the code happens again on return, with the signal's usual action;
/// a signal that was sent has to be sent again.
void halt_and_end(int signal, siginfo_t* information, void*) {
  const int error = errno;
  if (Device* device = guarded.load()) device->halt();
  const bool was_sent = information->si_code <= 0;
  for (std::size_t i = 0; i < kFatalSignals.size(); ++i) {
    if (kFatalSignals[i] == signal && !was_sent) sigaction(signal, &usual_actions[i], nullptr);
  }
  if (was_sent) {
    std::signal(signal, SIG_DFL);
    raise(signal);
  }
  errno = error;
}

/// This thread's, where it has no other.
void give_handlers_a_stack() {
  stack_t present{};
  sigaltstack(nullptr, &present);
  if ((present.ss_flags & SS_DISABLE) == 0) return;
  stack_t stack{};
  stack.ss_sp = handler_stack.data();
  stack.ss_size = handler_stack.size();
  sigaltstack(&stack, nullptr);
}

void handle_fatal_signals() {
  give_handlers_a_stack();
  struct sigaction action {};
  action.sa_sigaction = halt_and_end;
  action.sa_flags = SA_SIGINFO | SA_ONSTACK | SA_NODEFER;
  for (std::size_t i = 0; i < kFatalSignals.size(); ++i) {
    sigaction(kFatalSignals[i], &action, &usual_actions[i]);
  }
}

void restore_fatal_signals() {
  for (std::size_t i = 0; i < kFatalSignals.size(); ++i) {
    sigaction(kFatalSignals[i], &usual_actions[i], nullptr);
  }
}

double steady_now() noexcept {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

/// Factor on the longest gap: the server finds its own stops first, and says so.
constexpr double kPatience = 1.2;

std::runtime_error failure(const char* what) {
  return std::runtime_error(std::string("nothing can guard the motors: ") + what + ": " +
                            std::generic_category().message(errno));
}

/// Above whatever else is real-time, in memory, where this process may: it works for some
/// microseconds at each look.
void run_before_all() {
  mlockall(MCL_CURRENT | MCL_FUTURE);
  rlimit limit{};
  getrlimit(RLIMIT_RTPRIO, &limit);
  const auto highest = static_cast<rlim_t>(sched_get_priority_max(SCHED_FIFO));
  for (const rlim_t priority : {highest, std::min(highest, limit.rlim_cur)}) {
    const sched_param wanted{.sched_priority = static_cast<int>(priority)};
    if (sched_setscheduler(0, SCHED_FIFO, &wanted) == 0) return;
  }
}

}  // namespace

/// The other process: until a byte comes through `alive`, which is an orderly end, or its end.
void MotorGuard::watch(Device& device, Shared& shared, int alive, double longest_gap) {
  setsid();  // What is typed in the server's terminal is not for this process.
  prctl(PR_SET_NAME, "haptic_guard");
  for (const int signal : kSignalsOfServer) std::signal(signal, SIG_IGN);
  for (const int signal : kFatalSignals) std::signal(signal, SIG_DFL);
  run_before_all();

  const int patience = std::max(1, static_cast<int>(1e3 * longest_gap / kLooksPerGap));  // ms.
  std::uint64_t seen = 0;
  double seen_at = steady_now();
  while (true) {
    pollfd end{.fd = alive, .events = POLLIN, .revents = 0};
    if (poll(&end, 1, patience) > 0) {
      char orderly = 0;
      if (read(alive, &orderly, 1) <= 0) device.halt();
      return;
    }
    const double now = steady_now();  // First: this process may be kept waiting in between.
    const std::uint64_t now_seen = shared.beats.load(std::memory_order_relaxed);
    shared.looks.fetch_add(1, std::memory_order_relaxed);
    if (now_seen != seen) {
      seen = now_seen;
      seen_at = now;
    } else if (seen > 0 && now - seen_at > kPatience * longest_gap) {
      device.halt();
      shared.halts.fetch_add(1, std::memory_order_release);
    }
  }
}

MotorGuard::MotorGuard(Device& device, double longest_gap) {
  void* const memory =
      mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw failure("shared memory");
  shared_ = new (memory) Shared;
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) throw failure("pipe");
  process_ = fork();
  if (process_ < 0) throw failure("fork");
  if (process_ == 0) {
    close(ends[1]);
    watch(device, *shared_, ends[0], longest_gap);
    _exit(0);
  }
  close(ends[0]);
  alive_ = ends[1];
  guarded = &device;
  handle_fatal_signals();
}

MotorGuard::~MotorGuard() {
  restore_fatal_signals();
  guarded = nullptr;
  const char orderly = 1;
  // Without a reader that would be SIGPIPE, which the server ignores.
  [[maybe_unused]] const ssize_t written = process_ > 0 ? write(alive_, &orderly, 1) : 0;
  close(alive_);
  if (process_ > 0) waitpid(process_, nullptr, 0);
  munmap(shared_, sizeof(Shared));
}

bool MotorGuard::has_halted() noexcept {
  const std::uint64_t halts = shared_->halts.load(std::memory_order_acquire);
  return halts != std::exchange(halts_, halts);
}

bool MotorGuard::is_watching(double now) noexcept {
  const std::uint64_t looks = shared_->looks.load(std::memory_order_relaxed);
  if (looks != std::exchange(looks_, looks) || now < looked_at_) looked_at_ = now;
  return now - looked_at_ <= kLongestBlindness;
}

bool MotorGuard::lives() noexcept {
  if (process_ <= 0 || waitpid(process_, nullptr, WNOHANG) != process_) return true;
  process_ = -1;
  return false;
}

}  // namespace hlm::server
