#include "haptic_server/loop/state_names.h"

#include <cstdlib>

namespace hlm::server {

std::string_view state_name(protocol::ServerState state) noexcept {
  switch (state) {
    case protocol::ServerState::kIdle:
      return "idle";
    case protocol::ServerState::kRunning:
      return "running";
    case protocol::ServerState::kSilent:
      return "silent";
    case protocol::ServerState::kFault:
      return "fault";
  }
  std::abort();
}

std::string_view state_name(protocol::Fault fault) noexcept {
  switch (fault) {
    case protocol::Fault::kNone:
      return "none";
    case protocol::Fault::kNonFinite:
      return "non_finite";
    case protocol::Fault::kOverrun:
      return "overrun";
    case protocol::Fault::kDevice:
      return "device";
  }
  std::abort();
}

std::string_view state_name(protocol::ProxyContactState state) noexcept {
  switch (state) {
    case protocol::ProxyContactState::kFreeMotion:
      return "free_motion";
    case protocol::ProxyContactState::kColliding:
      return "colliding";
    case protocol::ProxyContactState::kResting:
      return "resting";
  }
  std::abort();
}

}  // namespace hlm::server
