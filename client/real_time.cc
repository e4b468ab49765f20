// What libhaptic.so has around its sessions.
#include "hlm/client/surroundings.h"

namespace hlm {

std::unique_ptr<Surroundings> surroundings_at(const std::string& address, double) {
  return real_surroundings(address);
}

}  // namespace hlm
