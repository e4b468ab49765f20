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
#include <cstring>
#include <optional>
#include <span>

#include <boost/endian/conversion.hpp>

#include "hlm/common/friction_limit.h"
#include "hlm/common/joint_drive.h"
#include "hlm/common/spatial.h"
#include "hlm/common/vocabulary.h"
#include "hlm/protocol/datagram_link.h"
#include "hlm/protocol/semidefinite.h"
#include "hlm/protocol/statistics.h"

namespace hlm::protocol {

/// Bounds beyond which a number is a mistake, not a place: lengths, m; speeds, m/s and rad/s;
/// accelerations, m/s² and rad/s². Without them one absurd number moves the proxy there.
inline constexpr double kLargestLength = 1e4;
inline constexpr double kLargestSpeed = 1e3;
inline constexpr double kLargestAcceleration = 1e6;
inline constexpr double kLargestAccelerationRate = 1e8;
/// Mobility of a body, 1/kg and 1/(kg·m²): a body of a milligram, and what it turns by.
inline constexpr double kLargestMobility = 1e12;
/// Impulse of the tool on a body in a session, N·s and N·m·s.
inline constexpr double kLargestImpulse = 1e6;
inline constexpr double kLargestUnit = 2;     ///< Largest unit-vector coordinate before scaling.
inline constexpr double kLargestForce = 1e6;  ///< N.
inline constexpr double kLongestSpan = 1e6;   ///< s.

/// Makes a vector that is of length 1 within kUnitTolerance exactly so; false for any other. What
/// is exact to rounding stays as it was sent, bit for bit.
template <class Vector>
bool normalize_if_near(Vector&& v) noexcept {
  constexpr double kRounding = 1e-15;
  const double error = std::abs(v.norm() - 1);
  if (!(error <= kUnitTolerance)) return false;
  if (error > kRounding) v /= v.norm();
  return true;
}

/// What sign a number may have.
enum class Sign { kAny, kNotNegative, kPositive };

/// A number within ±bound.
struct Within {
  double bound;
};

/// The fields that are made of others, for Writer and Reader.
template <class Self>
class CompoundFields {
 public:
  template <class Vector>
  void vector(Vector& values) noexcept {
    self().f64s(values, Sign::kAny);
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
  /// A pose whose quaternion is of length 1 within the tolerance, and then made so.
  template <class P>
  void unit_pose(P& X) noexcept {
    pose(X);
    self().normalize(X.R.coeffs());
  }
  /// A pose whose quaternion is made to be of length 1 if it nearly is, and otherwise left alone.
  template <class P>
  void nearly_unit_pose(P& X) noexcept {
    pose(X);
    self().normalize_if_near(X.R.coeffs());
  }
  /// A pose of an update: not far away, and its quaternion of length 1 within the tolerance.
  template <class P>
  void near_pose(P& X) noexcept {
    pose(X);
    for (const double x : X.p) self().require(std::abs(x) <= kLargestLength, UpdateError::kRange);
    self().normalize(X.R.coeffs(), UpdateError::kQuaternion);
  }
  template <class Vector>
  void unit_vector(Vector& n) noexcept {
    vector(n);
    self().normalize(n);
  }
  template <class Vector>
  void vector_within(Vector& values, double bound) noexcept {
    self().f64s(values, Within{bound});
  }
  template <class Vector>
  void short_vector_within(Vector& values, double bound) noexcept {
    for (auto& value : values) self().f32(value, Within{bound});
  }
  /// A time between two moments, s.
  template <class Time>
  void span(Time& time) noexcept {
    self().f64(time, Within{kLongestSpan});
    self().require(time >= 0, UpdateError::kRange);
  }
  /// A symmetric matrix: its upper triangle, row by row.
  template <class Matrix>
  void symmetric_within(Matrix& M, double bound) noexcept {
    for (int row = 0; row < M.rows(); ++row) {
      for (int column = row; column < M.cols(); ++column) {
        self().f64(M(row, column), Within{bound});
        self().mirror(M, row, column);
      }
    }
  }

  /// No bytes: the matrix before has no negative eigenvalue.
  template <class Matrix>
  void mobility(Matrix& W) noexcept {
    self().require(is_mobility(W), UpdateError::kRange);
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
  void f64(double value, Sign = Sign::kAny) noexcept {
    append(std::bit_cast<std::uint64_t>(value));
  }
  void f64(double value, Within) noexcept { append(std::bit_cast<std::uint64_t>(value)); }
  template <class Vector, class Allowed>
  void f64s(const Vector& values, Allowed) noexcept {
    for (const double value : values) f64(value);
  }
  void f32(double value, Sign = Sign::kAny) noexcept {
    append(std::bit_cast<std::uint32_t>(static_cast<float>(value)));
  }
  void f32(double value, Within) noexcept { f32(value); }
  template <class Enum>
  void enumeration(Enum value) noexcept {
    append(static_cast<std::uint8_t>(value));
  }
  template <class Vector>
  void normalize(const Vector&, UpdateError = UpdateError::kNormal) noexcept {}
  template <class Vector>
  void normalize_if_near(const Vector&) noexcept {}
  template <class Matrix>
  void mirror(const Matrix&, int, int) noexcept {}
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
  /// Number of bytes that follow.
  template <class Bytes>
  void long_size(const Bytes& bytes) noexcept {
    append(static_cast<std::uint16_t>(bytes.size()));
  }
  template <class Bytes>
  void bytes(const Bytes& bytes) noexcept {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  }
  void flag(bool value) noexcept { append(static_cast<std::uint8_t>(value ? 1 : 0)); }
  void appended_flag(bool value) noexcept { flag(value); }
  void appended_f64(double value) noexcept { f64(value); }
  template <class Enum>
  void appended_enumeration(Enum value) noexcept {
    this->enumeration(value);
  }
  void appended_u8(std::uint8_t value, std::uint8_t) noexcept { append(value); }
  void appended_u32(std::uint32_t value) noexcept { append(value); }
  void require(bool, UpdateError = UpdateError::kLayout) noexcept {}

 private:
  template <std::unsigned_integral T>
  void append(T value) noexcept {
    const T little = boost::endian::native_to_little(value);
    const std::size_t end = bytes_.size();
    bytes_.resize(end + sizeof(T), boost::container::default_init);
    std::memcpy(bytes_.data() + end, &little, sizeof(T));
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
  void f64(double& value, Sign sign = Sign::kAny) noexcept {
    check(value = number(std::bit_cast<double>(take<std::uint64_t>())), sign);
  }
  void f64(double& value, Within within) noexcept {
    check(value = number(std::bit_cast<double>(take<std::uint64_t>())), within);
  }
  /// All coordinates of a vector, copied at once: what follows may load several of them together.
  template <class Vector, class Allowed>
  void f64s(Vector& values, Allowed allowed) noexcept {
    const std::size_t size = sizeof(double) * static_cast<std::size_t>(values.size());
    if (!has(size)) return refuse(DropReason::kMalformed, UpdateError::kLayout);
    std::memcpy(values.data(), bytes_.data() + position_, size);
    position_ += size;
    for (double& value : values) {
      value = std::bit_cast<double>(
          boost::endian::little_to_native(std::bit_cast<std::uint64_t>(value)));
      check(value, allowed);
    }
  }
  void f32(double& value, Sign sign = Sign::kAny) noexcept {
    check(value = number(std::bit_cast<float>(take<std::uint32_t>())), sign);
  }
  void f32(double& value, Within within) noexcept {
    check(value = number(std::bit_cast<float>(take<std::uint32_t>())), within);
  }
  /// Any value: one that this version does not know is for whoever uses it to skip.
  template <class Enum>
  void enumeration(Enum& value) noexcept {
    value = static_cast<Enum>(take<std::uint8_t>());
  }
  template <class Vector>
  void normalize(Vector&& v, UpdateError error = UpdateError::kNormal) noexcept {
    require(hlm::protocol::normalize_if_near(v), error);
  }
  template <class Vector>
  void normalize_if_near(Vector&& v) noexcept {
    hlm::protocol::normalize_if_near(v);
  }
  template <class Matrix>
  void mirror(Matrix& M, int row, int column) noexcept {
    M(column, row) = M(row, column);
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
  template <class Bytes>
  void long_size(Bytes& bytes) noexcept {
    const auto count = take<std::uint16_t>();
    const bool allowed = count >= 1 && count <= bytes.capacity();
    require(allowed);
    bytes.resize(allowed ? count : 1, boost::container::default_init);
  }
  /// Of the length that `bytes` has.
  template <class Bytes>
  void bytes(Bytes& bytes) noexcept {
    if (!has(bytes.size())) return refuse(DropReason::kMalformed, UpdateError::kLayout);
    std::memcpy(bytes.data(), bytes_.data() + position_, bytes.size());
    position_ += bytes.size();
  }
  void require(bool condition, UpdateError error = UpdateError::kLayout) noexcept {
    if (!condition) refuse(DropReason::kMalformed, error);
  }

  /// Fields that an older sender of this version does not know: without them the value is false,
  /// 0, the first of an enumeration, or `otherwise`.
  void appended_flag(bool& value) noexcept {
    value = false;
    if (position_ < bytes_.size()) flag(value);
  }
  void appended_f64(double& value) noexcept {
    value = 0;
    if (position_ < bytes_.size()) f64(value);
  }
  template <class Enum>
  void appended_enumeration(Enum& value) noexcept {
    value = Enum{};
    if (position_ < bytes_.size()) this->enumeration(value);
  }
  void appended_u8(std::uint8_t& value, std::uint8_t otherwise) noexcept {
    value = otherwise;
    if (position_ < bytes_.size()) u8(value);
  }
  void appended_u32(std::uint32_t& value) noexcept {
    value = 0;
    if (position_ < bytes_.size()) u32(value);
  }
  bool at_end() const noexcept { return position_ == bytes_.size(); }
  std::size_t position() const noexcept { return position_; }
  /// Why the bytes are refused; the first reason counts. Empty if all is well so far.
  std::optional<DropReason> error() const noexcept { return error_; }
  /// The same, in the words of a refusal.
  UpdateError update_error() const noexcept { return update_error_; }
  /// Goes on at `position`, past what this version does not know; refuses if it has been passed or
  /// lies beyond the end.
  void skip_to(std::size_t position) noexcept {
    require(position_ <= position && position <= bytes_.size());
    position_ = position;
  }

 private:
  void refuse(DropReason reason, UpdateError error) noexcept {
    if (error_) return;
    error_ = reason;
    update_error_ = error;
  }
  /// Zero has no sign: what is allowed from zero on may become a divisor.
  static double number(double value) noexcept { return value + 0.0; }
  bool check_finite(double value) noexcept {
    if (std::isfinite(value)) return true;
    refuse(DropReason::kNonFinite, UpdateError::kNonFinite);
    return false;
  }
  void check(double value, Sign sign) noexcept {
    if (!check_finite(value)) return;
    require(sign == Sign::kAny || value > 0 || (sign == Sign::kNotNegative && value == 0),
            UpdateError::kRange);
  }
  void check(double value, Within within) noexcept {
    if (check_finite(value)) require(std::abs(value) <= within.bound, UpdateError::kRange);
  }

  bool has(std::size_t size) const noexcept {
    return position_ <= bytes_.size() && bytes_.size() - position_ >= size;
  }

  template <std::unsigned_integral T>
  T take() noexcept {
    if (!has(sizeof(T))) {
      refuse(DropReason::kMalformed, UpdateError::kLayout);
      return 0;
    }
    T little = 0;
    std::memcpy(&little, bytes_.data() + position_, sizeof(T));
    position_ += sizeof(T);
    return boost::endian::little_to_native(little);
  }

  std::span<const std::byte> bytes_;
  std::size_t position_;
  std::optional<DropReason> error_;
  UpdateError update_error_ = UpdateError::kNone;
};

}  // namespace hlm::protocol
