// The directions in which a device's handle or a tool's hand moves.
#pragma once

#include <cstdint>
#include <string>

#include "hlm/common/tool_model.h"

namespace hlm {

/// One bit for each direction in the world: bits 0 to 2 translation along x, y and z, bits 3 to 5
/// rotation about them.
using Freedoms = std::uint8_t;
inline constexpr Freedoms kAllFreedoms = 0b111111;
/// The freedoms in the x-y plane: along x and y, about z.
inline constexpr Freedoms kPlanarFreedoms = 0b100011;

/// The directions in which the tool's hand can be moved as the tool stands.
Freedoms freedoms_of(const ToolModel& tool) noexcept;

/// The tool's freedoms in which a device does not move.
inline Freedoms missing_freedoms(const ToolModel& tool, Freedoms device) noexcept {
  return static_cast<Freedoms>(freedoms_of(tool) & ~device);
}

/// What a person should know of a tool whose hand moves in directions in which the device does not:
/// "tool and device do not match: the tool also moves along z and about x, y, the device does not".
std::string describe_mismatch(Freedoms missing);

}  // namespace hlm
