#include "hlm/devices/device_lock.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <utility>

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

namespace hlm::server {
namespace {

using std::chrono::steady_clock;

constexpr std::chrono::milliseconds kLockPatience{500};
constexpr std::chrono::milliseconds kLockLook{20};

[[noreturn]] void cannot_take(const std::string& device, const std::string& why) {
  throw std::runtime_error(device + " cannot be taken: " + why);
}

/// Whether it is this process's now; errno says why not. A name that is too long keeps its end.
bool take_name(int socket, const std::string& name) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string prefix = "haptic_server/device/";
  const std::size_t room = sizeof address.sun_path - 1 - prefix.size();
  const std::string path = prefix + name.substr(name.size() - std::min(name.size(), room));
  std::copy(path.begin(), path.end(), address.sun_path + 1);  // Behind a zero: in no file system.
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + path.size());
  return bind(socket, reinterpret_cast<const sockaddr*>(&address), size) == 0;
}

}  // namespace

void DeviceLock::take(const std::string& device) {
  if (socket_ >= 0) return;
  socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (socket_ < 0) cannot_take(device, std::generic_category().message(errno));
  const auto deadline = steady_clock::now() + kLockPatience;
  while (!take_name(socket_, device)) {
    const bool is_held = errno == EADDRINUSE;
    const std::string why = std::generic_category().message(errno);
    if (is_held && steady_clock::now() < deadline) {
      std::this_thread::sleep_for(kLockLook);
      continue;
    }
    release();
    if (!is_held) cannot_take(device, why);
    throw std::runtime_error("another haptic_server or haptic_doctor has " + device +
                             ": end it first");
  }
}

void DeviceLock::release() noexcept {
  if (socket_ >= 0) close(std::exchange(socket_, -1));
}

}  // namespace hlm::server
