#include "hlm/protocol/random_identifier.h"

#include <cerrno>
#include <cstdlib>

#include <sys/random.h>

namespace hlm::protocol {

std::uint64_t random_identifier() noexcept {
  std::uint64_t number = 0;
  while (number == 0) {
    // A few bytes come whole, once the system has booted.
    const auto size = getrandom(&number, sizeof number, GRND_NONBLOCK);
    const bool again = size < 0 && (errno == EINTR || errno == EAGAIN);
    if (size != static_cast<ssize_t>(sizeof number) && !again) std::abort();
    if (again) number = 0;
  }
  return number;
}

}  // namespace hlm::protocol
