#include "hlm/tools/doctor/run_folder.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <sstream>
#include <string_view>

#include <arpa/inet.h>
#include <dirent.h>
#include <fcntl.h>
#include <poll.h>
#include <spdlog/fmt/fmt.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include "hlm/haptic_server/operator_socket.h"

namespace hlm::server {
namespace {

constexpr int kLongestAnswer = 2000;  // ms for an answer: above the stalls of a busy machine.

}  // namespace

RunFolder::RunFolder(const std::filesystem::path& path)
    : path_(path), folder_(open(path.c_str(), O_RDONLY | O_DIRECTORY | O_NONBLOCK | O_CLOEXEC)) {
  struct stat facts {};
  if (folder_.is_open() && fstat(folder_.get(), &facts) != 0) folder_ = Descriptor();
  owner_ = facts.st_uid;
}

std::vector<std::string> RunFolder::names(const std::string& suffix) const {
  std::vector<std::string> found;
  if (!folder_.is_open()) return found;
  const int again = openat(folder_.get(), ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const std::unique_ptr<DIR, int (*)(DIR*)> entries(again < 0 ? nullptr : fdopendir(again),
                                                    &closedir);
  if (!entries) return found;
  std::size_t seen = 0;
  while (const dirent* entry = readdir(entries.get())) {
    if (++seen > kMostNames) break;
    const std::string name = entry->d_name;
    if (name.ends_with(suffix)) found.push_back(name);
  }
  return found;
}

std::optional<std::string> RunFolder::read(const std::string& name) const {
  const Descriptor file(openat(folder_.get(), name.c_str(),
                               O_RDONLY | O_NONBLOCK | O_NOFOLLOW | O_NOCTTY | O_CLOEXEC));
  struct stat facts {};
  if (!file.is_open() || fstat(file.get(), &facts) != 0) return std::nullopt;
  if (!S_ISREG(facts.st_mode) || facts.st_uid != owner_) return std::nullopt;
  std::string text(kLargestFile + 1, '\0');
  const ssize_t size = ::read(file.get(), text.data(), text.size());
  if (size < 0 || static_cast<std::size_t>(size) > kLargestFile) return std::nullopt;
  text.resize(static_cast<std::size_t>(size));
  return text;
}

RunFolder::Listener RunFolder::listener(const std::string& name) const {
  Listener found;
  struct stat facts {};
  if (fstatat(folder_.get(), name.c_str(), &facts, AT_SYMLINK_NOFOLLOW) != 0) return found;
  found.is_gone = true;
  if (!S_ISSOCK(facts.st_mode) || facts.st_uid != owner_) return found;
  Descriptor connection(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const std::string path = path_in(folder_, name);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (!connection.is_open() || path.size() >= sizeof address.sun_path) return found;
  path.copy(address.sun_path, path.size());
  if (connect(connection.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    found.is_gone = errno != EAGAIN;  // It stands still, and others wait for it.
    return found;
  }
  ucred peer{};
  socklen_t size = sizeof peer;
  const bool known = getsockopt(connection.get(), SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0;
  if (!known || peer.uid != owner_) return found;
  found.is_gone = false;
  found.process = peer.pid;
  found.connection = std::move(connection);
  return found;
}

bool RunFolder::owner_has_port(const protocol::Endpoint& endpoint) const {
  const std::string wanted = fmt::format("{:08X}:{:04X}", htonl(endpoint.address), endpoint.port);
  std::ifstream table("/proc/net/udp");
  std::string line;
  std::getline(table, line);  // Headings.
  bool found = false;
  while (std::getline(table, line)) {
    std::istringstream fields(line);
    std::string slot, local, remote, state, queues, timer, retransmits;
    long uid = -1;
    fields >> slot >> local >> remote >> state >> queues >> timer >> retransmits >> uid;
    if (!fields || local != wanted) continue;
    if (uid != static_cast<long>(owner_)) return false;
    found = true;
  }
  return found;
}

bool RunFolder::owner_runs(pid_t process) const {
  // The folder in /proc is root's where a program has capabilities.
  std::ifstream status(fmt::format("/proc/{}/status", process));
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("Uid:")) return std::strtoul(line.c_str() + 4, nullptr, 10) == owner_;
  }
  return false;
}

bool command(const Descriptor& connection, const std::string& what) {
  constexpr int kFlags = MSG_NOSIGNAL | MSG_DONTWAIT;
  if (send(connection.get(), what.data(), what.size(), kFlags) < 0) return false;
  pollfd answer{.fd = connection.get(), .events = POLLIN, .revents = 0};
  if (poll(&answer, 1, kLongestAnswer) <= 0) return false;
  std::array<char, 64> text{};
  const ssize_t size = recv(connection.get(), text.data(), text.size(), MSG_DONTWAIT);
  return size > 0 && std::string_view(text.data(), static_cast<std::size_t>(size)) == kDone;
}

}  // namespace hlm::server
