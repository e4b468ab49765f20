#include "hlm/protocol/scene_records.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstdio>
#include <cstring>
#include <string_view>
#include <type_traits>
#include <utility>

#include <boost/endian/conversion.hpp>

#include "hlm/common/range.h"
#include "hlm/protocol/wire.h"

namespace hlm::protocol {
namespace {

/// In front of each record: its kind and how many bytes follow.
constexpr std::size_t kRecordHeader = 5;
constexpr std::size_t kVertexSize = 24;
constexpr std::size_t kTriangleSize = 12;
/// What was read is let go in pieces of this size, bytes.
constexpr std::size_t kReadPiece = 65536;

constexpr Range kLengthRange{-kLargestLength, kLargestLength, "m"};
constexpr Range kSizeRange{0, kLargestLength, "m", true};
constexpr Range kFrictionRange{-kLargestFriction, kLargestFriction};

/// What a kind of shape has.
struct ShapeTraits {
  int sizes = 0;
  bool has_vertices = false;
  bool has_triangles = false;
};

ShapeTraits traits_of(SceneShapeKind kind) noexcept {
  switch (kind) {
    case SceneShapeKind::kSphere:
      return {.sizes = 1};
    case SceneShapeKind::kCapsule:
    case SceneShapeKind::kCylinder:
      return {.sizes = 2};
    case SceneShapeKind::kBox:
    case SceneShapeKind::kEllipsoid:
      return {.sizes = 3};
    case SceneShapeKind::kHull:
      return {.has_vertices = true};
    case SceneShapeKind::kMesh:
      return {.has_vertices = true, .has_triangles = true};
    case SceneShapeKind::kHalfSpace:
      break;
  }
  return {};
}

/// Appends fields.
class RecordWriter {
 public:
  explicit RecordWriter(std::vector<std::uint8_t>& bytes) : bytes_(bytes) {}

  template <std::unsigned_integral T>
  void number(T value) {
    const T little = boost::endian::native_to_little(value);
    const std::size_t end = bytes_.size();
    bytes_.resize(end + sizeof(T));
    std::memcpy(bytes_.data() + end, &little, sizeof(T));
  }
  void f64(double value) { number(std::bit_cast<std::uint64_t>(value)); }
  void vector(const Vector3& v) {
    for (const double x : v) f64(x);
  }
  void pose(const Pose& X) {
    vector(X.p);
    for (const double q : {X.R.w(), X.R.x(), X.R.y(), X.R.z()}) f64(q);
  }
  /// Makes the bytes behind `begin` those of a record.
  void finish(SceneRecordKind kind, std::size_t begin) {
    const auto length = static_cast<std::uint32_t>(bytes_.size() - begin - kRecordHeader);
    const std::uint32_t little = boost::endian::native_to_little(length);
    bytes_[begin] = static_cast<std::uint8_t>(kind);
    std::memcpy(bytes_.data() + begin + 1, &little, sizeof little);
  }

