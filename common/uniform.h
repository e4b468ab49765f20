// Uniformly drawn numbers that are the same on every platform.
#pragma once

#include <random>

namespace hlm {

/// A number in [0, 1). Not std::uniform_real_distribution: it differs between standard libraries.
inline double uniform(std::mt19937_64& engine) {
  constexpr double kTwoToMinus53 = 0x1.0p-53;
  return static_cast<double>(engine() >> 11) * kTwoToMinus53;
}

/// A number in [low, high).
inline double uniform(std::mt19937_64& engine, double low, double high) {
  return low + (high - low) * uniform(engine);
}

}  // namespace hlm
