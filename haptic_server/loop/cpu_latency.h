// How deeply the machine's idle processors may sleep, which decides how late a timer wakes a
// thread.
#pragma once

#include <string>

namespace hlm::server {

/// While wanted, no processor enters an idle state: the kernel's CPU latency limit is 0. Idle
/// processors poll instead, so the whole machine draws power as if it were busy. Without it an idle
/// processor wakes some 25 µs later, longer where it may sleep deeper.
///
/// The limit holds while this process has the kernel's file open; it ends with the process. Not for
/// the servo thread: opening a file may wait.
class CpuLatencyLimit {
 public:
  CpuLatencyLimit() = default;
  ~CpuLatencyLimit() { set(false); }
  CpuLatencyLimit(const CpuLatencyLimit&) = delete;
  CpuLatencyLimit& operator=(const CpuLatencyLimit&) = delete;

  /// What the system refuses and how to get it, in one line; empty if the limit can be set. Leaves
  /// the limit as it is.
  static std::string find_refusal();

  /// Sets or lifts the limit. Where the system refuses, nothing happens.
  void set(bool wanted) noexcept;
  bool holds() const noexcept { return file_ >= 0; }

 private:
  bool wanted_ = false;
  int file_ = -1;  ///< Open while the limit holds.
};

}  // namespace hlm::server
