// Messages of Haply's Inverse Service 3: JSON, one for each request and reply.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hlm/device/exchange_device.h"

namespace hlm::server {

/// What the service's first message says of one Inverse3 or Minverse.
struct HaplyDevice {
  std::string id;
  std::string handedness;  ///< "left" or "right"; empty: it does not say.
};
struct HaplyGrip {
  std::string id;
  std::string kind;  ///< "wireless_verse_grip" or "verse_grip".
};
struct HaplyInventory {
  std::vector<HaplyDevice> devices;
  std::vector<HaplyGrip> grips;
};

/// The device and grip whose replies are read.
struct HaplyChoice {
  std::string device;
  std::string grip{};  ///< Empty: none, the handle has no orientation and no buttons.
  std::string grip_kind{};
};

/// Throws std::runtime_error that names what is wrong in the message, as all of these.
HaplyInventory parse_haply_inventory(std::string_view message);

/// Position in m and velocity in m/s, in the frame that the service has for the device; orientation
/// and buttons are the grip's. Bit i of the buttons
/// is the i-th in the order of their names. The angular velocity is zero.
HandleState parse_haply_state(std::string_view message, const HaplyChoice& choice);

/// The request for a force, N, in the device's frame. force_field: "vector", or "values", as older
/// services call it.
std::string haply_force_request(const std::string& device, const std::string& force_field,
                                const Vector3& force);

/// The request for a state alone.
std::string haply_probe_request(const HaplyChoice& choice);

}  // namespace hlm::server
