// The order of the fields in each message's body. PROTOCOL.md says the same in tables.
//
// Each function serves Writer (M is const) and Reader.
#pragma once

#include <cstddef>

#include "protocol/messages.h"
#include "protocol/wire.h"

namespace hlm::protocol::layout {

/// Links in each part of a hello but the last.
inline constexpr std::size_t kLinksPerPart = 5;
/// Contacts in each part of a contact update but the last.
inline constexpr std::size_t kContactsPerPart = 9;

inline constexpr std::size_t kHeaderSize = 40;
inline constexpr std::size_t kDoubleSize = 8;
inline constexpr std::size_t kLinkSize = 162;
inline constexpr std::size_t kContactSize = 94;
/// Body without the list, for the largest q and q̇.
inline constexpr std::size_t kLargestHelloBlock = 114 + kDoubleSize * kMaxConfiguration;
inline constexpr std::size_t kLargestUpdateBlock = 42 + kDoubleSize * (kMaxConfiguration + kMaxDof);

inline constexpr std::size_t kLargestHello =
    kHeaderSize + kLargestHelloBlock + kLinksPerPart * kLinkSize;
inline constexpr std::size_t kLargestUpdate =
    kHeaderSize + kLargestUpdateBlock + kContactsPerPart * kContactSize;
inline constexpr std::size_t kLargestProxyState =
    kHeaderSize + 337 + kDoubleSize * (kMaxConfiguration + kMaxDof);
inline constexpr std::size_t kTickSize = 16 * kDoubleSize + 6;
inline constexpr std::size_t kLocalContactSize = 13 * kDoubleSize + 4;
/// Local contacts in each part of a local state but the last.
inline constexpr std::size_t kLocalContactsPerPart = 10;
static_assert(kLargestHello <= kMaxDatagram);
static_assert(kHeaderSize + 8 + kTicksPerMessage * kTickSize <= kMaxDatagram);
static_assert(kHeaderSize + 9 + kLocalContactsPerPart * kLocalContactSize <= kMaxDatagram);
static_assert(kLargestUpdate <= kMaxDatagram);
static_assert(kLargestProxyState <= kMaxDatagram);

template <class Io, class M>
void body(Io& io, M& hello) requires std::same_as<const M, const Hello> {
  io.u64(hello.nonce);
  io.f64(hello.ve_rate, Range::kPositive);
  io.f64(hello.epsilon, Range::kNotNegative);
  io.vector(hello.tool.gravity_W);
  io.f64(hello.tool.length);
  io.pose(hello.tool.X_LH);
  io.u8(hello.tool.hand_link);
  io.size(hello.q);
  io.vector(hello.q);
}

/// What the tool's description says wrongly is left to find_error(), which can tell the user.
template <class Io, class M>
void item(Io& io, M& link) requires std::same_as<const M, const Link> {
  io.i8(link.parent);
  io.enumeration(link.joint, JointType::kFixed, JointType::kFree);
  io.pose(link.X_PJ);
  io.vector(link.axis);
  io.f64(link.mass);
  io.vector(link.p_LCom);
  auto& I = link.I_LCom;
  for (int i = 0; i < 3; ++i) io.f64(I(i, i));
  io.f64(I(0, 1));
  io.f64(I(0, 2));
  io.f64(I(1, 2));
}

template <class Io, class M>
void tuning(Io& io, M& tuning) {
  io.enumeration(tuning.update_rule, UpdateRule::kRetain, UpdateRule::kPlaneRecovery);
  io.enumeration(tuning.controller, ControllerKind::kFourChannel, ControllerKind::kEngineForce);
  for (const TuningRange& range : kTuningRanges) io.f64(tuning.*range.number);
}

template <class Io, class M>
void body(Io& io, M& welcome) requires std::same_as<const M, const Welcome> {
  io.u64(welcome.nonce);
  io.f64(welcome.servo_rate, Range::kPositive);
  io.u64(welcome.configuration);
  tuning(io, welcome.tuning);
  io.flag(welcome.guidable);
}

template <class Io, class M>
void body(Io& io, M& reject) requires std::same_as<const M, const Reject> {
  io.u64(reject.nonce);
  io.enumeration(reject.reason, RejectReason::kVersion, RejectReason::kTool);
  io.text_size(reject.text);
  io.u16(reject.version);
  io.text(reject.text);
}

template <class Io, class M>
void body(Io& io, M& update) requires std::same_as<const M, const ContactUpdate> {
  io.f64(update.ve_time);
  io.f64(update.ve_period, Range::kNotNegative);
  io.f64(update.compute_time, Range::kNotNegative);
  io.u64(update.echo_step);
  io.f64(update.echo_hold, Range::kNotNegative);
  io.size(update.q_VE);
  io.size(update.v_VE);
  io.vector(update.q_VE);
  io.vector(update.v_VE);
}

template <class Io, class M>
void feature(Io& io, M& feature) {
  io.enumeration(feature.kind, FeatureKind::kVertex, FeatureKind::kFace);
  io.u8(feature.shape);
  io.u16(feature.index);
}

template <class Io, class M>
void item(Io& io, M& contact) requires std::same_as<const M, const ReportedContact> {
  io.u16(contact.key.link);
  feature(io, contact.key.tool_feature);
  io.u32(contact.key.body);
  feature(io, contact.key.body_feature);
  io.vector(contact.p_WC);
  io.unit_vector(contact.n_W);
  io.f64(contact.separation);
  io.vector(contact.v_WC);
}

template <class Io, class M>
void body(Io& io, M& state) requires std::same_as<const M, const ProxyState> {
  io.u64(state.acknowledged);
  io.u64(state.step);
  io.f64(state.age, Range::kNotNegative);
  io.f64(state.update_send_time);
  io.f64(state.hold, Range::kNotNegative);
  io.enumeration(state.server, ServerState::kIdle, ServerState::kFault);
  io.enumeration(state.fault, Fault::kNone, Fault::kDevice);
  io.enumeration(state.contact_state, ProxyContactState::kFreeMotion, ProxyContactState::kResting);
  io.size(state.q);
  io.size(state.v);
  io.u16(state.active_contacts);
  io.u16(state.predicted_contacts);
  io.f64(state.smallest_separation);
  io.unit_pose(state.X_WD);
  io.vector(state.V_WD);
  io.vector(state.F_env);
  io.vector(state.F_command);
  io.vector(state.F_hand);
  io.u64(state.overruns);
  io.u64(state.updates);
  io.u64(state.dropped);
  io.u64(state.control);
  io.vector(state.q);
  io.vector(state.v);
}

template <class Io, class M>
void body(Io& io, M& goodbye) requires std::same_as<const M, const Goodbye> {
  io.enumeration(goodbye.reason, GoodbyeReason::kFinished, GoodbyeReason::kShutdown);
}

template <class Io, class M>
void body(Io& io, M& control) requires std::same_as<const M, const Control> {
  io.flag(control.telemetry);
  io.flag(control.holds);
  io.unit_pose(control.X_WTarget);
  io.flag(control.tuned);
  tuning(io, control.tuning);
  io.require(is_in_range(control.tuning));
}

template <class Io, class M>
void body(Io& io, M& ticks) requires std::same_as<const M, const Ticks> {
  io.u64(ticks.first_step);
  io.require(ticks.first_step > 0);
}

template <class Io, class M>
void item(Io& io, M& tick) requires std::same_as<const M, const TickSignals> {
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
  io.enumeration(tick.limit, ForceLimit::kNone, ForceLimit::kFade);
}

template <class Io, class M>
void body(Io& io, M& state) requires std::same_as<const M, const LocalState> {
  io.u64(state.step);
  io.enumeration(state.limit, ForceLimit::kNone, ForceLimit::kFade);
}

template <class Io, class M>
void item(Io& io, M& contact) requires std::same_as<const M, const LocalContactReport> {
  io.u16(contact.link);
  io.enumeration(contact.state, ContactState::kImpending, ContactState::kSeparating);
  io.flag(contact.retained);
  io.vector(contact.c_W);
  io.unit_vector(contact.n_W);
  io.vector(contact.p_W);
  io.f64(contact.s);
  io.vector(contact.f_W);
}

}  // namespace hlm::protocol::layout
