#pragma once

#include <chrono>

namespace hlm {

/// A steady clock, s, any origin.
inline double steady_seconds() noexcept {
  using Seconds = std::chrono::duration<double>;
  return Seconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace hlm
