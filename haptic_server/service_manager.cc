#include "hlm/haptic_server/service_manager.h"

#include <cstddef>
#include <cstdlib>
#include <cstring>

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

namespace hlm::server {
namespace {

/// s; 0 if the watchdog is off or another process' business.
double watchdog_period() {
  const char* const microseconds = std::getenv("WATCHDOG_USEC");
  if (microseconds == nullptr) return 0;
  const char* const process = std::getenv("WATCHDOG_PID");
  if (process != nullptr && std::atol(process) != getpid()) return 0;
  return 1e-6 * std::atof(microseconds);
}

/// A connected socket, or -1.
int connect_to(const char* path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::size_t length = std::strlen(path);
  if (length == 0 || length >= sizeof address.sun_path) return -1;
  std::memcpy(address.sun_path, path, length);
  if (path[0] == '@') address.sun_path[0] = '\0';  // An abstract name.
  const int descriptor = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (descriptor < 0) return -1;
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + length);
  if (connect(descriptor, reinterpret_cast<const sockaddr*>(&address), size) == 0) {
    return descriptor;
  }
  close(descriptor);
  return -1;
}

}  // namespace

ServiceManager::ServiceManager() : watchdog_(watchdog_period()) {
  if (const char* const path = std::getenv("NOTIFY_SOCKET")) socket_ = connect_to(path);
}

ServiceManager::~ServiceManager() {
  if (socket_ >= 0) close(socket_);
}

void ServiceManager::observe(const TickRecord& record) {
  if (socket_ < 0) return;
  if (shown_ != record.server) {
    const bool first = !shown_;
    shown_ = record.server;
    send((first ? "READY=1\nSTATUS=" : "STATUS=") + std::string(name_of(record.server)) + ": " +
         std::string(meaning_of(record.server)));
  }
  constexpr double kShare = 0.4;  // Share of the watchdog's period: two of the words may be lost.
  if (watchdog_ == 0 || record.time - quieted_at_ < kShare * watchdog_) return;
  quieted_at_ = record.time;
  send("WATCHDOG=1");
}

void ServiceManager::send(const std::string& text) const {
  if (socket_ < 0) return;
  [[maybe_unused]] const ssize_t sent = ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL);
}

}  // namespace hlm::server
