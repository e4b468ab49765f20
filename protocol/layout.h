// The order of the fields in each message. PROTOCOL.md says the same in tables.
//
// For each message block() lists its fixed fields and lists() names its lists; for each item of a
// list fields() lists the item's. All serve Writer (M is const) and Reader.
#pragma once

#include <cmath>
#include <cstddef>

#include "hlm/protocol/messages.h"
#include "hlm/protocol/wire.h"

namespace hlm::protocol {

template <class Message>
inline constexpr MessageType kTypeOf{};
template <>
inline constexpr MessageType kTypeOf<Hello> = MessageType::kHello;
template <>
inline constexpr MessageType kTypeOf<Welcome> = MessageType::kWelcome;
template <>
inline constexpr MessageType kTypeOf<Reject> = MessageType::kReject;
template <>
inline constexpr MessageType kTypeOf<ContactUpdate> = MessageType::kContactUpdate;
template <>
inline constexpr MessageType kTypeOf<ProxyState> = MessageType::kProxyState;
template <>
inline constexpr MessageType kTypeOf<Goodbye> = MessageType::kGoodbye;
template <>
inline constexpr MessageType kTypeOf<Control> = MessageType::kControl;
template <>
inline constexpr MessageType kTypeOf<Ticks> = MessageType::kTicks;
template <>
inline constexpr MessageType kTypeOf<LocalState> = MessageType::kLocalState;
template <>
inline constexpr MessageType kTypeOf<Refusal> = MessageType::kRefusal;
template <>
inline constexpr MessageType kTypeOf<Impulses> = MessageType::kImpulses;
template <>
inline constexpr MessageType kTypeOf<SceneChunk> = MessageType::kSceneChunk;
template <>
inline constexpr MessageType kTypeOf<SceneState> = MessageType::kSceneState;
template <>
inline constexpr MessageType kTypeOf<HeldBodies> = MessageType::kHeldBodies;

}  // namespace hlm::protocol

