// The fields that the dissector must show of each message.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "hlm/protocol/codec.h"
#include "hlm/protocol/layout.h"
#include "tests/protocol/expected.h"
#include "tests/support/catch.h"

namespace hlm::test {

/// The header of a datagram of `length` bytes.
inline Expected expected_header(const protocol::Header& header, std::size_t length) {
  Expected fields("hlm.");
  fields.text("magic", "HLMI");
  fields.integer("version", protocol::kProtocolVersion);
  fields.code("type", header.type);
  fields.integer("flags", 0);
  fields.hexadecimal("session", header.envelope.session);
  fields.integer("sequence", header.envelope.sequence);
  fields.integer("send_time", header.envelope.send_time);
  fields.integer("part", header.part);
  fields.integer("parts", header.parts);
  fields.integer("tool", 0);
  fields.integer("reserved", 0);
  fields.integer("length", length);
  fields.integer("block", header.block);
  return fields;
}

/// What stands in front of a list.
struct ListHeader {
  std::uint16_t first = 0;
  std::uint16_t count = 0;
  std::uint16_t total = 0;
  std::uint16_t item_size = 0;
};

/// `list` is "<message>.<list>".
inline Expected expected_list_header(const std::string& list, const ListHeader& header) {
  Expected fields("hlm." + list + ".");
  fields.integer("first", header.first);
  fields.integer("count", header.count);
  fields.integer("total", header.total);
  fields.integer("item_size", header.item_size);
  return fields;
}

/// The names of a message's lists.
template <class Message>
inline const std::vector<std::string> kListNames{};
template <>
inline const std::vector<std::string> kListNames<protocol::Hello>{"links"};
template <>
inline const std::vector<std::string> kListNames<protocol::ContactUpdate>{"bodies", "contacts"};
template <>
inline const std::vector<std::string> kListNames<protocol::Ticks>{"ticks"};
template <>
inline const std::vector<std::string> kListNames<protocol::LocalState>{"contacts"};
template <>
inline const std::vector<std::string> kListNames<protocol::Impulses>{"bodies"};

// The fixed fields of each message, and the fields of the items of lists.

inline Expected expected_block(const protocol::Hello& hello) {
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
  fields.flag("clears_fault", hello.clears_fault);
  return fields;
}

inline Expected expected_item(const Link& link) {
  Expected fields("hlm.link.");
  fields.integer("parent", link.parent);
  fields.code("joint", link.joint);
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
  fields.number("lower", link.lower);
  fields.number("upper", link.upper);
  return fields;
}

inline void add_tuning(Expected& fields, const Tuning& tuning) {
  fields.code("update_rule", tuning.update_rule);
  fields.code("controller", tuning.controller);
  for (const auto& range : kTuningRanges) {
    fields.number(range.name, tuning.*range.number);
  }
}

inline Expected expected_block(const protocol::Welcome& welcome) {
  Expected fields("hlm.welcome.");
  fields.hexadecimal("nonce", welcome.nonce);
  fields.number("servo_rate", welcome.servo_rate);
  fields.hexadecimal("fingerprint", welcome.fingerprint);
  add_tuning(fields, welcome.tuning);
  fields.number("silence_time", welcome.silence_time);
  fields.number("fade_time", welcome.fade_time);
  fields.number("least_update_rate", welcome.least_update_rate);
  fields.flag("capabilities.movable_bodies", welcome.capabilities.movable_bodies);
  fields.flag("capabilities.axes", welcome.capabilities.axes);
  fields.flag("capabilities.self_contacts", welcome.capabilities.self_contacts);
  const protocol::DeviceReport& device = welcome.device;
  fields.number("device.max_force", device.max_force);
  fields.number("device.max_torque", device.max_torque);
  fields.number("device.max_stiffness", device.max_stiffness);
  fields.number("device.max_angular_stiffness", device.max_angular_stiffness);
  fields.number("device.scale", device.scale);
  fields.integer("device.buttons", device.buttons);
  fields.flag("device.gripper", device.gripper);
  fields.flag("device.renders_torque", device.renders_torque);
  fields.flag("device.measures_hand", device.measures_hand);
  fields.flag("device.guidable", device.guidable);
  fields.integer("device.size_name", device.name.size());
  if (!device.name.empty()) fields.text("device.name", {device.name.begin(), device.name.end()});
  fields.integer("device.freedoms", device.freedoms);
  fields.flag("device.observes_hand", device.observes_hand);
  return fields;
}

inline Expected expected_block(const protocol::Reject& reject) {
  Expected fields("hlm.reject.");
  fields.hexadecimal("nonce", reject.nonce);
  fields.code("reason", reject.reason);
  fields.integer("size_text", reject.text.size());
  fields.integer("version", reject.version);
  if (!reject.text.empty()) fields.text("text", {reject.text.begin(), reject.text.end()});
  return fields;
}

inline Expected expected_block(const protocol::ContactUpdate& update) {
  Expected fields("hlm.contact_update.");
  fields.number("ve_time", update.ve_time);
  fields.number("ve_period", update.ve_period);
  fields.number("compute_time", update.compute_time);
  fields.integer("echo_step", update.echo_step);
  fields.number("echo_hold", update.echo_hold);
  fields.number("impulse_step", update.impulse_step);
  fields.integer("size_q_VE", update.q_VE.size());
  fields.integer("size_v_VE", update.v_VE.size());
  fields.coordinates("q_VE", update.q_VE);
  fields.coordinates("v_VE", update.v_VE);
  return fields;
}

inline Expected expected_item(const MovableBody& body) {
  Expected fields("hlm.movable_body.");
  fields.integer("id", body.id);
  fields.vector("p_WCom", body.p_WCom);
  fields.halves("V_W", body.V_W);
  fields.halves("A_W", body.A_W);
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) {
      fields.number("W." + std::to_string(row + 1) + std::to_string(column + 1),
                    body.W(row, column));
    }
  }
  fields.halves("P_W", body.P_W);
  fields.code("roundness", body.roundness);
  fields.short_vector("axis_W", body.axis_W);
  return fields;
}

