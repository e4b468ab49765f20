#include "hlm/haptic_server/device/hand_script.h"

#include <initializer_list>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <toml++/toml.h>

#include "hlm/common/one_line.h"
#include "hlm/common/range.h"

namespace hlm::server {
namespace {

constexpr Range kDuration{1e-3, 3600, "s"};
constexpr Range kOpening{0, 1};
constexpr Range kPosition{-10, 10, "m"};
constexpr Range kRotation{-10, 10, "rad"};
constexpr Range kForce{-1000, 1000, "N"};
constexpr Range kTorque{-100, 100, "N·m"};
constexpr Range kFrequency{0, 1000, "Hz"};
constexpr Range kPhase{-100, 100, "rad"};
// The stiffest grip that the lightest simulated device (kLeastMass, kLeastInertia) follows stably
// in its longest substep.
constexpr Range kStiffness{0, 2e4, "N/m"};
constexpr Range kDamping{0, 500, "N·s/m"};
constexpr Range kAngularStiffness{0, 100, "N·m/rad"};
constexpr Range kAngularDamping{0, 1, "N·m·s/rad"};
constexpr Range kGripForce{0, 1000, "N"};
constexpr Range kGripTorque{0, 100, "N·m"};

using Keys = std::initializer_list<std::string_view>;

std::string joined(Keys keys) {
  std::string text;
  for (const std::string_view key : keys) {
    if (!text.empty()) text += ", ";
    text += key;
  }
  return text;
}

/// One table of the file, whose readers throw errors that say where they are.
class Section {
 public:
  /// `name` for a person, for example "segment 3". Throws if the table has any other key.
  Section(std::string file, std::string name, const toml::table& table, Keys keys)
      : file_(std::move(file)), name_(std::move(name)), table_(table) {
    for (const auto& [key, node] : table_) {
      bool known = false;
      for (const std::string_view allowed : keys) known = known || allowed == key.str();
      if (!known) {
        fail(node, "unknown key '" + std::string(key.str()) + "'; allowed: " + joined(keys));
      }
    }
  }

  [[noreturn]] void fail(const toml::node& node, const std::string& what) const {
    std::ostringstream text;
    text << file_ << ':' << node.source().begin.line << ": " << name_ << ": " << what;
    throw std::runtime_error(one_line(text.str()));
  }
  [[noreturn]] void fail(const std::string& what) const { fail(table_, what); }

  const toml::node* find(std::string_view key) const { return table_.get(key); }

  /// Sets `value` if the key is there.
  void read(std::string_view key, double& value, const Range& range) const {
    if (const toml::node* node = find(key)) value = number(*node, key, range);
  }
  void read(std::string_view key, Eigen::Ref<Vector3> value, const Range& range) const {
    if (const toml::node* node = find(key)) value = vector(*node, key, range);
  }
  void read(std::string_view key, std::optional<double>& value, const Range& range) const {
    if (const toml::node* node = find(key)) value = number(*node, key, range);
  }
  void read(std::string_view key, std::optional<Vector3>& value, const Range& range) const {
    if (const toml::node* node = find(key)) value = vector(*node, key, range);
  }
  void read(std::string_view key, bool& value) const {
    const toml::node* node = find(key);
    if (!node) return;
    if (!node->is_boolean()) fail(*node, std::string(key) + " must be true or false");
    value = node->as_boolean()->get();
  }

  /// A table inside this one.
  Section section(std::string_view key, Keys keys) const {
    const toml::node& node = *find(key);
    if (!node.is_table()) fail(node, std::string(key) + " must be a table { key = value, … }");
    return {file_, name_ + ": " + std::string(key), *node.as_table(), keys};
  }

 private:
  double number(const toml::node& node, std::string_view key, const Range& range) const {
    const std::optional<double> value = node.is_number() ? node.value<double>() : std::nullopt;
    if (!value) fail(node, std::string(key) + " must be a number");
    if (const auto error = find_error(key, *value, range)) fail(node, *error);
    return *value;
  }
  Vector3 vector(const toml::node& node, std::string_view key, const Range& range) const {
    const toml::array* array = node.as_array();
    if (!array || array->size() != 3) {
      fail(node, std::string(key) + " must be three numbers [x, y, z]");
    }
    Vector3 v;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::string element = std::string(key) + '[' + std::to_string(i) + ']';
      v[static_cast<Eigen::Index>(i)] = number((*array)[i], element, range);
    }
    return v;
  }

