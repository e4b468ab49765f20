#include "hlm/devices/diy_frames.h"

#include <bit>
#include <cmath>
#include <numbers>

#include <boost/endian/conversion.hpp>

namespace hlm::server {
namespace {

/// Ports 1 and 2: bit i is port i + 1.
constexpr std::uint8_t kPorts = 0b11;
constexpr double kDegree = std::numbers::pi / 180;

/// A frame's values are in the order of the ports: port 1 first.
constexpr int arm_at(int place) { return 1 - place; }

static_assert(sizeof(float) == sizeof(std::uint32_t));

void put(std::uint8_t* bytes, double value) noexcept {
  boost::endian::store_little_u32(bytes, std::bit_cast<std::uint32_t>(static_cast<float>(value)));
}

double get(const std::uint8_t* bytes) noexcept {
  return static_cast<double>(std::bit_cast<float>(boost::endian::load_little_u32(bytes)));
}

Vector2 get_pair(const std::uint8_t* bytes) noexcept {
  Vector2 pair;
  for (int place = 0; place < 2; ++place) pair[arm_at(place)] = get(bytes + 4 * place);
  return pair;
}

void put_pair(std::uint8_t* bytes, const Vector2& pair) noexcept {
  for (int place = 0; place < 2; ++place) put(bytes + 4 * place, pair[arm_at(place)]);
}

/// Where the two lists of ports and directions are in a setup, and its numbers.
constexpr std::size_t kMotors = 2;
constexpr std::size_t kEncoders = 5;
constexpr std::size_t kNumbers = 10;

}  // namespace

DiySetupFrame encode(std::uint8_t board, const DiySetup& setup) noexcept {
  DiySetupFrame frame{kDiySetup, board};
  frame[kMotors] = frame[kEncoders] = kPorts;
  for (int place = 0; place < 2; ++place) {
    const auto at = static_cast<std::size_t>(place);
    const auto arm = static_cast<std::size_t>(arm_at(place));
    const std::uint8_t counter_clockwise = setup.clockwise[arm] ? 0 : 1;
    frame[kMotors + 1 + at] = frame[kEncoders + 1 + at] = counter_clockwise;
    put(&frame[kNumbers + 8 * at], setup.offset[arm]);
    put(&frame[kNumbers + 8 * at + 4], setup.resolution);
  }
  return frame;
}

DiyTorqueFrame encode_torques(std::uint8_t board, const Vector2& torques) noexcept {
  DiyTorqueFrame frame{kDiyTorques, board};
  put_pair(&frame[2], torques);
  return frame;
}

DiyAngleFrame encode_angles(std::uint8_t board, const Vector2& theta) noexcept {
  DiyAngleFrame frame{board};
  put_pair(&frame[1], theta / kDegree);
  return frame;
}

std::optional<Vector2> decode_angles(std::uint8_t board, const DiyAngleFrame& frame) noexcept {
  const Vector2 theta = kDegree * get_pair(&frame[1]);
  if (frame[0] != board || !theta.allFinite()) return std::nullopt;
  return theta;
}

std::optional<Vector2> decode_torques(std::uint8_t board, const DiyTorqueFrame& frame) noexcept {
  const Vector2 torques = get_pair(&frame[2]);
  if (frame[0] != kDiyTorques || frame[1] != board || !torques.allFinite()) return std::nullopt;
  return torques;
}

std::optional<DiySetup> decode_setup(std::uint8_t board, const DiySetupFrame& frame) noexcept {
  if (frame[0] != kDiySetup || frame[1] != board) return std::nullopt;
  if (frame[kMotors] != kPorts || frame[kEncoders] != kPorts) return std::nullopt;
  DiySetup setup;
  for (int place = 0; place < 2; ++place) {
    const auto at = static_cast<std::size_t>(place);
    const auto arm = static_cast<std::size_t>(arm_at(place));
    setup.clockwise[arm] = frame[kEncoders + 1 + at] == 0;
    setup.offset[arm] = get(&frame[kNumbers + 8 * at]);
    setup.resolution = get(&frame[kNumbers + 8 * at + 4]);
  }
  return setup;
}

}  // namespace hlm::server
