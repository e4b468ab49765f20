#include "hlm/device/haply_messages.h"

#include <cmath>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "hlm/common/one_line.h"

namespace hlm::server {
namespace {

using nlohmann::json;

constexpr const char* kDevices = "inverse3";
/// Levels of a message; a state has 5.
constexpr int kDeepest = 32;
/// Length of an id, bytes: it is in every request and in many messages to people.
constexpr std::size_t kLongestId = 100;
constexpr const char* kGripKinds[] = {"wireless_verse_grip", "verse_grip"};

[[noreturn]] void fail(const std::string& what) {
  throw std::runtime_error("the Inverse Service's message " + one_line(what));
}

/// A member of an object; `path` is that of the object.
const json& member(const json& object, const char* key, const std::string& path) {
  const auto found = object.find(key);
  if (found == object.end()) fail("has no " + path + key);
  return *found;
}

double number(const json& object, const char* key, const std::string& path) {
  const json& value = member(object, key, path);
  if (!value.is_number()) fail("has " + path + key + " " + value.dump() + ", must be a number");
  return value.get<double>();
}

Vector3 vector(const json& state, const char* key, const std::string& path) {
  const json& value = member(state, key, path);
  const std::string of_it = path + key + ".";
  return {number(value, "x", of_it), number(value, "y", of_it), number(value, "z", of_it)};
}

/// Called for each part of a message. Writing a value out takes stack for each level.
bool is_shallow(int depth, json::parse_event_t, const json&) {
  if (depth > kDeepest) fail("is nested more than " + std::to_string(kDeepest) + " levels deep");
  return true;
}

json parse(std::string_view message) {
  try {
    json parsed = json::parse(message, is_shallow);
    if (parsed.is_object()) return parsed;
  } catch (const json::exception& error) {
    fail(std::string("is not JSON: ") + error.what());
  }
  fail("is JSON, but no object");
}

/// The devices of a kind; none where the message does not have the kind.
const json& list(const json& message, const std::string& kind) {
  static const json nothing = json::array();
  const auto found = message.find(kind);
  if (found == message.end()) return nothing;
  if (!found->is_array()) fail("has " + kind + " that is no list");
  return *found;
}

std::string id_of(const json& device, const std::string& kind) {
  const json& id = member(device, "device_id", kind + "[].");
  if (!id.is_string()) fail("has " + kind + "[].device_id " + id.dump() + ", must be a text");
  const std::string text = id.get<std::string>();
  if (text.size() > kLongestId || one_line(text) != text) {
    fail("has " + kind + "[].device_id " + id.dump() + ", must be " + std::to_string(kLongestId) +
         " bytes at most, without control characters");
  }
  return text;
}

const json& state_of(const json& message, const std::string& kind, const std::string& id) {
  for (const json& device : list(message, kind)) {
    if (id_of(device, kind) == id) return member(device, "state", kind + "[].");
  }
  const auto error = message.find("error");
  if (error != message.end()) fail("reports an error: " + error->dump());
  fail("has " + kind + " '" + id + "' no more: it is unplugged or switched off");
}

Quaternion orientation(const json& state, const std::string& path) {
  const Vector3 imaginary = vector(state, "orientation", path);
  const double real = number(state["orientation"], "w", path + "orientation.");
  const Quaternion R(real, imaginary.x(), imaginary.y(), imaginary.z());
  if (!(std::abs(R.norm() - 1) < kUnitTolerance)) {
    fail("has " + path + "orientation of length " + std::to_string(R.norm()) + ", must be 1");
  }
  return R.normalized();
}

/// Those pressed; json keeps members in the order of their names.
std::uint32_t buttons(const json& state, const std::string& path) {
  const auto found = state.find("buttons");
  if (found == state.end()) return 0;
  if (!found->is_object()) fail("has " + path + "buttons that are no object");
  std::uint32_t pressed = 0;
  std::uint32_t bit = 1;
  for (const json& button : *found) {
    if (button.is_boolean() && button.get<bool>()) pressed |= bit;
    if (button.is_boolean()) bit <<= 1;
  }
  return pressed;
}

/// What one device is asked, as a list of devices.
json commands(const std::string& device, const json& commands) {
  return json::array({{{"device_id", device}, {"commands", commands}}});
}

}  // namespace

HaplyInventory parse_haply_inventory(std::string_view message) {
  const json parsed = parse(message);
  HaplyInventory inventory;
  for (const json& device : list(parsed, kDevices)) {
    HaplyDevice& entry = inventory.devices.emplace_back();
    entry.id = id_of(device, kDevices);
    const json config = device.value("config", json::object());
    const auto handedness = config.find("handedness");
    if (handedness != config.end() && handedness->is_string()) entry.handedness = *handedness;
  }
  for (const char* kind : kGripKinds) {
    for (const json& grip : list(parsed, kind)) {
      inventory.grips.push_back({id_of(grip, kind), kind});
    }
  }
  return inventory;
}

HandleState parse_haply_state(std::string_view message, const HaplyChoice& choice) {
  const json parsed = parse(message);
  const json& state = state_of(parsed, kDevices, choice.device);
  const std::string path = std::string(kDevices) + "[].state.";
  HandleState handle;
  handle.X.p = vector(state, "cursor_position", path);
  handle.V.head<3>() = vector(state, "cursor_velocity", path);
  if (choice.grip.empty()) return handle;
  const json& grip = state_of(parsed, choice.grip_kind, choice.grip);
  const std::string grip_path = choice.grip_kind + "[].state.";
  handle.X.R = orientation(grip, grip_path);
  handle.buttons = buttons(grip, grip_path);
  return handle;
}

std::string haply_force_request(const std::string& device, const std::string& force_field,
                                const Vector3& force) {
  const json components = {{"x", force.x()}, {"y", force.y()}, {"z", force.z()}};
  return json{{kDevices, commands(device, {{"set_cursor_force", {{force_field, components}}}})}}
      .dump();
}

std::string haply_probe_request(const HaplyChoice& choice) {
  json request{{kDevices, commands(choice.device, {{"probe_position", json::object()}})}};
  if (!choice.grip.empty()) {
    request[choice.grip_kind] = commands(choice.grip, {{"probe_orientation", json::object()}});
  }
  return request.dump();
}

}  // namespace hlm::server