  std::string file_;
  std::string name_;
  const toml::table& table_;
};

void read_grip(const Section& parent, Grip& grip) {
  if (!parent.find("grip")) return;
  const Section section = parent.section("grip", {"stiffness", "damping", "angular_stiffness",
                                                  "angular_damping", "max_force", "max_torque"});
  section.read("stiffness", grip.stiffness, kStiffness);
  section.read("damping", grip.damping, kDamping);
  section.read("angular_stiffness", grip.angular_stiffness, kAngularStiffness);
  section.read("angular_damping", grip.angular_damping, kAngularDamping);
  section.read("max_force", grip.max_force, kGripForce);
  section.read("max_torque", grip.max_torque, kGripTorque);
}

Push read_push(const Section& parent) {
  const Section section = parent.section(
      "wrench", {"force", "torque", "force_amplitude", "torque_amplitude", "frequency", "phase"});
  Push push;
  section.read("force", push.constant.head<3>(), kForce);
  section.read("torque", push.constant.tail<3>(), kTorque);
  section.read("force_amplitude", push.amplitude.head<3>(), kForce);
  section.read("torque_amplitude", push.amplitude.tail<3>(), kTorque);
  section.read("frequency", push.frequency, kFrequency);
  section.read("phase", push.phase, kPhase);
  return push;
}

Reach read_reach(const Section& parent, const Grip& file_grip) {
  const Section section = parent.section("move_to", {"position", "rotation", "relative"});
  Reach reach;
  reach.grip = file_grip;
  section.read("position", reach.position, kPosition);
  section.read("rotation", reach.rotation, kRotation);
  section.read("relative", reach.relative);
  read_grip(parent, reach.grip);
  return reach;
}

HandSegment read_segment(const Section& section, const Grip& file_grip) {
  HandSegment segment;
  if (!section.find("duration")) section.fail("duration is missing");
  section.read("duration", segment.duration, kDuration);
  section.read("opening", segment.opening, kOpening);
  const bool pushes = section.find("wrench") != nullptr;
  if (pushes == (section.find("move_to") != nullptr)) {
    section.fail("must have either wrench or move_to");
  }
  if (!pushes) {
    segment.action = read_reach(section, file_grip);
    return segment;
  }
  if (const toml::node* grip = section.find("grip")) section.fail(*grip, "grip needs move_to");
  segment.action = read_push(section);
  return segment;
}

AfterLastSegment read_after(const Section& section) {
  const toml::node* node = section.find("after");
  const std::string_view after = node ? node->value_or(std::string_view{}) : "release";
  if (after == "release") return AfterLastSegment::kRelease;
  if (after == "hold") return AfterLastSegment::kHold;
  if (after == "repeat") return AfterLastSegment::kRepeat;
  std::ostringstream value;
  value << toml::node_view(*node);
  section.fail(*node, "after " + value.str() + " must be 'release', 'hold' or 'repeat'");
}

HandScript read_script(const std::string& path, const toml::table& table) {
  const Section section(path, "hand script", table, {"after", "grip", "segment"});
  HandScript script{.segments = {}, .after = read_after(section)};
  Grip file_grip;
  read_grip(section, file_grip);
  const toml::node* node = section.find("segment");
  if (!node) section.fail("has no [[segment]]");
  const toml::array* segments = node->as_array();
  if (!segments || segments->empty()) section.fail(*node, "segments must be written [[segment]]");
  for (const toml::node& element : *segments) {
    const std::string name = "segment " + std::to_string(script.segments.size() + 1);
    if (!element.is_table()) section.fail(element, name + " must be a table");
    script.segments.push_back(read_segment(
        {path, name, *element.as_table(), {"duration", "wrench", "move_to", "grip", "opening"}},
        file_grip));
  }
  return script;
}

}  // namespace

HandScript read_hand_script(const std::string& path) {
  try {
    return read_script(path, toml::parse_file(path));
  } catch (const toml::parse_error& error) {
    std::ostringstream text;
    text << path;
    if (error.source().begin.line > 0) text << ':' << error.source().begin.line;
    text << ": " << error.description();
    throw std::runtime_error(one_line(text.str()));
  }
}

}  // namespace hlm::server
