#include "hlm/haptic_server/operator_socket.h"

#include <array>
#include <cerrno>
#include <cstddef>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

namespace hlm::server {
namespace {

/// Longest wait for a command once a person has connected, ms. Less would miss a busy machine's
/// doctor; more lets root or the server's own user keep others of them waiting for longer.
constexpr int kLongestCommand = 1000;
/// Connections that wait to be taken. More are refused at once.
constexpr int kWaiting = 64;
/// After a refused connection, where the process has no descriptor left, ms.
constexpr int kPauseOfAccepting = 100;

std::runtime_error failure(const std::string& what) {
  return std::runtime_error(what + ": " + std::generic_category().message(errno));
}

/// A socket that listens there. Throws std::runtime_error.
Descriptor listen_at(const Descriptor& folder, const std::string& name) {
  Descriptor listener(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!listener.is_open()) throw failure("socket");
  const std::string path = path_in(folder, name);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path) throw std::runtime_error("its path is too long");
  path.copy(address.sun_path, path.size());
  unlinkat(folder.get(), name.c_str(), 0);  // Of a server that was killed: its port is ours now.
  if (bind(listener.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    throw failure("bind");
  }
  // Everybody may ask the kernel who listens; commands are taken of few.
  if (fchmodat(folder.get(), name.c_str(), 0666, 0) != 0) throw failure("mode");
  if (listen(listener.get(), kWaiting) != 0) throw failure("listen");
  return listener;
}

bool may_command(const Descriptor& person) noexcept {
  ucred peer{};
  socklen_t size = sizeof peer;
  if (getsockopt(person.get(), SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) return false;
  return peer.uid == 0 || peer.uid == geteuid();
}

}  // namespace

std::string path_in(const Descriptor& folder, const std::string& name) {
  return "/proc/self/fd/" + std::to_string(folder.get()) + '/' + name;
}

OperatorSocket::OperatorSocket(const std::filesystem::path& directory, const std::string& listen,
                               std::function<void()> release_fault)
    : name_(listen + kOperatorSocketSuffix), release_fault_(std::move(release_fault)) {
  if (directory.empty()) return;
  try {
    folder_ = Descriptor(open(directory.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
    struct stat folder {};
    if (!folder_.is_open() || fstat(folder_.get(), &folder) != 0) throw failure("folder");
    if (folder.st_uid != geteuid()) throw std::runtime_error("the folder is another user's");
    listener_ = listen_at(folder_, name_);
    thread_ = std::thread([this] { serve(); });
  } catch (const std::exception& error) {
    spdlog::warn("haptic_doctor will not find this server: no socket {} in {}: {}", name_,
                 directory.string(), error.what());
    listener_ = Descriptor();
  }
}

OperatorSocket::~OperatorSocket() {
  if (!thread_.joinable()) return;
  unlinkat(folder_.get(), name_.c_str(), 0);
  shutdown(listener_.get(), SHUT_RDWR);  // Wakes the thread.
  thread_.join();
}

void OperatorSocket::serve() {
  while (true) {
    pollfd next{.fd = listener_.get(), .events = POLLIN, .revents = 0};
    if (poll(&next, 1, -1) < 0) continue;
    if ((next.revents & ~POLLIN) != 0) return;
    const Descriptor person(accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC));
    if (!person.is_open()) {
      poll(nullptr, 0, kPauseOfAccepting);
      continue;
    }
    if (may_command(person)) answer(person);
  }
}

void OperatorSocket::answer(const Descriptor& person) {
  // The listener, too: it wakes this thread when the server ends.
  std::array<pollfd, 2> either{{{.fd = person.get(), .events = POLLIN, .revents = 0},
                                {.fd = listener_.get(), .events = 0, .revents = 0}}};
  if (poll(either.data(), either.size(), kLongestCommand) <= 0 || either[0].revents == 0) return;
  std::array<char, 64> text{};
  const ssize_t size = recv(person.get(), text.data(), text.size(), MSG_DONTWAIT);
  if (size <= 0) return;
  if (std::string_view(text.data(), static_cast<std::size_t>(size)) != kReleaseFault) return;
  release_fault_();
  send(person.get(), kDone, std::string_view(kDone).size(), MSG_NOSIGNAL | MSG_DONTWAIT);
}

}  // namespace hlm::server
