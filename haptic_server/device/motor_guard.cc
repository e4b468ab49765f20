#include "hlm/haptic_server/device/motor_guard.h"

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

timespec steady_time(double seconds) noexcept {
  const auto whole = static_cast<std::time_t>(seconds);
  return {.tv_sec = whole,
          .tv_nsec = static_cast<long>(1e9 * (seconds - static_cast<double>(whole)))};
}

/// Factor on the longest gap: the server finds its own stops first, and says so.
constexpr double kPatience = 1.2;

std::runtime_error failure(const char* what) {
  return std::runtime_error(std::string("nothing can guard the motors: ") + what + ": " +
                            std::generic_category().message(errno));
}

/// Held by this thread, and by nobody if it dies.
void hold(pthread_mutex_t& alive) {
  pthread_mutexattr_t kind;
  pthread_mutexattr_init(&kind);
  pthread_mutexattr_setpshared(&kind, PTHREAD_PROCESS_SHARED);
  pthread_mutexattr_setrobust(&kind, PTHREAD_MUTEX_ROBUST);
  const int error = pthread_mutex_init(&alive, &kind);
  pthread_mutexattr_destroy(&kind);
  if (error == 0) pthread_mutex_lock(&alive);
  errno = error;
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

/// The other process: until the server's thread lets go, which is an orderly end, or dies.
void MotorGuard::watch(Device& device, Shared& shared, double longest_gap) {
  setsid();  // What is typed in the server's terminal is not for this process.
  prctl(PR_SET_NAME, "haptic_guard");
  for (const int signal : kSignalsOfServer) std::signal(signal, SIG_IGN);
  for (const int signal : kFatalSignals) std::signal(signal, SIG_DFL);
  run_before_all();

  const double patience = std::max(1e-3, longest_gap / kLooksPerGap);  // s
  std::uint64_t seen = 0;
  double seen_at = steady_now();
  while (true) {
    const timespec until = steady_time(steady_now() + patience);
    const int end = pthread_mutex_clocklock(&shared.alive, CLOCK_MONOTONIC, &until);
    if (end != ETIMEDOUT) {
      if (end != 0) device.halt();
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
  hold(shared_->alive);
  if (errno != 0) throw failure("robust mutex");
  process_ = fork();
  if (process_ < 0) throw failure("fork");
  if (process_ == 0) {
    watch(device, *shared_, longest_gap);
    _exit(0);
  }
  guarded = &device;
  handle_fatal_signals();
}

MotorGuard::~MotorGuard() {
  restore_fatal_signals();
  guarded = nullptr;
  pthread_mutex_unlock(&shared_->alive);
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
