// A list of fields that the dissector must show, and the names that the vocabulary lacks.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "hlm/protocol/messages.h"
#include "hlm/sealing/packets.h"
#include "tests/protocol/tshark.h"
#include "tests/support/catch.h"

// The names of what the vocabulary does not name.
namespace hlm {

template <>
inline constexpr std::array<Word<JointType>, 5> kWords<JointType>{{
    {JointType::kFixed, "fixed", ""},
    {JointType::kRevolute, "revolute", ""},
    {JointType::kPrismatic, "prismatic", ""},
    {JointType::kPlanar, "planar", ""},
    {JointType::kFree, "free", ""},
}};
template <>
inline constexpr std::array<Word<protocol::MessageType>, 11> kWords<protocol::MessageType>{{
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
}};
template <>
inline constexpr std::array<Word<protocol::PacketType>, 3> kWords<protocol::PacketType>{{
    {protocol::PacketType::kInitiation, "initiation", ""},
    {protocol::PacketType::kResponse, "response", ""},
    {protocol::PacketType::kSealed, "sealed", ""},
}};

}  // namespace hlm

namespace hlm::test {

/// The fields that a datagram must show, in order.
class Expected {
 public:
  explicit Expected(std::string prefix) : prefix_(std::move(prefix)) {}

  void number(const std::string& name, double value) { add(name, value, kDoubleDigits); }
  /// Of single precision.
  void short_number(const std::string& name, double value) { add(name, value, kFloatDigits); }
  void text(const std::string& name, const std::string& value) {
    fields_.push_back({prefix_ + name, std::nan(""), 0, ": " + value});
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
  /// A value that has a name, or is unknown.
  template <class Enum>
  void code(const std::string& name, Enum value) {
    text(name, std::string(name_of(value)) + " (" + std::to_string(static_cast<int>(value)) + ")");
  }
  void flag(const std::string& name, bool value) { text(name, value ? "yes (1)" : "no (0)"); }
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
  void wrench(const std::string& name, const Wrench& F) {
    vector(name + ".force", F.head<3>());
    vector(name + ".torque", F.tail<3>());
  }
  void short_vector(const std::string& name, const Vector3& v) {
    short_number(name + ".x", v.x());
    short_number(name + ".y", v.y());
    short_number(name + ".z", v.z());
  }
  /// A vector of a linear and an angular part.
  void halves(const std::string& name, const Vector6& v) {
    vector(name + ".linear", v.head<3>());
    vector(name + ".angular", v.tail<3>());
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
        const double tolerance = std::abs(fields_[i].number) * fields_[i].tolerance;
        CHECK(std::abs(std::stod(shown[i].value) - fields_[i].number) <= tolerance);
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
    std::string name;
    double number;       ///< Not a number: only the text is compared.
    double tolerance;    ///< Of the number, relative.
    std::string ending;  ///< Of the text, behind the label.
  };
  void add(const std::string& name, double number, double tolerance) {
    fields_.push_back({prefix_ + name, number, tolerance, ""});
  }

  std::string prefix_;
  std::vector<Field> fields_;
};

}  // namespace hlm::test