inline void add_sides(Expected& fields, const ContactSide& a, const ContactSide& b) {
  fields.code("a.kind", a.kind);
  fields.code("b.kind", b.kind);
  fields.integer("a.index", a.index);
  fields.integer("b.index", b.index);
}

inline Expected expected_item(const ReportedContact& contact) {
  Expected fields("hlm.contact.");
  fields.hexadecimal("identity", contact.identity);
  fields.integer("pair", contact.pair);
  fields.integer("axis", contact.axis);
  add_sides(fields, contact.a, contact.b);
  fields.vector("p_WC", contact.p_WC);
  fields.vector("n_W", contact.n_W);
  fields.number("separation", contact.separation);
  fields.short_vector("v_WC", contact.v_WC);
  fields.short_number("friction", contact.friction);
  fields.short_number("load", contact.load);
  fields.code("plane", contact.plane);
  return fields;
}

inline Expected expected_block(const protocol::ProxyState& state) {
  Expected fields("hlm.proxy_state.");
  fields.integer("acknowledged", state.acknowledged);
  fields.integer("step", state.step);
  fields.number("age", state.age);
  fields.number("update_send_time", state.update_send_time);
  fields.number("hold", state.hold);
  fields.code("server", state.server);
  fields.code("fault", state.fault);
  fields.code("contact_state", state.contact_state);
  fields.code("limit", state.limit);
  fields.integer("active_contacts", state.active_contacts);
  fields.integer("predicted_contacts", state.predicted_contacts);
  fields.number("smallest_separation", state.smallest_separation);
  fields.pose("X_WD", state.X_WD);
  fields.halves("V_WD", state.V_WD);
  fields.wrench("F_env", state.F_env);
  fields.wrench("F_command", state.F_command);
  fields.wrench("F_hand", state.F_hand);
  fields.flag("hand_measured", state.hand_measured);
  fields.integer("buttons", state.buttons);
  fields.number("gripper", state.gripper);
  fields.number("scale", state.scale);
  fields.integer("overruns", state.overruns);
  fields.integer("updates", state.updates);
  fields.integer("dropped", state.dropped);
  fields.integer("control", state.control);
  fields.integer("size_q", state.q.size());
  fields.integer("size_v", state.v.size());
  fields.coordinates("q", state.q);
  fields.coordinates("v", state.v);
  fields.code("fade", state.fade);
  fields.number("given", state.given);
  fields.number("taken", state.taken);
  fields.number("explained", state.explained);
  fields.number("tank", state.tank);
  fields.number("brought", state.brought);
  fields.flag("hand_observed", state.hand_observed);
  fields.number("lowered", state.lowered);
  return fields;
}

