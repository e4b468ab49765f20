// Fields to and from bytes, one after the other: little-endian integers and IEEE doubles.
//
// Writer and Reader have the same members, so that one function lists the fields of a message for
// both directions (layout.h). Only the Reader checks: what we send is right, or our own bug.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include <boost/endian/conversion.hpp>

#include "common/spatial.h"
#include "protocol/datagram_link.h"
#include "protocol/statistics.h"

namespace hlm::protocol {

/// Allowed deviation of a unit vector's or quaternion's length from 1: what survives rounding to
/// single precision, far below what a wrong unit would give.
inline constexpr double kUnitTolerance = 1e-6;

/// What a number may be.
enum class Range { kFinite, kNotNegative, kPositive };

/// The fields that are made of others, for Writer and Reader.
template <class Self>
class CompoundFields {
 public:
  template <class Vector>
  void vector(Vector& values) noexcept {
    for (auto& value : values) self().f64(value);
  }
  /// p x, y, z; R w, x, y, z.
  template <class P>
  void pose(P& X) noexcept {
    self().vector(X.p);
    self().f64(X.R.w());
    self().f64(X.R.x());
    self().f64(X.R.y());
    self().f64(X.R.z());
  }
  template <class P>
  void unit_pose(P& X) noexcept {
    pose(X);
    self().require(std::abs(X.R.norm() - 1) <= kUnitTolerance);
  }
  template <class Vector>
  void unit_vector(Vector& n) noexcept {
    vector(n);
    self().require(std::abs(n.norm() - 1) <= kUnitTolerance);
  }

 private:
  Self& self() noexcept { return static_cast<Self&>(*this); }
};

class Writer : public CompoundFields<Writer> {
 public:
  /// Appends to `bytes`; what does not fit is our own bug and aborts.
  explicit Writer(DatagramBytes& bytes) noexcept : bytes_(bytes) {}

  template <class T>
  void u8(const T& value) noexcept {
    append(static_cast<std::uint8_t>(value));
  }
  template <class T>
  void i8(const T& value) noexcept {
    append(static_cast<std::uint8_t>(static_cast<std::int8_t>(value)));
  }
  void u16(std::uint16_t value) noexcept { append(value); }
  void u32(std::uint32_t value) noexcept { append(value); }
  void u64(std::uint64_t value) noexcept { append(value); }
  void i64(std::int64_t value) noexcept { append(static_cast<std::uint64_t>(value)); }
  void f64(double value, Range = Range::kFinite) noexcept {
    append(std::bit_cast<std::uint64_t>(value));
  }
  template <class Enum>
  void enumeration(Enum value, Enum, Enum) noexcept {
    append(static_cast<std::uint8_t>(value));
  }
  /// Number of a vector's coordinates.
  template <class Vector>
  void size(const Vector& values) noexcept {
    append(static_cast<std::uint8_t>(values.size()));
  }
  template <class Text>
  void text_size(const Text& text) noexcept {
    append(static_cast<std::uint8_t>(text.size()));
  }
  template <class Text>
  void text(const Text& text) noexcept {
    for (const char c : text) append(static_cast<std::uint8_t>(c));
  }
  void flag(bool value) noexcept { append(static_cast<std::uint8_t>(value ? 1 : 0)); }
  void require(bool) noexcept {}

 private:
  template <std::unsigned_integral T>
  void append(T value) noexcept {
    const T little = boost::endian::native_to_little(value);
    const auto raw = std::bit_cast<std::array<std::byte, sizeof(T)>>(little);
    bytes_.insert(bytes_.end(), raw.begin(), raw.end());
  }

  DatagramBytes& bytes_;
};

class Reader : public CompoundFields<Reader> {
 public:
  explicit Reader(std::span<const std::byte> bytes, std::size_t position = 0) noexcept
      : bytes_(bytes), position_(position) {}

  template <class T>
  void u8(T& value) noexcept {
    value = static_cast<T>(take<std::uint8_t>());
  }
  template <class T>
  void i8(T& value) noexcept {
    const int byte = take<std::uint8_t>();
    value = static_cast<T>(byte < 128 ? byte : byte - 256);
  }
  void u16(std::uint16_t& value) noexcept { value = take<std::uint16_t>(); }
  void u32(std::uint32_t& value) noexcept { value = take<std::uint32_t>(); }
  void u64(std::uint64_t& value) noexcept { value = take<std::uint64_t>(); }
  void flag(bool& value) noexcept {
    const auto byte = take<std::uint8_t>();
    require(byte <= 1);
    value = byte == 1;
  }
  void i64(std::int64_t& value) noexcept {
    value = static_cast<std::int64_t>(take<std::uint64_t>());
  }
  void f64(double& value, Range range = Range::kFinite) noexcept {
    value = std::bit_cast<double>(take<std::uint64_t>());
    if (!std::isfinite(value)) return refuse(DropReason::kNonFinite);
    require(range == Range::kFinite || value > 0 || (range == Range::kNotNegative && value == 0));
  }
  template <class Enum>
  void enumeration(Enum& value, Enum first, Enum last) noexcept {
    const auto code = take<std::uint8_t>();
    const bool known =
        code >= static_cast<std::uint8_t>(first) && code <= static_cast<std::uint8_t>(last);
    require(known);
    value = known ? static_cast<Enum>(code) : first;
  }
  /// Gives a vector of bounded length as many coordinates as were sent.
  template <class Vector>
  void size(Vector& values) noexcept {
    const auto count = take<std::uint8_t>();
    const bool allowed = count >= 1 && count <= Vector::MaxRowsAtCompileTime;
    require(allowed);
    values.setZero(allowed ? count : 1);
  }
  template <class Text>
  void text_size(Text& text) noexcept {
    const auto count = take<std::uint8_t>();
    require(count <= text.capacity());
    text.resize(std::min<std::size_t>(count, text.capacity()));
  }
  /// UTF-8 without control characters, of the length that `text` has.
  template <class Text>
  void text(Text& text) noexcept {
    for (char& c : text) {
      const auto code = take<std::uint8_t>();
      constexpr std::uint8_t kFirstPrintable = 0x20;
      constexpr std::uint8_t kDelete = 0x7F;
      require(code >= kFirstPrintable && code != kDelete);
      c = static_cast<char>(code);
    }
  }
  void require(bool condition) noexcept {
    if (!condition) refuse(DropReason::kMalformed);
  }

  std::size_t position() const noexcept { return position_; }
  /// Why the bytes are refused; the first reason counts. Empty if all is well so far.
  std::optional<DropReason> error() const noexcept { return error_; }
  /// The same after the last field: bytes must not be left over.
  std::optional<DropReason> finish() noexcept {
    require(position_ == bytes_.size());
    return error_;
  }

 private:
  void refuse(DropReason reason) noexcept {
    if (!error_) error_ = reason;
  }

  template <std::unsigned_integral T>
  T take() noexcept {
    if (position_ > bytes_.size() || bytes_.size() - position_ < sizeof(T)) {
      refuse(DropReason::kMalformed);
      return 0;
    }
    std::array<std::byte, sizeof(T)> raw;
    std::ranges::copy(bytes_.subspan(position_, sizeof(T)), raw.begin());
    position_ += sizeof(T);
    return boost::endian::little_to_native(std::bit_cast<T>(raw));
  }

  std::span<const std::byte> bytes_;
  std::size_t position_;
  std::optional<DropReason> error_;
};

}  // namespace hlm::protocol
