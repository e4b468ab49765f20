// Messages of Haply's Inverse Service 3: JSON, one for each request and reply.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hlm/devices/exchange_device.h"

namespace hlm::server {

/// What the service's first message says of one Inverse3 or Minverse.
struct HaplyDevice {
  std::string id;
  std::string handedness;         ///< "left" or "right"; empty: it does not say.
  std::string kind = "inverse3";  ///< The list that it is in; "minverse" with some services.
};
struct HaplyGrip {
  std::string id;
  std::string kind;  ///< "wireless_verse_grip", "verse_grip" or "custom_verse_grip".
};
struct HaplyInventory {
  std::vector<HaplyDevice> devices;
  std::vector<HaplyGrip> grips;
  bool has_session = false;  ///< It numbers its sessions, as services of 3.5 do.
  std::string text{};        ///< The message: it has a state, too.
};

/// The device and grip whose replies are read.
struct HaplyChoice {
  std::string device;
  std::string grip{};  ///< Empty: none, the handle has no orientation and no buttons.
  std::string grip_kind{};
  std::string device_kind = "inverse3";
};

/// Throws std::runtime_error that names what is wrong in the message, as all of these.
HaplyInventory parse_haply_inventory(std::string_view message);

/// A state, and what the service says of itself.
struct HaplyState {
  HandleState handle;
  std::optional<Vector3> force;  ///< The force that it took last, N; empty: it does not say.
  /// Metres that it says for each metre of the handle, of its mount and of this session's
  /// transform. Pose and velocity are divided by both.
  double mount_scale = 1;
  double session_scale = 1;
  bool has_place = false;  ///< It has said where the handle is.
};

/// Position in m and velocity in m/s of the handle, in the frame that the service has for the
/// device; orientation and buttons are the grip's. Bit i of the buttons is the i-th in the order of
/// their names, or of their list; a wired grip has one. The angular velocity is zero. Motors are
/// off where the service says of the device that it has no power, or is not calibrated or ready.
/// before: the latest state. What a message leaves out has not changed; a velocity that is left out
/// while the position stands is zero.
HaplyState parse_haply_state(std::string_view message, const HaplyChoice& choice,
                             const HaplyState& before = {});

/// What the service pushes at its other port when something happens.
struct HaplyEvent {
  std::string name;     ///< "device-busy".
  std::string device;   ///< Id; empty: of none.
  std::string safety;   ///< Of "device-safety-triggered": "ebrake_triggered".
  std::string text;     ///< For a person.
  std::string level{};  ///< "info", "warning" or "error"; empty: it does not say.
  /// What was triggered, however the service puts it.
  const std::string& what() const { return safety.empty() ? name : safety; }
};
HaplyEvent parse_haply_event(std::string_view message);

/// The request for a force, N, in the device's frame. force_field: "vector", or "values", as older
/// services call it.
std::string haply_force_request(const HaplyChoice& choice, const std::string& force_field,
                                const Vector3& force);

/// The request for a state alone.
std::string haply_probe_request(const HaplyChoice& choice);
/// The request for another inventory.
std::string haply_inventory_request();
/// A request that also names this session to the service, as its other programs show it.
std::string with_haply_profile(const std::string& request);

/// The number in what the service answers about a setting: itself, or somewhere within; empty if
/// there is none.
std::optional<double> parse_haply_setting(std::string_view message);

}  // namespace hlm::server
