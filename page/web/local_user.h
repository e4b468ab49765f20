// Which user of this machine has a TCP connection, as the kernel says.
#pragma once

#include <cstdint>
#include <optional>

#include <sys/types.h>

namespace hlm::ve {

/// An end of a connection, IPv4, host byte order.
struct ConnectionEnd {
  std::uint32_t address = 0;
  std::uint16_t port = 0;
};

/// The user who opened the other end of a connection within this machine; none if nobody here has
/// it, or has closed it. own: this program's end.
std::optional<uid_t> user_of_other_end(const ConnectionEnd& own, const ConnectionEnd& other);

/// Whether a user may do what this program's own may: that user, root, and who ran it by sudo.
bool is_own_user(uid_t user);

}  // namespace hlm::ve
