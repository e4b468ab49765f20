// The numbers that tell sessions apart, and that nobody else can guess.
#pragma once

#include <cstdint>

namespace hlm::protocol {

/// A number from the system's random source, never 0. Neither waits nor allocates.
std::uint64_t random_identifier() noexcept;

}  // namespace hlm::protocol
