// A list of fields that the dissector must show, and the names that the vocabulary lacks.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "hlm/protocol/messages.h"
#include "hlm/protocol/sealing/packets.h"
#include "hlm/protocol/wire.h"
#include "tests/protocol/tshark.h"
#include "tests/support/catch.h"

// The names of what the vocabulary does not name.
namespace hlm {

template <>
inline constexpr std::array<Word<JointType>, 7> kWords<JointType>{{
    {JointType::kFixed, "fixed", ""},
    {JointType::kRevolute, "revolute", ""},
    {JointType::kPrismatic, "prismatic", ""},
    {JointType::kPlanar, "planar", ""},
    {JointType::kFree, "free", ""},
    {JointType::kGuided, "guided", ""},
    {JointType::kFollowing, "following", ""},
}};
template <>
inline constexpr std::array<Word<protocol::MessageType>, 14> kWords<protocol::MessageType>{{
    {protocol::MessageType::kHello, "hello", ""},
    {protocol::MessageType::kWelcome, "welcome", ""},
    {protocol::MessageType::kReject, "reject", ""},
    {protocol::MessageType::kContactUpdate, "contact_update", ""},
    {protocol::MessageType::kProxyState, "proxy_state", ""},
    {protocol::MessageType::kGoodbye, "goodbye", ""},
    {protocol::MessageType::kControl, "control", ""},
    {protocol::MessageType::kTicks, "ticks", ""},
    {protocol::MessageType::kLocalState, "local_state", ""},
    {protocol::MessageType::kRefusal, "refusal", ""},
    {protocol::MessageType::kImpulses, "impulses", ""},
    {protocol::MessageType::kSceneChunk, "scene_chunk", ""},
    {protocol::MessageType::kSceneState, "scene_state", ""},
    {protocol::MessageType::kHeldBodies, "held_bodies", ""},
}};
template <>
inline constexpr std::array<Word<protocol::PacketType>, 3> kWords<protocol::PacketType>{{
    {protocol::PacketType::kInitiation, "initiation", ""},
    {protocol::PacketType::kResponse, "response", ""},
    {protocol::PacketType::kSealed, "sealed", ""},
}};

}  // namespace hlm

namespace hlm::test {

/// The fields that a datagram must show, in order. Lists fields as Writer does, so that layout.h
/// says which a message has.
class Expected : public protocol::CompoundFields<Expected> {
 public:
  /// Of those that follow: the dissector's names begin with it.
  void begin(std::string prefix) { prefix_ = std::move(prefix); }

  template <class Integer>
  void integer(Integer value) {
    add({.integer = std::to_string(value)});
  }
  void shown(const std::string& value) { add({.ending = ": " + value}); }

  template <class T>
  void u8(const T& value) {
    integer(static_cast<unsigned>(value));
  }
  template <class T>
  void i8(const T& value) {
    integer(static_cast<int>(value));
  }
  void u16(std::uint16_t value) { integer(value); }
  void u32(std::uint32_t value) { integer(value); }
  void u64(std::uint64_t value) { integer(value); }
  template <class... Allowed>
  void f64(double value, Allowed...) {
    add({.number = value, .tolerance = kDoubleDigits});
  }
  template <class... Allowed>
  void f32(double value, Allowed...) {
    add({.number = value, .tolerance = kFloatDigits});
  }
  template <class Vector, class Allowed>
  void f64s(const Vector& values, Allowed) {
    for (const double value : values) f64(value);
  }
  /// A value that has a name, or is unknown.
  template <class Enum>
  void enumeration(Enum value) {
    shown(std::string(name_of(value)) + " (" + std::to_string(static_cast<int>(value)) + ")");
  }
  void flag(bool value) { shown(value ? "yes (1)" : "no (0)"); }
  template <class Vector>
  void size(const Vector& values) {
    integer(values.size());
  }
  template <class Text>
  void text_size(const Text& value) {
    integer(value.size());
  }
  template <class Text>
  void text(const Text& value) {
    if (!value.empty()) shown(std::string(value.begin(), value.end()));
  }
  void appended_flag(bool value) { flag(value); }
  void appended_f64(double value) { f64(value); }
  void appended_u8(std::uint8_t value, std::uint8_t) { integer(value); }
  void appended_u32(std::uint32_t value) { integer(value); }
  template <class Bytes>
  void long_size(const Bytes& value) {
    integer(value.size());
  }
  /// Shown as pairs of hexadecimal digits with colons between.
  template <class Bytes>
  void bytes(const Bytes& value) {
    std::string digits;
    for (const std::byte byte : value) {
      constexpr const char* kDigits = "0123456789abcdef";
      if (!digits.empty()) digits += ':';
      digits += kDigits[std::to_integer<std::size_t>(byte) / 16];
      digits += kDigits[std::to_integer<std::size_t>(byte) % 16];
    }
    add({.integer = digits});
  }
  template <class Enum>
  void appended_enumeration(Enum value) {
    enumeration(value);
  }
  template <class... Ignored>
  void normalize(const Ignored&...) {}
  template <class... Ignored>
  void normalize_if_near(const Ignored&...) {}
  template <class... Ignored>
  void mirror(const Ignored&...) {}
  template <class... Ignored>
  void require(const Ignored&...) {}

  /// Fails unless `shown` are these fields, adjacent, and fill a datagram of `length` bytes.
  void check(const std::vector<ShownField>& shown, std::size_t length) const {
    REQUIRE(shown.size() == fields_.size());
    std::size_t position = kIpAndUdpHeader;
    for (std::size_t i = 0; i < shown.size(); ++i) {
      const Field& field = fields_[i];
      INFO("field " << i << ": " << shown[i].name << ", " << shown[i].text);
      CHECK(shown[i].name.starts_with(field.prefix));
      CHECK(shown[i].text.ends_with(field.ending));
      if (!field.integer.empty()) CHECK(decimal(shown[i].value) == field.integer);
      if (!std::isnan(field.number)) {
        const double tolerance = std::abs(field.number) * field.tolerance;
        CHECK(std::abs(std::stod(shown[i].value) - field.number) <= tolerance);
      }
      CHECK(shown[i].position == position);
      position += shown[i].size;
    }
    CHECK(position == kIpAndUdpHeader + length);
  }

 private:
  static constexpr std::size_t kIpAndUdpHeader = 28;  ///< Bytes before the datagram.

  /// Relative error of the 15 and 6 digits that Wireshark shows.
  static constexpr double kDoubleDigits = 1e-14;
  static constexpr double kFloatDigits = 5e-6;

  struct Field {
    std::string integer = {};      ///< In decimal digits. Empty: none.
    std::string ending = {};       ///< Of the text, behind the label.
    double number = std::nan("");  ///< Not a number: none.
    double tolerance = 0;          ///< Of the number, relative.
    std::string prefix = {};       ///< Of the name.
  };
  void add(Field field) {
    field.prefix = prefix_;
    fields_.push_back(std::move(field));
  }
  /// Some are shown in hexadecimal digits.
  static std::string decimal(const std::string& shown) {
    return shown.starts_with("0x") ? std::to_string(std::stoull(shown, nullptr, 16)) : shown;
  }

  std::string prefix_;
  std::vector<Field> fields_;
};

}  // namespace hlm::test