namespace hlm::protocol::layout {

inline constexpr std::size_t kHeaderSize = 40;
/// Size of the header of each list: first, count, total, item_size.
inline constexpr std::size_t kListHeaderSize = 8;

/// Bytes of an item.
template <class Item>
inline constexpr std::size_t kItemSize = 0;
template <>
inline constexpr std::size_t kItemSize<Link> = 178;
template <>
inline constexpr std::size_t kItemSize<MovableBody> = 353;
template <>
inline constexpr std::size_t kItemSize<ReportedContact> = 101;
template <>
inline constexpr std::size_t kItemSize<TickSignals> = 134;
template <>
inline constexpr std::size_t kItemSize<LocalContactReport> = 124;
template <>
inline constexpr std::size_t kItemSize<BodyImpulse> = 52;
template <>
inline constexpr std::size_t kItemSize<BodyPose> = 108;
template <>
inline constexpr std::size_t kItemSize<AccelerationRate> = 52;
template <>
inline constexpr std::size_t kItemSize<ExternalWrench> = 49;
template <>
inline constexpr std::size_t kItemSize<Ownership> = 10;
template <>
inline constexpr std::size_t kItemSize<HeldBody> = 112;
template <>
inline constexpr std::size_t kItemSize<JointCurve> = 10 + 4 * 7 * kCurveTerms;
template <>
inline constexpr std::size_t kItemSize<JointDrive> = 50;

/// Whether older senders of this version do not send the list of these items.
template <class Item>
inline constexpr bool kIsAppended = false;
template <>
inline constexpr bool kIsAppended<BodyPose> = true;
template <>
inline constexpr bool kIsAppended<AccelerationRate> = true;
template <>
inline constexpr bool kIsAppended<ExternalWrench> = true;
template <>
inline constexpr bool kIsAppended<Ownership> = true;
template <>
inline constexpr bool kIsAppended<JointCurve> = true;
template <>
inline constexpr bool kIsAppended<JointDrive> = true;

/// No list; messages with lists have overloads of their own.
template <class M, class Visit>
void lists(M&, Visit&&) {}

template <class M, class Visit>
void lists(M& hello, Visit&& visit) requires std::same_as<const M, const Hello> {
  visit(hello.tool.links);
  visit(hello.tool.curves);
}
template <class M, class Visit>
void lists(M& update, Visit&& visit) requires std::same_as<const M, const ContactUpdate> {
  visit(update.bodies);
  visit(update.contacts);
  visit(update.poses);
  visit(update.rates);
  visit(update.external);
  visit(update.owners);
  visit(update.drives);
}
template <class M, class Visit>
void lists(M& ticks, Visit&& visit) requires std::same_as<const M, const Ticks> {
  visit(ticks.ticks);
}
template <class M, class Visit>
void lists(M& state, Visit&& visit) requires std::same_as<const M, const LocalState> {
  visit(state.contacts);
}
template <class M, class Visit>
void lists(M& impulses, Visit&& visit) requires std::same_as<const M, const Impulses> {
  visit(impulses.bodies);
}

template <class M, class Visit>
void lists(M& held, Visit&& visit) requires std::same_as<const M, const HeldBodies> {
  visit(held.bodies);
}

template <class Io, class T>
void text(Io& io, T& text) {
  io.text_size(text);
  io.text(text);
}

template <class Io, class M>
void block(Io& io, M& hello) requires std::same_as<const M, const Hello> {
  io.u64(hello.nonce);
  io.f64(hello.ve_rate);
  io.f64(hello.epsilon);
  io.vector(hello.tool.gravity_W);
  io.f64(hello.tool.length);
  io.nearly_unit_pose(hello.tool.X_LH);
  io.u8(hello.tool.hand_link);
  io.size(hello.q);
  io.vector(hello.q);
  io.appended_flag(hello.clears_fault);
}

/// What a hello says wrongly is left to find_error(), whose answer the user can read.
template <class Io, class M>
void fields(Io& io, M& link) requires std::same_as<const M, const Link> {
  io.i8(link.parent);
  io.enumeration(link.joint);
  io.nearly_unit_pose(link.X_PJ);
  io.vector(link.axis);
  io.normalize_if_near(link.axis);
  io.f64(link.mass);
  io.vector(link.p_LCom);
  auto& I = link.I_LCom;
  for (int i = 0; i < 3; ++i) io.f64(I(i, i));
  for (const auto& [row, column] : {std::pair{0, 1}, std::pair{0, 2}, std::pair{1, 2}}) {
    io.f64(I(row, column));
    io.mirror(I, row, column);
  }
  io.f64(link.lower);
  io.f64(link.upper);
}

/// As a link's, what is wrong is left to find_error().
template <class Io, class M>
void fields(Io& io, M& curve) requires std::same_as<const M, const JointCurve> {
  io.u8(curve.link);
  io.u8(curve.leader);
  io.f64(curve.armature);
  for (Eigen::Index i = 0; i < curve.terms.size(); ++i) io.f32(curve.terms.data()[i]);
}

template <class Io, class M>
void tuning(Io& io, M& tuning) {
  io.enumeration(tuning.update_rule);
  io.enumeration(tuning.controller);
  for (const TuningRange& range : kTuningRanges) io.f64(tuning.*range.number);
}

template <class Io, class M>
void block(Io& io, M& welcome) requires std::same_as<const M, const Welcome> {
  io.u64(welcome.nonce);
  io.f64(welcome.servo_rate, Sign::kPositive);
  io.u64(welcome.fingerprint);
  tuning(io, welcome.tuning);
  io.f64(welcome.silence_time, Sign::kPositive);
  io.f64(welcome.fade_time, Sign::kPositive);
  io.f64(welcome.least_update_rate, Sign::kPositive);
  io.flag(welcome.capabilities.movable_bodies);
  io.flag(welcome.capabilities.axes);
  io.flag(welcome.capabilities.self_contacts);
  auto& device = welcome.device;
  io.f64(device.max_force, Sign::kNotNegative);
  io.f64(device.max_torque, Sign::kNotNegative);
  io.f64(device.max_stiffness, Sign::kNotNegative);
  io.f64(device.max_angular_stiffness, Sign::kNotNegative);
  io.f64(device.scale, Sign::kPositive);
  io.u8(device.buttons);
  io.flag(device.gripper);
  io.flag(device.renders_torque);
  io.flag(device.measures_hand);
  io.flag(device.guidable);
  text(io, device.name);
  io.appended_u8(device.freedoms, kAllFreedoms);
  io.appended_flag(device.observes_hand);
  io.appended_flag(welcome.capabilities.scenes);
  io.appended_flag(welcome.capabilities.holds);
  io.appended_flag(welcome.capabilities.guides);
}

/// The same in every version of the protocol.
template <class Io, class M>
void block(Io& io, M& reject) requires std::same_as<const M, const Reject> {
  io.u64(reject.nonce);
  io.enumeration(reject.reason);
  io.text_size(reject.text);
  io.u16(reject.version);
  io.text(reject.text);
}

template <class Io, class M>
void block(Io& io, M& update) requires std::same_as<const M, const ContactUpdate> {
  io.f64(update.ve_time);
  io.span(update.ve_period);
  io.span(update.compute_time);
  io.u64(update.echo_step);
  io.span(update.echo_hold);
  io.f64(update.impulse_step, Sign::kNotNegative);
  io.size(update.q_VE);
  io.size(update.v_VE);
  io.vector_within(update.q_VE, kLargestLength);
  io.vector_within(update.v_VE, kLargestSpeed);
  io.appended_u32(update.scene);
}

template <class Io, class M>
void fields(Io& io, M& body) requires std::same_as<const M, const MovableBody> {
  io.u32(body.id);
  io.vector_within(body.p_WCom, kLargestLength);
  io.vector_within(body.V_W, kLargestSpeed);
  io.vector_within(body.A_W, kLargestAcceleration);
  io.symmetric_within(body.W, kLargestMobility);
  io.mobility(body.W);
  io.vector_within(body.P_W, kLargestImpulse);
  io.enumeration(body.roundness);
  io.short_vector_within(body.axis_W, kLargestUnit);
}

template <class Io, class M>
void fields(Io& io, M& contact) requires std::same_as<const M, const ReportedContact> {
  io.u64(contact.identity);
  io.u32(contact.pair);
  io.u16(contact.axis);
  io.enumeration(contact.a.kind);
  io.enumeration(contact.b.kind);
  io.u32(contact.a.index);
  io.u32(contact.b.index);
  io.vector_within(contact.p_WC, kLargestLength);
  io.unit_vector(contact.n_W);
  io.f64(contact.separation, Within{kLargestLength});
  io.short_vector_within(contact.v_WC, kLargestSpeed);
  io.f32(contact.friction, Within{kLargestFriction});
  io.f32(contact.load, Within{kLargestForce});
  io.require(contact.load >= 0, UpdateError::kRange);
  io.enumeration(contact.plane);
}

template <class Io, class M>
void fields(Io& io, M& pose) requires std::same_as<const M, const BodyPose> {
  io.u32(pose.body);
  io.near_pose(pose.X_WB);
  io.vector_within(pose.V_W, kLargestSpeed);
}

template <class Io, class M>
void fields(Io& io, M& wrench) requires std::same_as<const M, const ExternalWrench> {
  io.u8(wrench.link);
  io.vector_within(wrench.F_W, kLargestForce);
}

template <class Io, class M>
void fields(Io& io, M& drive) requires std::same_as<const M, const JointDrive> {
  io.u8(drive.link);
  io.flag(drive.follows_device);
  io.f64(drive.target, Within{kLargestLength});
  io.f64(drive.closed, Within{kLargestLength});
  io.f64(drive.open, Within{kLargestLength});
  for (auto* limit : {&drive.stiffness, &drive.damping, &drive.most}) {
    io.f64(*limit, Within{kLargestDrive});
    io.require(*limit >= 0, UpdateError::kRange);
  }
}

template <class Io, class M>
void fields(Io& io, M& rate) requires std::same_as<const M, const AccelerationRate> {
  io.u32(rate.body);
  io.vector_within(rate.A_rate_W, kLargestAccelerationRate);
}

template <class Io, class M>
void block(Io& io, M& state) requires std::same_as<const M, const ProxyState> {
  io.u64(state.acknowledged);
  io.u64(state.step);
  io.f64(state.age, Sign::kNotNegative);
  io.f64(state.update_send_time);
  io.f64(state.hold, Sign::kNotNegative);
  io.enumeration(state.server);
  io.enumeration(state.fault);
  io.enumeration(state.contact_state);
  io.enumeration(state.limit);
  io.u16(state.active_contacts);
  io.u16(state.predicted_contacts);
  io.f64(state.smallest_separation);
  io.unit_pose(state.X_WD);
  io.vector(state.V_WD);
  io.vector(state.F_env);
  io.vector(state.F_command);
  io.vector(state.F_hand);
  io.flag(state.hand_measured);
  io.u32(state.buttons);
  io.f64(state.gripper);
  io.f64(state.scale, Sign::kPositive);
  io.u64(state.overruns);
  io.u64(state.updates);
  io.u64(state.dropped);
  io.u64(state.control);
  io.size(state.q);
  io.size(state.v);
  io.vector(state.q);
  io.vector(state.v);
  io.appended_enumeration(state.fade);
  io.appended_f64(state.given);
  io.appended_f64(state.taken);
  io.appended_f64(state.explained);
  io.appended_f64(state.tank);
  io.appended_f64(state.brought);
  io.appended_flag(state.hand_observed);
  io.appended_f64(state.lowered);
  io.appended_u32(state.scene);
  // Clients of 0.4 read five bytes more, and take what is not 0 for something wrong with a body.
  std::uint32_t spare = 0;
  std::uint8_t spare_byte = 0;
  io.appended_u32(spare);
  io.appended_u8(spare_byte, 0);
  io.appended_f64(state.grip);
}

template <class Io, class M>
void block(Io& io, M& goodbye) requires std::same_as<const M, const Goodbye> {
  io.enumeration(goodbye.reason);
}

template <class Io, class M>
void block(Io& io, M& control) requires std::same_as<const M, const Control> {
  io.flag(control.telemetry);
  io.flag(control.holds);
  io.unit_pose(control.X_WTarget);
  for (const double x : control.X_WTarget.p) io.require(std::abs(x) <= kLargestLength);
  io.flag(control.tuned);
  tuning(io, control.tuning);
  io.require(is_in_range(control.tuning));
}

template <class Io, class M>
void block(Io& io, M& ticks) requires std::same_as<const M, const Ticks> {
  io.u64(ticks.first_step);
  io.require(ticks.first_step > 0);
}

template <class Io, class M>
void fields(Io& io, M& tick) requires std::same_as<const M, const TickSignals> {
  io.vector(tick.F_env);
  io.vector(tick.F_command);
  io.vector(tick.F_hand);
  io.f64(tick.torque);
  io.f64(tick.smallest_separation);
  io.f64(tick.device_proxy);
  io.f64(tick.proxy_tool);
  io.f64(tick.lateness);
  io.f64(tick.execution);
  io.f64(tick.age);
  io.u16(tick.active_contacts);
  io.u16(tick.predicted_contacts);
  io.flag(tick.adopted);
  io.enumeration(tick.limit);
}

template <class Io, class M>
void block(Io& io, M& state) requires std::same_as<const M, const LocalState> {
  io.u64(state.step);
}

template <class Io, class M>
void fields(Io& io, M& contact) requires std::same_as<const M, const LocalContactReport> {
  io.u64(contact.identity);
  io.enumeration(contact.a.kind);
  io.enumeration(contact.b.kind);
  io.u32(contact.a.index);
  io.u32(contact.b.index);
  io.enumeration(contact.state);
  io.flag(contact.retained);
  io.vector(contact.c_W);
  io.unit_vector(contact.n_W);
  io.vector(contact.p_W);
  io.f64(contact.s);
  io.vector(contact.f_W);
}

template <class Io, class M>
void block(Io& io, M& refusal) requires std::same_as<const M, const Refusal> {
  io.u64(refusal.refused);
  io.enumeration(refusal.error);
  io.flag(refusal.whole);
  io.u16(refusal.item);
  io.u64(refusal.count);
}

template <class Io, class M>
void block(Io& io, M& impulses) requires std::same_as<const M, const Impulses> {
  io.u64(impulses.step);
}

template <class Io, class M>
void fields(Io& io, M& impulse) requires std::same_as<const M, const BodyImpulse> {
  io.u32(impulse.body);
  io.vector(impulse.P_W);
}

template <class Io, class M>
void block(Io& io, M& held) requires std::same_as<const M, const HeldBodies> {
  io.u64(held.step);
}

template <class Io, class M>
void fields(Io& io, M& held) requires std::same_as<const M, const HeldBody> {
  io.u32(held.body);
  io.u32(held.number);
  io.unit_pose(held.X_WB);
  io.vector(held.V_W);
}

template <class Io, class M>
void fields(Io& io, M& owner) requires std::same_as<const M, const Ownership> {
  io.u32(owner.body);
  io.u32(owner.number);
  io.flag(owner.kept);
  io.u8(owner.slowed);
}

template <class Io, class M>
void block(Io& io, M& chunk) requires std::same_as<const M, const SceneChunk> {
  io.u64(chunk.number);
  io.long_size(chunk.data);
  io.bytes(chunk.data);
}

template <class Io, class M>
void block(Io& io, M& state) requires std::same_as<const M, const SceneState> {
  io.u64(state.next);
  for (auto& word : state.bitmap) io.u64(word);
  io.u32(state.scene);
  io.u32(state.received_scene);
  io.u32(state.shapes);
  io.u32(state.placements);
  io.u64(state.bytes);
  io.enumeration(state.error);
  io.u32(state.item);
  text(io, state.text);
}

}  // namespace hlm::protocol::layout