 private:
  std::vector<std::uint8_t>& bytes_;
};

/// What stands behind a shape's hash.
void write_shape(RecordWriter& writer, const SceneShape& shape) {
  writer.number(static_cast<std::uint8_t>(shape.kind));
  writer.vector(shape.size);
  writer.number(static_cast<std::uint32_t>(shape.vertices.size()));
  for (const Vector3& vertex : shape.vertices) writer.vector(vertex);
  writer.number(static_cast<std::uint32_t>(shape.triangles.size()));
  for (const auto& triangle : shape.triangles) {
    for (const std::uint32_t corner : triangle) writer.number(corner);
  }
}

SceneRecordKind write(RecordWriter& writer, const SceneShape& shape) {
  writer.number(hash_of(shape));
  write_shape(writer, shape);
  return SceneRecordKind::kShape;
}

SceneRecordKind write(RecordWriter& writer, const ScenePlacement& placement) {
  writer.number(placement.id);
  writer.number(placement.shape);
  writer.number(static_cast<std::uint8_t>(placement.side.kind));
  writer.number(placement.side.index);
  writer.pose(placement.X_BS);
  writer.number(std::bit_cast<std::uint32_t>(static_cast<float>(placement.friction.coefficient)));
  writer.number(placement.group);
  writer.number(placement.mask);
  writer.number(static_cast<std::uint8_t>(placement.friction.rule));
  writer.number(placement.friction.priority);
  return SceneRecordKind::kPlacement;
}

SceneRecordKind write(RecordWriter& writer, const SceneRemoval& removal) {
  writer.number(removal.id);
  return SceneRecordKind::kRemoval;
}

SceneRecordKind write(RecordWriter& writer, const SceneApart& apart) {
  writer.number(apart.a);
  writer.number(apart.b);
  return SceneRecordKind::kApart;
}

SceneRecordKind write(RecordWriter& writer, const SceneCommit& commit) {
  writer.number(commit.scene);
  return SceneRecordKind::kCommit;
}

std::string hexadecimal(std::uint64_t hash) {
  std::array<char, 17> digits{};
  std::snprintf(digits.data(), digits.size(), "%016llx", static_cast<unsigned long long>(hash));
  return digits.data();
}

/// Reads the fields of one record. The first fault counts; after it all numbers are 0.
class RecordFields {
 public:
  explicit RecordFields(std::span<const std::byte> bytes) : bytes_(bytes) {}

  template <std::unsigned_integral T>
  T number() {
    if (fault_ || !has(sizeof(T), 1)) return 0;
    T little = 0;
    std::memcpy(&little, bytes_.data() + position_, sizeof(T));
    position_ += sizeof(T);
    return boost::endian::little_to_native(little);
  }
  double f64(std::string_view name, const Range& range) {
    return checked(name, std::bit_cast<double>(number<std::uint64_t>()), range);
  }
  double f32(std::string_view name, const Range& range) {
    return checked(name, std::bit_cast<float>(number<std::uint32_t>()), range);
  }
  Vector3 vector(std::string_view name, const Range& range) {
    Vector3 v;
    for (double& x : v) x = f64(name, range);
    return v;
  }
  Pose pose(std::string_view name) {
    Pose X;
    X.p = vector(name, kLengthRange);
    std::array<double, 4> q{};
    for (double& part : q) part = f64(name, {-2, 2, ""});
    X.R = Quaternion(q[0], q[1], q[2], q[3]);
    if (!fault_ && !normalize_if_near(X.R.coeffs())) {
      refuse(SceneError::kMalformed, std::string(name) + ": quaternion's length " +
                                         shortest_text(X.R.norm()) + " must be 1 within 0.001");
    }
    return X;
  }
  /// A count of things of `size` bytes each that follow.
  std::size_t count(std::string_view name, std::size_t most, std::size_t size) {
    const auto count = std::size_t{number<std::uint32_t>()};
    if (count > most) {
      refuse(SceneError::kLimit, std::string(name) + " " + std::to_string(count) +
                                     " must be at most " + std::to_string(most));
    }
    return fault_ || !has(size, count) ? 0 : count;
  }
  std::span<const std::byte> rest() const { return bytes_.subspan(position_); }

  /// Whose fields they are, for the text: "placement 7".
  void name(std::string subject, std::uint32_t item = 0) {
    subject_ = std::move(subject);
    item_ = item;
  }
  void refuse(SceneError error, const std::string& why) {
    if (!fault_) fault_ = {error, item_, subject_ + ": " + why};
  }
  void require(bool holds, const char* why) {
    if (!holds) refuse(SceneError::kMalformed, why);
  }
  template <class Enum>
  Enum enumeration(const char* name) {
    const auto code = number<std::uint8_t>();
    const auto value = static_cast<Enum>(code);
    if (!is_known(value)) {
      refuse(SceneError::kMalformed, std::string(name) + " " + std::to_string(code) +
                                         " must be 0 to " +
                                         std::to_string(kWords<Enum>.size() - 1));
    }
    return value;
  }
  std::optional<SceneFault> fault() const { return fault_; }

