// One device is one process's.
#pragma once

#include <string>

namespace hlm::server {

/// A name that at most one process on this machine has: a socket in Linux's abstract namespace. It
/// is free as soon as the process, and a motor guard that was forked from it, are gone, however
/// they went. Processes in another network namespace, such as a container's, are not seen.
class DeviceLock {
 public:
  DeviceLock() = default;
  ~DeviceLock() { release(); }
  DeviceLock(const DeviceLock&) = delete;
  DeviceLock& operator=(const DeviceLock&) = delete;

  /// Holds `device` alone for as long as this lives; nothing if it holds one already, which its own
  /// guard has inherited. Waits up to 0.5 s: a guard outlives its server for an instant. device:
  /// what a person calls it, unique on this machine. Throws std::runtime_error that names it and
  /// says that another program has it.
  void take(const std::string& device);

 private:
  void release() noexcept;

  int socket_ = -1;
};

}  // namespace hlm::server
