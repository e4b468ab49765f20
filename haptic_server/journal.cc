#include "hlm/haptic_server/journal.h"

#include <bit>
#include <cmath>

#include "hlm/protocol/wire.h"

namespace hlm::server {
namespace {

using protocol::Reader;
using protocol::Writer;

constexpr std::uint32_t kMagic = 0x4A4D4C48;  // "HLMJ".
constexpr std::uint8_t kDevice = 1;
constexpr std::uint8_t kTick = 2;

/// A number as it is, infinite or not a number, too.
template <class Archive>
void number(Archive& archive, double& value) {
  auto bits = std::bit_cast<std::uint64_t>(value);
  archive.u64(bits);
  value = std::bit_cast<double>(bits);
}

template <class Archive, class Vector>
void numbers(Archive& archive, Vector& values) {
  for (Eigen::Index i = 0; i < values.size(); ++i) number(archive, values[i]);
}

/// Whether there is a value, and the value.
template <class Archive, class Value, class Fields>
void optional(Archive& archive, std::optional<Value>& value, Fields&& fields) {
  bool there = value.has_value();
  archive.flag(there);
  if (!there) return value.reset();
  if (!value) value.emplace();
  fields(*value);
}

template <class Archive>
void fields(Archive& archive, DeviceNote& note) {
  DeviceRatings& r = note.ratings;
  for (double* rating :
       {&r.max_force, &r.max_torque, &r.max_force_rate, &r.max_torque_rate, &r.max_power,
        &r.max_turning_power, &r.max_stiffness, &r.max_angular_stiffness, &r.mass, &r.inertia,
        &r.damping, &r.scale, &r.rotation_scale, &r.time_guard, &r.exchange_rate, &r.delay}) {
    number(archive, *rating);
  }
  archive.u8(r.buttons);
  archive.flag(r.gripper);
  archive.u8(r.freedoms);
  archive.flag(r.halts);
  archive.flag(note.measures_hand);
  archive.flag(note.observes_hand);
  archive.appended_f64(r.velocity_lag);
  archive.appended_f64(r.speed_step);
  archive.appended_f64(r.turn_step);
  // 0 is not rated, as in notes without it.
  double continuous = std::isfinite(r.continuous_force) ? r.continuous_force : 0;
  archive.appended_f64(continuous);
  r.continuous_force = continuous > 0 ? continuous : DeviceRatings{}.continuous_force;
  archive.appended_f64(r.max_gripper_force);
  archive.appended_f64(r.gripper_travel);
}

template <class Archive>
void fields(Archive& archive, DeviceState& state) {
  numbers(archive, state.X_WD.p);
  numbers(archive, state.X_WD.R.coeffs());
  numbers(archive, state.V_WD);
  optional(archive, state.F_hand, [&](Wrench& F) { numbers(archive, F); });
  archive.flag(state.hand_observed);
  archive.u32(state.buttons);
  optional(archive, state.gripper, [&](double& opening) { number(archive, opening); });
  archive.enumeration(state.health);
  archive.flag(state.clutched);
}

template <class Archive>
void fields(Archive& archive, TickNote& note) {
  archive.u64(note.tick);
  number(archive, note.begin);
  archive.u64(note.missed);
  archive.enumeration(note.act);
  archive.u64(note.lost);
  archive.flag(note.device.read);
  optional(archive, note.device.state, [&](DeviceState& state) { fields(archive, state); });
  archive.flag(note.device.written);
  std::uint8_t count = static_cast<std::uint8_t>(note.received.size());
  archive.u8(count);
  archive.require(count <= note.received.capacity());
  note.received.resize(std::min<std::size_t>(count, note.received.capacity()));
  for (std::uint32_t& channel : note.received) archive.u32(channel);
  archive.appended_u32(note.scene.number);
  archive.appended_u32(note.scene.chunks);
  std::uint32_t warm = note.device.state && note.device.state->warm ? 1 : 0;
  archive.appended_u32(warm);
  if (note.device.state) note.device.state->warm = warm != 0;
}

template <class Note>
protocol::DatagramBytes encoded(std::uint8_t kind, Note note) noexcept {
  protocol::DatagramBytes bytes;
  Writer writer(bytes);
  writer.u32(kMagic);
  writer.u8(kind);
  fields(writer, note);
  return bytes;
}

template <class Note>
bool decoded(std::span<const std::byte> bytes, std::uint8_t kind, Note& note) noexcept {
  Reader reader(bytes);
  std::uint32_t magic = 0;
  std::uint8_t own_kind = 0;
  reader.u32(magic);
  reader.u8(own_kind);
  if (magic != kMagic || own_kind != kind) return false;
  fields(reader, note);
  return !reader.error();
}

}  // namespace

protocol::DatagramBytes encode(const DeviceNote& note) noexcept { return encoded(kDevice, note); }
protocol::DatagramBytes encode(const TickNote& note) noexcept { return encoded(kTick, note); }

bool decode(std::span<const std::byte> bytes, DeviceNote& note) noexcept {
  return decoded(bytes, kDevice, note);
}
bool decode(std::span<const std::byte> bytes, TickNote& note) noexcept {
  return decoded(bytes, kTick, note);
}

void note_device(protocol::RecordingLink& link, const Device& device) noexcept {
  link.note(protocol::view(encode(DeviceNote{.ratings = device.ratings(),
                                             .measures_hand = device.measures_hand_wrench(),
                                             .observes_hand = device.observes_hand_wrench()})));
}

void note_tick(protocol::RecordingLink& link, const Timing& timing, Intervention act,
               const Servo& servo) noexcept {
  // Without a session a guard that is gone does nothing, and would be noted in every tick.
  const bool acts = act != Intervention::kNone && act != Intervention::kUnguarded;
  if (!servo.had_session() && !acts && link.received().empty()) return;
  link.note(protocol::view(encode(TickNote{.tick = timing.tick,
                                           .begin = timing.begin,
                                           .missed = timing.missed,
                                           .act = act,
                                           .lost = link.lost(),
                                           .device = servo.exchange(),
                                           .received = link.received(),
                                           .scene = servo.scene_exchange()})));
}

}  // namespace hlm::server
