// The largest coefficient of friction that a packet has.
#pragma once

namespace hlm {

/// A body on a slope of 84° rests with it. World files have up to 1e5 to say "never slips".
inline constexpr double kLargestFriction = 10;

/// The coefficient as a packet has it; NaN stays, to be refused.
constexpr double usable_friction(double coefficient) noexcept {
  return coefficient > kLargestFriction ? kLargestFriction : coefficient;
}

}  // namespace hlm
