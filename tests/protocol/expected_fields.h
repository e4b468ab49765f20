// The fields that the dissector must show of a message.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "protocol/codec.h"
#include "tests/protocol/tshark.h"
#include "tests/support/catch.h"

namespace hlm::test {

/// The fields that a datagram must show, in order.
class Expected {
 public:
  explicit Expected(std::string prefix) : prefix_(std::move(prefix)) {}

  void number(const std::string& name, double value) { add(name, value, ""); }
  void text(const std::string& name, const std::string& value) {
    add(name, std::nan(""), ": " + value);
  }
  template <class Integer>
  void integer(const std::string& name, Integer value) {
    text(name, std::to_string(value));
  }
  void hexadecimal(const std::string& name, std::uint64_t value) {
    std::array<char, 19> digits;
    std::snprintf(digits.data(), digits.size(), "0x%016lx", value);
    text(name, digits.data());
  }
  /// A value with a name; `names` begins with that of the value 0.
  template <class Enum>
  void code(const std::string& name, Enum value, const std::vector<std::string>& names) {
    const auto number = static_cast<std::size_t>(value);
    text(name, names.at(number) + " (" + std::to_string(number) + ")");
  }
  template <class Vector>
  void coordinates(const std::string& name, const Vector& values) {
    for (const double value : values) number(name, value);
  }
  void vector(const std::string& name, const Vector3& v) {
    number(name + ".x", v.x());
    number(name + ".y", v.y());
    number(name + ".z", v.z());
  }
  void pose(const std::string& name, const Pose& X) {
    vector(name + ".p", X.p);
    number(name + ".R.w", X.R.w());
    number(name + ".R.x", X.R.x());
    number(name + ".R.y", X.R.y());
    number(name + ".R.z", X.R.z());
  }
  void twist(const std::string& name, const Twist& V) {
    vector(name + ".linear", V.head<3>());
    vector(name + ".angular", V.tail<3>());
  }
  void wrench(const std::string& name, const Wrench& F) {
    vector(name + ".force", F.head<3>());
    vector(name + ".torque", F.tail<3>());
  }
  void append(const Expected& other) {
    fields_.insert(fields_.end(), other.fields_.begin(), other.fields_.end());
  }

  /// Fails unless `shown` are these fields, adjacent, and fill a datagram of `length` bytes.
  void check(const std::vector<ShownField>& shown, std::size_t length) const {
    REQUIRE(shown.size() == fields_.size());
    std::size_t position = kIpAndUdpHeader;
    for (std::size_t i = 0; i < shown.size(); ++i) {
      INFO("field " << i << ": " << shown[i].name << ", " << shown[i].text);
      CHECK(shown[i].name == fields_[i].name);
      CHECK(shown[i].text.ends_with(fields_[i].ending));
      if (!std::isnan(fields_[i].number)) {
        // Wireshark shows 15 digits.
        CHECK(std::stod(shown[i].value) == Approx(fields_[i].number).epsilon(1e-14).margin(0));
      }
      CHECK(shown[i].position == position);
      position += shown[i].size;
    }
    CHECK(position == kIpAndUdpHeader + length);
  }

 private:
  static constexpr std::size_t kIpAndUdpHeader = 28;  ///< Bytes before the datagram.

  struct Field {
    std::string name;
    double number;       ///< Not a number: only the text is compared.
    std::string ending;  ///< Of the text, behind the label.
  };
  void add(const std::string& name, double number, const std::string& ending) {
    fields_.push_back({prefix_ + name, number, ending});
  }

