#include "hlm/page/page_requests.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <nlohmann/json.hpp>

#include "hlm/page/methods.h"

namespace hlm::ve {
namespace {

using nlohmann::json;

/// Thrown within this file only.
struct Refused {
  Refusal refusal;
};

[[noreturn]] void refuse(const std::string& field, const json& value, const std::string& allowed) {
  const std::string given = value.dump(-1, ' ', false, json::error_handler_t::replace);
  throw Refused{{field, given, field + " " + given + " must be " + allowed}};
}

double number(const char* name, const json& value, const Range& range) {
  if (!value.is_number() || !range.contains(value.get<double>())) {
    refuse(name, value, to_string(range));
  }
  return value.get<double>();
}

template <class Enum>
Enum choice(const std::string& field, const json& value) {
  std::string names;
  for (const Word<Enum>& word : kWords<Enum>) {
    if (value == word.name) return word.value;
    names.append(names.empty() ? "" : ", ").append(word.name);
  }
  refuse(field, value, names);
}

bool flag(const json& message, const char* field) {
  const json value = message.value(field, json());
  if (!value.is_boolean()) refuse(field, value, "true or false");
  return value.get<bool>();
}

/// So many numbers, each within the room for hands and bodies; `what` they are, for a refusal.
json numbers(const json& message, const char* field, std::size_t count, const char* what) {
  constexpr double kFarthest = 10;  // m
  const json list = message.value(field, json());
  const bool fits = list.is_array() && list.size() == count &&
                    std::all_of(list.begin(), list.end(), [](const json& n) {
                      return n.is_number() && std::abs(n.get<double>()) <= kFarthest;
                    });
  if (!fits) refuse(field, list, what);
  return list;
}

HandRequest hand(const json& message) {
  if (!flag(message, "hold")) return {};
  const json target =
      numbers(message, "target", 7, "7 numbers: x, y, z within 10 m, and a unit quaternion");
  const auto at = [&](std::size_t i) { return target[i].get<double>(); };
  Pose X;
  X.p = {at(0), at(1), at(2)};
  X.R = Quaternion(at(3), at(4), at(5), at(6));
  constexpr double kTolerance = 1e-3;
  if (std::abs(X.R.norm() - 1) > kTolerance) refuse("target", target, "a unit quaternion");
  X.R.normalize();
  return {X, message.contains("grab") && flag(message, "grab")};
}

constexpr const char* kForLinkages = ": the tool has several links, the device cannot replace it";

LiveSettings with_method(const json& name, const LiveSettings& settings, const WorldTraits& world) {
  std::string allowed;
  for (const Method& method : kMethods) {
    if (!method.on_page || !suits(method.controller, world.links)) continue;
    if (name == method.name) return with_method(method, settings);
    allowed.append(allowed.empty() ? "" : ", ").append(method.name);
  }
  refuse("name", name, allowed.append(world.links == 1 ? "" : kForLinkages));
}

ControllerKind controller(const json& value, const WorldTraits& world) {
  const auto wanted = choice<ControllerKind>("controller", value);
  if (suits(wanted, world.links)) return wanted;
  std::string allowed;
  for (const Word<ControllerKind>& word : kWords<ControllerKind>) {
    if (!suits(word.value, world.links)) continue;
    allowed.append(allowed.empty() ? "" : ", ").append(word.name);
  }
  refuse("controller", value, allowed.append(kForLinkages));
}

LiveSettings with_tuning(const json& message, LiveSettings settings, const WorldTraits& world) {
  Tuning& tuning = settings.tuning;
  for (const auto& item : message.items()) {
    const std::string& field = item.key();
    const json& value = item.value();
    if (field == "type") continue;
    if (field == "update_rule") {
      tuning.update_rule = choice<UpdateRule>(field, value);
      continue;
    }
    if (field == "controller") {
      tuning.controller = controller(value, world);
      continue;
    }
    const auto range = std::find_if(kTuningRanges.begin(), kTuningRanges.end(),
                                    [&](const auto& r) { return field == r.name; });
    if (range == kTuningRanges.end())
      refuse(field, value, "one of the settings in docs/page_messages.md");
    tuning.*range->number = number(range->name, value, *range);
  }
  return settings;
}

LiveSettings with_environment(const json& message, LiveSettings settings) {
  for (const auto& item : message.items()) {
    const std::string& field = item.key();
    const json& value = item.value();
    if (field == "type") continue;
    const auto range = std::find_if(kEnvironmentRanges.begin(), kEnvironmentRanges.end(),
                                    [&](const auto& r) { return field == r.name; });
    if (range == kEnvironmentRanges.end())
      refuse(field, value, "one of the settings in docs/page_messages.md");
    range->number(settings) = number(range->name, value, *range);
  }
  return settings;
}

ResetRequest reset(const json& message, const WorldTraits& world) {
  if (!message.contains("start")) return {};
  const json& start = message["start"];
  if (start.is_string() && start.get_ref<const std::string&>().empty()) return {""};
  std::string known = "empty";
  for (const std::string& name : world.starts) {
    if (start == name) return {name};
    known.append(", ").append(name);
  }
  refuse("start", start, known);
}

PullRequest pull(const json& message, const WorldTraits& world) {
  if (!flag(message, "hold")) return {};
  const json body = message.value("body", json());
  if (!body.is_number_integer() ||
      std::ranges::find(world.movable, body.get<std::int64_t>()) == world.movable.end()) {
    refuse("body", body, "the number of a body that can move, and is no tool's");
  }
  const auto point = [&](const char* field) {
    const json p = numbers(message, field, 3, "3 numbers: x, y, z within 10 m");
    return Vector3(p[0].get<double>(), p[1].get<double>(), p[2].get<double>());
  };
  return {BodyPull{.body = body.get<int>(), .p_B = point("point"), .target_W = point("target")}};
}

SceneRequest scene(const json& name, const WorldTraits& world) {
  std::string known;
  for (const std::string& one : world.scenes) {
    if (name == one) return {.name = one};
    known.append(known.empty() ? "" : ", ").append(one);
  }
  refuse("scene", name, known);
}

/// Another engine's session keeps its frames and its ε.
void require_environment(const std::string& type, const WorldTraits& world) {
  if (!world.environment) refuse("type", type, "of a session of ve_client");
}

ParsedRequest parse(const json& message, const LiveSettings& present, const WorldTraits& world) {
  const json type = message.is_object() ? message.value("type", json()) : json();
  if (type == "hand") return hand(message);
  if (type == "settings") return SettingsRequest{with_tuning(message, present, world)};
  for (const char* const own : {"environment", "method", "step", "pull"}) {
    if (type == own) require_environment(type, world);
  }
  if (type == "environment") return SettingsRequest{with_environment(message, present)};
  if (type == "method") {
    return SettingsRequest{with_method(message.value("name", json()), present, world)};
  }
  if (type == "step") return StepRequest{};
  if (type == "pull") return pull(message, world);
  if (type == "telemetry") return TelemetryRequest{flag(message, "on")};
  if (type == "reset") return reset(message, world);
  if (type == "scene") return scene(message.value("name", json()), world);
  refuse("type", type,
         "hand, settings, environment, method, step, pull, telemetry, reset or scene");
}

}  // namespace

ParsedRequest parse_request(const std::string& text, const LiveSettings& present,
                            const WorldTraits& world) {
  try {
    return parse(json::parse(text), present, world);
  } catch (const Refused& refused) {
    return refused.refusal;
  } catch (const json::exception&) {
    return Refusal{"", text, "the message must be JSON as docs/page_messages.md describes it"};
  }
}

}  // namespace hlm::ve
