// Motors off when the server can no longer see to it: it crashes, is killed, or stands still.
#pragma once

#include <atomic>
#include <cstdint>

#include <pthread.h>
#include <sys/types.h>

#include "hlm/haptic_server/device/device.h"

namespace hlm::server {

/// Halts the device in two ways, for as long as this lives, and tells its own process when it does
/// not:
/// - the handler of a signal that ends the program by a fault of its own (SIGSEGV, SIGABRT and the
///   like) halts it at once, before a core file is written, which takes time; then the signal has
///   its usual effect;
/// - a process that was forked halts it when the thread that made this is gone, however it went, or
///   has not called beat() for too long, as when it is stopped (SIGSTOP).
/// What is left are faults of the whole machine: only the device's own time guard ends those.
///
/// That thread holds a robust mutex, which the kernel gives to the other process as the first thing
/// when the thread dies. A pipe's end or a pidfd tells it when the last thread of the process has
/// died and its memory is freed: 65 ms later with 200 MB, 900 ms on a busy machine.
///
/// To be made after the device was opened and before files, sockets and threads that the other
/// process must not share, and to end in the thread that made it.
class MotorGuard {
 public:
  /// Time, s, without a look of the other process, after which force fades: with the fade it is off
  /// within 50 ms. Less lets force dip on a busy machine.
  static constexpr double kLongestBlindness = 0.02;

  /// longest_gap: between two calls of beat(), s, once the first was made. `device` must outlive
  /// this. Throws std::runtime_error if there can be no such process.
  MotorGuard(Device& device, double longest_gap);
  ~MotorGuard();
  MotorGuard(const MotorGuard&) = delete;
  MotorGuard& operator=(const MotorGuard&) = delete;

  /// The loop goes on. From the servo thread, every tick.
  void beat() noexcept { shared_->beats.fetch_add(1, std::memory_order_relaxed); }
  /// Whether the other process has halted the device since the last call: it is to be enabled
  /// again. From the servo thread.
  bool has_halted() noexcept;
  /// Whether the other process has looked within kLongestBlindness; now: s, any steady origin.
  /// From the servo thread, every tick.
  bool is_watching(double now) noexcept;
  /// False, once, when the other process has ended although it should not.
  bool lives() noexcept;
  pid_t process() const noexcept { return process_; }

 private:
  /// Of both processes.
  struct Shared {
    std::atomic<std::uint64_t> beats = 0;
    std::atomic<std::uint64_t> looks = 0;  ///< Of the other process at the beats.
    std::atomic<std::uint64_t> halts = 0;  ///< By it.
    pthread_mutex_t alive;                 ///< Held by the thread that made this.
  };
  static void watch(Device& device, Shared& shared, double longest_gap);

  Shared* shared_;
  std::uint64_t halts_ = 0;  ///< Seen.
  std::uint64_t looks_ = 0;  ///< Seen.
  double looked_at_ = 0;     ///< When they changed, s.
  pid_t process_ = -1;
};

}  // namespace hlm::server