inline Expected expected_block(const protocol::Goodbye& goodbye) {
  Expected fields("hlm.goodbye.");
  fields.code("reason", goodbye.reason);
  return fields;
}

inline Expected expected_block(const protocol::Control& control) {
  Expected fields("hlm.control.");
  fields.flag("telemetry", control.telemetry);
  fields.flag("holds", control.holds);
  fields.pose("X_WTarget", control.X_WTarget);
  fields.flag("tuned", control.tuned);
  add_tuning(fields, control.tuning);
  return fields;
}

inline Expected expected_block(const protocol::Ticks& ticks) {
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
  fields.flag("adopted", tick.adopted);
  fields.code("limit", tick.limit);
  return fields;
}

inline Expected expected_block(const protocol::LocalState& state) {
  Expected fields("hlm.local_state.");
  fields.integer("step", state.step);
  return fields;
}

inline Expected expected_item(const protocol::LocalContactReport& contact) {
  Expected fields("hlm.local_contact.");
  fields.hexadecimal("identity", contact.identity);
  add_sides(fields, contact.a, contact.b);
  fields.code("state", contact.state);
  fields.flag("retained", contact.retained);
  fields.vector("c_W", contact.c_W);
  fields.vector("n_W", contact.n_W);
  fields.vector("p_W", contact.p_W);
  fields.number("s", contact.s);
  fields.vector("f_W", contact.f_W);
  return fields;
}

inline Expected expected_block(const protocol::Refusal& refusal) {
  Expected fields("hlm.refusal.");
  fields.integer("refused", refusal.refused);
  fields.code("error", refusal.error);
  fields.flag("whole", refusal.whole);
  fields.integer("item", refusal.item);
  fields.integer("count", refusal.count);
  return fields;
}

inline Expected expected_block(const protocol::Impulses& impulses) {
  Expected fields("hlm.impulses.");
  fields.integer("step", impulses.step);
  return fields;
}

inline Expected expected_item(const protocol::BodyImpulse& impulse) {
  Expected fields("hlm.body_impulse.");
  fields.integer("body", impulse.body);
  fields.halves("P_W", impulse.P_W);
  return fields;
}

/// All that is shown of one part of a message.
template <class Message>
Expected expected_part(const Message& message, std::span<const std::byte> bytes) {
  protocol::Header header;
  REQUIRE_FALSE(protocol::decode_header(bytes, header));
  Expected fields = expected_header(header, bytes.size());
  fields.append(expected_block(message));
  protocol::Reader reader(bytes, protocol::layout::kHeaderSize + header.block);
  std::size_t i = 0;
  protocol::layout::lists(message, [&](const auto& list) {
    ListHeader share;
    reader.u16(share.first);
    reader.u16(share.count);
    reader.u16(share.total);
    reader.u16(share.item_size);
    const std::string name(name_of(header.type));
    fields.append(expected_list_header(name + "." + kListNames<Message>.at(i++), share));
    const std::size_t end = std::size_t{share.first} + share.count;
    for (std::size_t item = share.first; item < end; ++item) {
      fields.append(expected_item(list[item]));
    }
    reader.skip_to(reader.position() + std::size_t{share.count} * share.item_size);
  });
  REQUIRE_FALSE(reader.error());
  return fields;
}

}  // namespace hlm::test
