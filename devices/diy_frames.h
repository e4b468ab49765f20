// Frames of the Haply 2DIY's board over its serial port: docs/devices.md has them byte by byte.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "hlm/devices/pantograph.h"

namespace hlm::server {

/// How the board counts its encoders. Index 0 is the arm on port 2, index 1 that on port 1, as the
/// kit is wired.
struct DiySetup {
  std::array<double, 2> offset{168, 12};  ///< Angle of each arm when the board is set up, degrees.
  double resolution = 4880;               ///< Counts in a turn.
  std::array<bool, 2> clockwise{false, false};  ///< Which way each arm's motor and encoder count.
};

using DiySetupFrame = std::array<std::uint8_t, 26>;
using DiyTorqueFrame = std::array<std::uint8_t, 10>;
using DiyAngleFrame = std::array<std::uint8_t, 9>;

DiySetupFrame encode(std::uint8_t board, const DiySetup& setup) noexcept;
/// Torques of the two motors, N·m.
DiyTorqueFrame encode_torques(std::uint8_t board, const Vector2& torques) noexcept;
DiyAngleFrame encode_angles(std::uint8_t board, const Vector2& theta) noexcept;

/// Angles of the two arms, rad; empty if the frame is another board's or an angle is not finite.
std::optional<Vector2> decode_angles(std::uint8_t board, const DiyAngleFrame& frame) noexcept;

/// What a board takes. Empty if the frame is another board's, or a torque is not finite.
std::optional<Vector2> decode_torques(std::uint8_t board, const DiyTorqueFrame& frame) noexcept;
/// Empty if the frame is no setup of two motors and encoders of this board.
std::optional<DiySetup> decode_setup(std::uint8_t board, const DiySetupFrame& frame) noexcept;

inline constexpr std::uint8_t kDiySetup = 1;    ///< First byte of a setup,
inline constexpr std::uint8_t kDiyTorques = 2;  ///< and of torques.

}  // namespace hlm::server
