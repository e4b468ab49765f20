#pragma once

#include <chrono>

namespace hlm::protocol {

/// A steady clock, s.
inline double steady_seconds() noexcept {
  using Seconds = std::chrono::duration<double>;
  return Seconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace hlm::protocol
