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
  std::string kind;  ///< "wireless_verse_grip", "verse_grip" or "custom_verse_grip".
};
struct HaplyInventory {
  std::vector<HaplyDevice> devices;
  std::vector<HaplyGrip> grips;
  bool has_session = false;  ///< It numbers its sessions, as services of 3.5 do.
};

/// The device and grip whose replies are read.
struct HaplyChoice {
  std::string device;
  std::string grip{};  ///< Empty: none, the handle has no orientation and no buttons.
  std::string grip_kind{};
};

/// Throws std::runtime_error that names what is wrong in the message, as all of these.
HaplyInventory parse_haply_inventory(std::string_view message);

/// A state, and what the service says of itself.
struct HaplyState {
  HandleState handle;
  std::optional<Vector3> force;  ///< The force that it took last, N; empty: it does not say.
};

/// Position in m and velocity in m/s, in the frame that the service has for the device; orientation
/// and buttons are the grip's. Bit i of the buttons
/// is the i-th in the order of their names; a wired grip has one. The angular velocity is zero.
/// Motors are off where the service says of the device that it has no power, or is not calibrated
/// or ready.
HaplyState parse_haply_state(std::string_view message, const HaplyChoice& choice);

/// What the service pushes at its other port when something happens.
struct HaplyEvent {
  std::string name;    ///< "device-busy".
  std::string device;  ///< Id; empty: of none.
  std::string safety;  ///< Of "device-safety-triggered": "ebrake_triggered".
  std::string text;    ///< For a person.
};
HaplyEvent parse_haply_event(std::string_view message);

/// The request for a force, N, in the device's frame. force_field: "vector", or "values", as older
/// services call it.
std::string haply_force_request(const std::string& device, const std::string& force_field,
                                const Vector3& force);

/// The request for a state alone.
std::string haply_probe_request(const HaplyChoice& choice);

}  // namespace hlm::server