  std::string prefix_;
  std::vector<Field> fields_;
};

/// The header of a datagram of `length` bytes.
inline Expected expected_header(protocol::MessageType type, const protocol::Envelope& envelope,
                                const protocol::Slice& slice, std::size_t length) {
  Expected fields("hlm.");
  fields.text("magic", "HLMI");
  fields.integer("version", protocol::kProtocolVersion);
  fields.code("type", type,
              {"", "hello", "welcome", "reject", "contact update", "proxy state", "goodbye",
               "control", "ticks", "local state"});
  fields.integer("flags", 0);
  fields.hexadecimal("session", envelope.session);
  fields.integer("sequence", envelope.sequence);
  fields.integer("send_time", envelope.send_time);
  fields.integer("part", slice.part);
  fields.integer("parts", slice.parts);
  fields.integer("items", slice.items);
  fields.integer("items_total", slice.items_total);
  fields.integer("length", length);
  fields.integer("reserved", 0);
  return fields;
}

// The fields of each message without its list, and of the items of lists.

inline Expected expected_body(const protocol::Hello& hello) {
  Expected fields("hlm.hello.");
  fields.hexadecimal("nonce", hello.nonce);
  fields.number("ve_rate", hello.ve_rate);
  fields.number("epsilon", hello.epsilon);
  fields.vector("gravity_W", hello.tool.gravity_W);
  fields.number("length", hello.tool.length);
  fields.pose("X_LH", hello.tool.X_LH);
  fields.integer("hand_link", hello.tool.hand_link);
  fields.integer("size_q", hello.q.size());
  fields.coordinates("q", hello.q);
  return fields;
}

inline Expected expected_item(const Link& link) {
  Expected fields("hlm.link.");
  fields.integer("parent", link.parent);
  fields.code("joint", link.joint, {"fixed", "revolute", "prismatic", "planar", "free"});
  fields.pose("X_PJ", link.X_PJ);
  fields.vector("axis", link.axis);
  fields.number("mass", link.mass);
  fields.vector("p_LCom", link.p_LCom);
  fields.number("I_LCom.xx", link.I_LCom(0, 0));
  fields.number("I_LCom.yy", link.I_LCom(1, 1));
  fields.number("I_LCom.zz", link.I_LCom(2, 2));
  fields.number("I_LCom.xy", link.I_LCom(0, 1));
  fields.number("I_LCom.xz", link.I_LCom(0, 2));
  fields.number("I_LCom.yz", link.I_LCom(1, 2));
  return fields;
}

inline void add_tuning(Expected& fields, const Tuning& tuning) {
  fields.code("update_rule", tuning.update_rule,
              {"retain", "paper", "intermediate representation", "plane recovery"});
  fields.code("controller", tuning.controller,
              {"four-channel", "three-channel", "virtual coupler", "direct", "rotation coupler",
               "engine coupler", "engine force"});
  for (const auto& range : kTuningRanges) {
    fields.number(range.name, tuning.*range.number);
  }
}

inline Expected expected_body(const protocol::Welcome& welcome) {
  Expected fields("hlm.welcome.");
  fields.hexadecimal("nonce", welcome.nonce);
  fields.number("servo_rate", welcome.servo_rate);
  fields.hexadecimal("configuration", welcome.configuration);
  add_tuning(fields, welcome.tuning);
  fields.code("guidable", welcome.guidable, {"no", "yes"});
  return fields;
}

inline Expected expected_body(const protocol::Reject& reject) {
  Expected fields("hlm.reject.");
  fields.hexadecimal("nonce", reject.nonce);
  fields.code("reason", reject.reason, {"", "version", "busy", "tool"});
  fields.integer("size_text", reject.text.size());
  fields.integer("version", reject.version);
  if (!reject.text.empty()) fields.text("text", {reject.text.begin(), reject.text.end()});
  return fields;
}

inline Expected expected_body(const protocol::ContactUpdate& update) {
  Expected fields("hlm.contact_update.");
  fields.number("ve_time", update.ve_time);
  fields.number("ve_period", update.ve_period);
  fields.number("compute_time", update.compute_time);
  fields.integer("echo_step", update.echo_step);
  fields.number("echo_hold", update.echo_hold);
  fields.integer("size_q_VE", update.q_VE.size());
  fields.integer("size_v_VE", update.v_VE.size());
  fields.coordinates("q_VE", update.q_VE);
  fields.coordinates("v_VE", update.v_VE);
  return fields;
}

inline void add_feature(Expected& fields, const std::string& name, const Feature& feature) {
  fields.code(name + ".kind", feature.kind, {"vertex", "edge", "face"});
  fields.integer(name + ".shape", feature.shape);
  fields.integer(name + ".index", feature.index);
}

inline Expected expected_item(const ReportedContact& contact) {
  Expected fields("hlm.contact.");
  fields.integer("link", contact.key.link);
  add_feature(fields, "tool_feature", contact.key.tool_feature);
  fields.integer("body", contact.key.body);
  add_feature(fields, "body_feature", contact.key.body_feature);
  fields.vector("p_WC", contact.p_WC);
  fields.vector("n_W", contact.n_W);
  fields.number("separation", contact.separation);
  fields.vector("v_WC", contact.v_WC);
  return fields;
}

inline Expected expected_body(const protocol::ProxyState& state) {
  Expected fields("hlm.proxy_state.");
  fields.integer("acknowledged", state.acknowledged);
  fields.integer("step", state.step);
  fields.number("age", state.age);
  fields.number("update_send_time", state.update_send_time);
  fields.number("hold", state.hold);
  fields.code("server", state.server, {"idle", "running", "silent", "fault"});
  fields.code("fault", state.fault, {"none", "not finite", "overrun", "device"});
  fields.code("contact_state", state.contact_state, {"free motion", "colliding", "resting"});
  fields.integer("size_q", state.q.size());
  fields.integer("size_v", state.v.size());
  fields.integer("active_contacts", state.active_contacts);
  fields.integer("predicted_contacts", state.predicted_contacts);
  fields.number("smallest_separation", state.smallest_separation);
  fields.pose("X_WD", state.X_WD);
  fields.twist("V_WD", state.V_WD);
  fields.wrench("F_env", state.F_env);
  fields.wrench("F_command", state.F_command);
  fields.wrench("F_hand", state.F_hand);
  fields.integer("overruns", state.overruns);
  fields.integer("updates", state.updates);
  fields.integer("dropped", state.dropped);
  fields.integer("control", state.control);
  fields.coordinates("q", state.q);
  fields.coordinates("v", state.v);
  return fields;
}

inline Expected expected_body(const protocol::Goodbye& goodbye) {
  Expected fields("hlm.goodbye.");
  fields.code("reason", goodbye.reason, {"finished", "shutdown"});
  return fields;
}

inline Expected expected_body(const protocol::Control& control) {
  Expected fields("hlm.control.");
  fields.code("telemetry", control.telemetry, {"no", "yes"});
  fields.code("holds", control.holds, {"no", "yes"});
  fields.pose("X_WTarget", control.X_WTarget);
  fields.code("tuned", control.tuned, {"no", "yes"});
  add_tuning(fields, control.tuning);
  return fields;
}

inline Expected expected_body(const protocol::Ticks& ticks) {
  Expected fields("hlm.ticks.");
  fields.integer("first_step", ticks.first_step);
  return fields;
}

inline Expected expected_item(const protocol::TickSignals& tick) {
  Expected fields("hlm.tick.");
  fields.vector("F_env", tick.F_env);
  fields.vector("F_command", tick.F_command);
  fields.vector("F_hand", tick.F_hand);
  fields.number("torque", tick.torque);
  fields.number("smallest_separation", tick.smallest_separation);
  fields.number("device_proxy", tick.device_proxy);
  fields.number("proxy_tool", tick.proxy_tool);
  fields.number("lateness", tick.lateness);
  fields.number("execution", tick.execution);
  fields.number("age", tick.age);
  fields.integer("active_contacts", tick.active_contacts);
  fields.integer("predicted_contacts", tick.predicted_contacts);
  fields.code("adopted", tick.adopted, {"no", "yes"});
  fields.code("limit", tick.limit, {"nothing", "force", "torque", "rate", "fade"});
  return fields;
}

inline Expected expected_body(const protocol::LocalState& state) {
  Expected fields("hlm.local_state.");
  fields.integer("step", state.step);
  fields.code("limit", state.limit, {"nothing", "force", "torque", "rate", "fade"});
  return fields;
}

inline Expected expected_item(const protocol::LocalContactReport& contact) {
  Expected fields("hlm.local_contact.");
  fields.integer("link", contact.link);
  fields.code("state", contact.state, {"impending", "colliding", "penetrating", "separating"});
  fields.code("retained", contact.retained, {"no", "yes"});
  fields.vector("c_W", contact.c_W);
  fields.vector("n_W", contact.n_W);
  fields.vector("p_W", contact.p_W);
  fields.number("s", contact.s);
  fields.vector("f_W", contact.f_W);
  return fields;
}

}  // namespace hlm::test