 private:
  bool has(std::size_t size, std::size_t count) {
    if ((bytes_.size() - position_) / size >= count) return true;
    refuse(SceneError::kMalformed, "its " + std::to_string(bytes_.size()) +
                                       " bytes must be at least " +
                                       std::to_string(position_ + size * count));
    return false;
  }
  double checked(std::string_view name, double value, const Range& range) {
    if (fault_) return 0;
    if (const auto error = find_error(name, value, range)) refuse(SceneError::kMalformed, *error);
    return value;
  }

  std::span<const std::byte> bytes_;
  std::size_t position_ = 0;
  std::string subject_;
  std::uint32_t item_ = 0;
  std::optional<SceneFault> fault_;
};

void read_vertices(RecordFields& fields, std::size_t most, SceneShape& shape) {
  shape.vertices.resize(fields.count("vertices", most, kVertexSize));
  for (Vector3& vertex : shape.vertices) vertex = fields.vector("vertex", kLengthRange);
  if (fields.fault()) shape.vertices.clear();
}

void read_triangles(RecordFields& fields, std::size_t most, SceneShape& shape) {
  shape.triangles.resize(fields.count("triangles", most, kTriangleSize));
  for (auto& triangle : shape.triangles) {
    for (std::uint32_t& corner : triangle) {
      corner = fields.number<std::uint32_t>();
      if (corner < shape.vertices.size()) continue;
      return fields.refuse(SceneError::kMalformed,
                           "corner " + std::to_string(corner) + " of a triangle must be below " +
                               std::to_string(shape.vertices.size()) + ", the vertices");
    }
  }
}

SceneRecord read_shape(RecordFields& fields, const SceneLimits& limits) {
  SceneShape shape;
  fields.name("shape");
  shape.hash = fields.number<std::uint64_t>();
  fields.name("shape " + hexadecimal(shape.hash));
  const std::uint64_t hash = fnv1a(fields.rest());
  if (hash != shape.hash) {
    fields.refuse(SceneError::kHash, "its hash must be that of its bytes, " + hexadecimal(hash));
  }
  shape.kind = fields.enumeration<SceneShapeKind>("form");
  const ShapeTraits traits = traits_of(shape.kind);
  for (int i = 0; i < 3; ++i) {
    shape.size[i] = fields.f64("size", i < traits.sizes ? kSizeRange : Range{0, 0, "m"});
  }
  read_vertices(fields, limits.vertices, shape);
  read_triangles(fields, limits.triangles, shape);
  const std::string kind(name_of(shape.kind));
  fields.require(shape.vertices.empty() || traits.has_vertices,
                 ("a " + kind + " must have no vertices").c_str());
  fields.require(!shape.vertices.empty() || !traits.has_vertices,
                 ("a " + kind + " must have vertices").c_str());
  fields.require(shape.triangles.empty() || traits.has_triangles,
                 ("a " + kind + " must have no triangles").c_str());
  fields.require(!shape.triangles.empty() || !traits.has_triangles,
                 ("a " + kind + " must have triangles").c_str());
  return shape;
}

SceneRecord read_placement(RecordFields& fields) {
  ScenePlacement placement;
  fields.name("placement");
  placement.id = fields.number<std::uint32_t>();
  fields.name("placement " + std::to_string(placement.id), placement.id);
  placement.shape = fields.number<std::uint64_t>();
  placement.side.kind = fields.enumeration<SideKind>("side_kind");
  placement.side.index = fields.number<std::uint32_t>();
  placement.X_BS = fields.pose("X_BS");
  placement.friction.coefficient = fields.f32("friction", kFrictionRange);
  placement.group = fields.number<std::uint32_t>();
  placement.mask = fields.number<std::uint32_t>();
  placement.friction.rule = fields.enumeration<FrictionRule>("friction_rule");
  placement.friction.priority = fields.number<std::uint8_t>();
  return placement;
}

SceneRecord read_removal(RecordFields& fields) {
  fields.name("removal");
  return SceneRemoval{fields.number<std::uint32_t>()};
}

SceneRecord read_apart(RecordFields& fields) {
  SceneApart apart;
  fields.name("apart");
  apart.a = fields.number<std::uint32_t>();
  apart.b = fields.number<std::uint32_t>();
  return apart;
}

SceneRecord read_commit(RecordFields& fields) {
  fields.name("commit");
  const SceneCommit commit{fields.number<std::uint32_t>()};
  fields.require(commit.scene > 0, "scene 0 must be at least 1");
  return commit;
}

SceneRecord read_record(SceneRecordKind kind, RecordFields& fields, const SceneLimits& limits) {
  switch (kind) {
    case SceneRecordKind::kShape:
      return read_shape(fields, limits);
    case SceneRecordKind::kPlacement:
      return read_placement(fields);
    case SceneRecordKind::kRemoval:
      return read_removal(fields);
    case SceneRecordKind::kApart:
      return read_apart(fields);
    case SceneRecordKind::kCommit:
      return read_commit(fields);
  }
  fields.name("record");
  fields.refuse(SceneError::kMalformed,
                "kind " + std::to_string(static_cast<int>(kind)) + " must be 1 to 5");
  return SceneCommit{};
}

}  // namespace

std::uint64_t fnv1a(std::span<const std::byte> bytes) noexcept {
  std::uint64_t hash = 0xCBF29CE484222325;
  for (const std::byte byte : bytes) {
    hash ^= std::to_integer<std::uint64_t>(byte);
    hash *= 0x100000001B3;
  }
  return hash;
}

std::uint64_t hash_of(const SceneShape& shape) {
  std::vector<std::uint8_t> bytes;
  RecordWriter writer(bytes);
  write_shape(writer, shape);
  return fnv1a(std::as_bytes(std::span(bytes)));
}

void append(const SceneRecord& record, std::vector<std::uint8_t>& to) {
  const std::size_t begin = to.size();
  to.resize(begin + kRecordHeader);
  RecordWriter writer(to);
  const auto kind = std::visit([&](const auto& one) { return write(writer, one); }, record);
  writer.finish(kind, begin);
}

void SceneRecordReader::feed(std::span<const std::byte> bytes) {
  if (fault_) return;
  if (begin_ == bytes_.size() || begin_ >= kReadPiece) {
    bytes_.erase(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(begin_));
    begin_ = 0;
  }
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
}

std::optional<SceneRecord> SceneRecordReader::next() {
  const std::span<const std::byte> rest = std::span(bytes_).subspan(begin_);
  if (fault_ || rest.size() < kRecordHeader) return std::nullopt;
  RecordFields header(rest);
  header.name("record");
  const auto kind = static_cast<SceneRecordKind>(header.number<std::uint8_t>());
  const std::size_t length = header.number<std::uint32_t>();
  if (!is_known(kind)) {
    static_cast<void>(read_record(kind, header, limits_));
  } else if (length > limits_.record_bytes) {
    header.refuse(SceneError::kLimit, "length " + std::to_string(length) + " must be at most " +
                                          std::to_string(limits_.record_bytes) + " bytes");
  }
  if ((fault_ = header.fault())) return std::nullopt;
  if (rest.size() - kRecordHeader < length) return std::nullopt;
  RecordFields fields(rest.subspan(kRecordHeader, length));
  SceneRecord record = read_record(kind, fields, limits_);
  begin_ += kRecordHeader + length;
  if ((fault_ = fields.fault())) return std::nullopt;
  return record;
}

}  // namespace hlm::protocol
