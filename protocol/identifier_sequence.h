// The numbers that tell sessions apart: each follows from the one before, so that a replay draws
// the same, and none repeats for a long time.
#pragma once

#include <cstdint>

namespace hlm::protocol {

/// The number after `number`, never 0 (SplitMix64; Steele, Lea, Flood 2014).
constexpr std::uint64_t next_identifier(std::uint64_t number) noexcept {
  number += 0x9E3779B97F4A7C15u;
  number = (number ^ (number >> 30)) * 0xBF58476D1CE4E5B9u;
  number = (number ^ (number >> 27)) * 0x94D049BB133111EBu;
  number ^= number >> 31;
  return number == 0 ? 1 : number;
}

}  // namespace hlm::protocol
