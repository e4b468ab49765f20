// Motors off when the server can no longer see to it: it crashes, is killed, or stands still.
#pragma once

#include <atomic>
#include <cstdint>

#include <sys/types.h>

#include "hlm/device/device.h"

namespace hlm::server {

/// Halts the device in two ways, for as long as this lives:
/// - the handler of a signal that ends the program by a fault of its own (SIGSEGV, SIGABRT and the
///   like) halts it at once, before a core file is written, which takes time; then the signal has
///   its usual effect;
/// - a process that was forked halts it when this one is gone, however it went, or has not called
///   beat() for too long, as when it is stopped (SIGSTOP).
/// What is left are faults of the whole machine: only the device's own time guard ends those.
///
/// To be made after the device was opened and before files, sockets and threads that the other
/// process must not share.
class MotorGuard {
 public:
  /// longest_gap: between two calls of beat(), s, once the first was made. `device` must outlive
  /// this. Throws std::runtime_error if there can be no such process.
  MotorGuard(Device& device, double longest_gap);
  ~MotorGuard();
  MotorGuard(const MotorGuard&) = delete;
  MotorGuard& operator=(const MotorGuard&) = delete;

  /// The loop goes on. From the servo thread, every tick.
  void beat() noexcept { beats_->fetch_add(1, std::memory_order_relaxed); }
  /// False, once, when the other process has ended although it should not.
  bool lives() noexcept;
  pid_t process() const noexcept { return process_; }

 private:
  std::atomic<std::uint64_t>* beats_;  ///< Shared with the other process.
  int alive_ = -1;                     ///< Closed, by whatever end, when this process ends.
  pid_t process_ = -1;
};

}  // namespace hlm::server
