#include "hlm/devices/haply_messages.h"

#include <cmath>
#include <stdexcept>

#include <nlohmann/json.hpp>

#include "hlm/common/one_line.h"

namespace hlm::server {
namespace {

using nlohmann::json;

constexpr const char* kDeviceKinds[] = {"inverse3", "minverse"};
constexpr const char* kTakenForce = "current_cursor_force";
/// Levels of a message; a state has 5.
constexpr int kDeepest = 32;
/// Length of an id, bytes: it is in every request and in many messages to people.
constexpr std::size_t kLongestId = 100;
constexpr const char* kGripKinds[] = {"wireless_verse_grip", "verse_grip", "custom_verse_grip"};

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

const json& device_of(const json& message, const std::string& kind, const std::string& id) {
  for (const json& device : list(message, kind)) {
    if (id_of(device, kind) == id) return device;
  }
  const auto error = message.find("error");
  if (error != message.end()) fail("reports an error: " + error->dump());
  fail("has " + kind + " '" + id + "' no more: it is unplugged or switched off");
}

/// Null where the message leaves it out.
const json* find(const json& object, const char* key) {
  const auto found = object.find(key);
  return found == object.end() ? nullptr : &*found;
}

/// What the service says that keeps a device from giving force; null if nothing. before: what it
/// said last, where it says nothing now.
const char* find_force_off(const json& device, const char* before) {
  struct Need {
    const char* key;
    const char* cause;
  };
  constexpr Need kNeeds[] = {
      {"power_supply", "its power supply is off"},
      {"calibrated", "it is not calibrated: put its cursor where its manual says"},
      {"ready", "its service says that it is not ready"}};
  const auto status = device.find("status");
  if (status == device.end() || !status->is_object()) return before;
  for (const Need& need : kNeeds) {
    const auto found = status->find(need.key);
    if (found != status->end() && found->is_boolean() && !found->get<bool>()) return need.cause;
  }
  return nullptr;
}

std::string text_of(const json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : "";
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

/// The button of that name: a is the first.
std::uint32_t button_of(const json& name) {
  if (!name.is_string() || name.get<std::string>().size() != 1) return 0;
  const int number = name.get<std::string>()[0] - 'a';
  return number >= 0 && number < 32 ? 1u << number : 0;
}

/// Those pressed; json keeps members in the order of their names. A list has a bool for each, or
/// the names of those that are down.
std::uint32_t buttons(const json& state, std::uint32_t before, const std::string& path) {
  const auto found = state.find("buttons");
  const auto only = state.find("button");
  if (only != state.end() && only->is_boolean()) return only->get<bool>() ? 1 : 0;
  if (found == state.end() || found->is_null()) return before;
  if (!found->is_structured()) fail("has " + path + "buttons that are no object and no list");
  std::uint32_t pressed = 0;
  std::uint32_t bit = 1;
  for (const json& button : *found) {
    if (button.is_boolean() && button.get<bool>()) pressed |= bit;
    if (button.is_boolean()) bit <<= 1;
    if (found->is_array()) pressed |= button_of(button);
  }
  return pressed;
}

/// The scale of a transform or a mount; 1 where it leaves that out, `before` where there is none.
double scale_of(const json& object, const char* key, double before, const std::string& path) {
  const json* const transform = find(object, key);
  if (transform == nullptr || !transform->is_object()) return before;
  if (find(*transform, "scale") == nullptr) return 1;
  const Vector3 scale = vector(*transform, "scale", path + key + ".");
  constexpr double kSame = 1e-6;
  const bool is_uniform = (scale.array() - scale.x()).abs().maxCoeff() <= kSame * scale.x();
  if (scale.allFinite() && scale.x() > 0 && is_uniform) return scale.x();
  fail("has " + path + key + ".scale " + transform->at("scale").dump() +
       ", must be one positive number in all directions");
}

/// Where the handle is, and how fast it goes, in what the service calls metres.
void read_motion(const json& state, bool is_inventory, const std::string& path, HaplyState& whole) {
  const double scale = whole.mount_scale * whole.session_scale;
  HandleState& handle = whole.handle;
  const Vector3 before = handle.X.p;
  // Who leaves out zeros says other things of the device.
  const bool says_others = find(state, "angular_position") != nullptr;
  const bool leaves_out = is_inventory || whole.has_place || says_others;
  const bool moves = find(state, "cursor_position") != nullptr;
  if (moves || !leaves_out) handle.X.p = vector(state, "cursor_position", path) / scale;
  const bool goes = find(state, "cursor_velocity") != nullptr;
  if (goes || !leaves_out) handle.V.head<3>() = vector(state, "cursor_velocity", path) / scale;
  if (!goes && leaves_out && moves && handle.X.p == before) handle.V.head<3>().setZero();
  whole.has_place = whole.has_place || moves || says_others || !is_inventory;
}

/// What one device is asked, as a list of devices.
json commands(const std::string& device, const json& commands) {
  return json::array({{{"device_id", device}, {"commands", commands}}});
}

}  // namespace

HaplyInventory parse_haply_inventory(std::string_view message) {
  const json parsed = parse(message);
  HaplyInventory inventory;
  inventory.has_session = parsed.contains("session_id");
  inventory.text = message;
  for (const char* kind : kDeviceKinds) {
    for (const json& device : list(parsed, kind)) {
      HaplyDevice& entry = inventory.devices.emplace_back();
      entry.kind = kind;
      entry.id = id_of(device, kind);
      const json config = device.value("config", json::object());
      const auto handedness = config.find("handedness");
      if (handedness != config.end() && handedness->is_string()) entry.handedness = *handedness;
    }
  }
  for (const char* kind : kGripKinds) {
    for (const json& grip : list(parsed, kind)) {
      inventory.grips.push_back({id_of(grip, kind), kind});
    }
  }
  return inventory;
}

HaplyState parse_haply_state(std::string_view message, const HaplyChoice& choice,
                             const HaplyState& before) {
  const json parsed = parse(message);
  const json& device = device_of(parsed, choice.device_kind, choice.device);
  const std::string path = choice.device_kind + "[].";
  HaplyState whole = before;
  whole.handle.force_off = find_force_off(device, before.handle.force_off);
  const json* const config = find(device, "config");
  const bool is_inventory = config != nullptr && config->is_object();
  if (is_inventory) {
    whole.mount_scale = scale_of(*config, "mount", before.mount_scale, path + "config.");
  }
  static const json nothing = json::object();
  const json* const said = find(device, "state");
  if (said == nullptr && !before.has_place && !is_inventory) fail("has no " + path + "state");
  const json& state = said != nullptr ? *said : nothing;
  whole.session_scale = scale_of(state, "transform", before.session_scale, path + "state.");
  if (state.contains(kTakenForce)) whole.force = vector(state, kTakenForce, path + "state.");
  read_motion(state, is_inventory, path + "state.", whole);
  if (choice.grip.empty()) return whole;
  const json& grip = device_of(parsed, choice.grip_kind, choice.grip);
  const std::string grip_path = choice.grip_kind + "[].state.";
  const json* const held = find(grip, "state");
  if (held == nullptr) return whole;
  if (held->contains("orientation") || (!before.has_place && !is_inventory)) {
    whole.handle.X.R = orientation(*held, grip_path);
  }
  whole.handle.buttons = buttons(*held, before.handle.buttons, grip_path);
  return whole;
}

HaplyEvent parse_haply_event(std::string_view message) {
  const json parsed = parse(message);
  const json data = parsed.value("data", json::object());
  HaplyEvent event{text_of(parsed, "name"), "", "", text_of(parsed, "message"),
                   text_of(parsed, "level")};
  if (!data.is_object()) return event;
  event.device = text_of(data, "device_id");
  event.safety = text_of(data, "safety_type");
  return event;
}

std::string haply_force_request(const HaplyChoice& choice, const std::string& force_field,
                                const Vector3& force) {
  const json components = {{"x", force.x()}, {"y", force.y()}, {"z", force.z()}};
  return json{{choice.device_kind,
               commands(choice.device, {{"set_cursor_force", {{force_field, components}}}})}}
      .dump();
}

std::string haply_probe_request(const HaplyChoice& choice) {
  json request{{choice.device_kind, commands(choice.device, {{"probe_position", json::object()}})}};
  if (!choice.grip.empty()) {
    request[choice.grip_kind] = commands(choice.grip, {{"probe_orientation", json::object()}});
  }
  return request.dump();
}

std::string haply_inventory_request() {
  return json{{"session", {{"force_render_full_state", json::object()}}}}.dump();
}

std::string with_haply_profile(const std::string& request) {
  json named = json::parse(request);
  named["session"]["configure"]["profile"]["name"] = "haptic_server";
  return named.dump();
}

std::optional<double> parse_haply_setting(std::string_view message) {
  const json parsed = json::parse(message, nullptr, false);
  const json* value = &parsed;
  for (const char* key : {"data", "value"}) {
    if (value->is_object() && value->contains(key)) value = &value->at(key);
  }
  return value->is_number() ? std::optional(value->get<double>()) : std::nullopt;
}

}  // namespace hlm::server
