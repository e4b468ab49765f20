#include "hlm/page/web/local_user.h"

#include <array>
#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

#include <arpa/inet.h>
#include <unistd.h>

namespace hlm::ve {
namespace {

using Text = std::array<char, 64>;

/// As /proc/net/tcp has it: the address in the network's order, read as a number of this machine.
std::string v4(const ConnectionEnd& end) {
  Text text{};
  std::snprintf(text.data(), text.size(), "%08" PRIX32 ":%04X", htonl(end.address), end.port);
  return text.data();
}

/// The same of a socket of IPv6 that speaks IPv4.
std::string v4_in_v6(const ConnectionEnd& end) {
  Text text{};
  std::snprintf(text.data(), text.size(), "0000000000000000%08" PRIX32 "%08" PRIX32 ":%04X",
                htonl(0xFFFF), htonl(end.address), end.port);
  return text.data();
}

/// Of the socket that a table of the kernel has between these two.
std::optional<uid_t> user_in(const char* table, const std::string& local,
                             const std::string& remote) {
  std::ifstream lines(table);
  std::string line;
  while (std::getline(lines, line)) {
    Text found_local{};
    Text found_remote{};
    unsigned user = 0;
    unsigned long inode = 0;
    const int read = std::sscanf(line.c_str(), " %*d: %63s %63s %*s %*s %*s %*s %u %*d %lu",
                                 found_local.data(), found_remote.data(), &user, &inode);
    if (read != 4 || local != found_local.data() || remote != found_remote.data()) continue;
    // One that its process has closed is nobody's: the table says root.
    return inode != 0 ? std::optional<uid_t>(user) : std::nullopt;
  }
  return std::nullopt;
}

}  // namespace

std::optional<uid_t> user_of_other_end(const ConnectionEnd& own, const ConnectionEnd& other) {
  if (const auto user = user_in("/proc/net/tcp", v4(other), v4(own))) return user;
  return user_in("/proc/net/tcp6", v4_in_v6(other), v4_in_v6(own));
}

bool is_own_user(uid_t user) {
  if (user == 0 || user == geteuid()) return true;
  const char* const person = std::getenv("SUDO_UID");
  return geteuid() == 0 && person != nullptr && std::to_string(user) == person;
}

}  // namespace hlm::ve
