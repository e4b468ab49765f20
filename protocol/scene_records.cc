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

#include <Eigen/Eigenvalues>
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
constexpr Range kMassRange{1e-6, 1e6, "kg"};
constexpr Range kMomentRange{1e-15, 1e9, "kg m^2"};
constexpr Range kProductRange{-1e9, 1e9, "kg m^2"};
constexpr Range kGravityRange{-1e3, 1e3, "m/s^2"};
constexpr Range kDampingRange{0, 1e6, "1/s"};
constexpr Range kCoordinateRange{-kNoLimit, kNoLimit};
constexpr Range kJointNumberRange{0, 1e9};
/// Smallest principal moment, of the largest, and how far rounding may break the triangle's rule.
constexpr double kRounding = 1e-9;
constexpr double kTriangleRounding = 1e-6;
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

SceneRecordKind write(RecordWriter& writer, const BodyInertia& inertia) {
  writer.number(inertia.body);
  writer.f64(inertia.mass);
  writer.vector(inertia.p_BCom);
  const Matrix3& I = inertia.I_BCom;
  for (int i = 0; i < 3; ++i) writer.f64(I(i, i));
  for (const auto& [row, column] : {std::pair{0, 1}, std::pair{0, 2}, std::pair{1, 2}}) {
    writer.f64(I(row, column));
  }
  writer.vector(inertia.gravity_W);
  writer.f64(inertia.damping);
  writer.f64(inertia.angular_damping);
  return SceneRecordKind::kInertia;
}

SceneRecordKind write(RecordWriter& writer, const BodyJoint& joint) {
  writer.number(joint.body);
  writer.number(joint.parent);
  writer.number(static_cast<std::uint8_t>(joint.type));
  writer.pose(joint.X_PJ);
  writer.pose(joint.X_BJ);
  writer.vector(joint.axis);
  for (const double number : {joint.lower, joint.upper, joint.stiffness, joint.reference,
                              joint.damping, joint.friction, joint.armature}) {
    writer.f64(number);
  }
  return SceneRecordKind::kJoint;
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

/// Principal moments must be of a body: positive, and none larger than the other two together.
bool is_inertia(const Matrix3& I) {
  const Vector3 moments = Eigen::SelfAdjointEigenSolver<Matrix3>(I).eigenvalues();
  return moments[0] > kRounding * moments[2] &&
         moments[2] <= (moments[0] + moments[1]) * (1 + kTriangleRounding);
}

SceneRecord read_inertia(RecordFields& fields) {
  BodyInertia inertia;
  fields.name("inertia");
  inertia.body = fields.number<std::uint32_t>();
  fields.name("inertia of body " + std::to_string(inertia.body), inertia.body);
  inertia.mass = fields.f64("mass", kMassRange);
  inertia.p_BCom = fields.vector("centre", kLengthRange);
  Matrix3& I = inertia.I_BCom;
  for (int i = 0; i < 3; ++i) I(i, i) = fields.f64("moment", kMomentRange);
  for (const auto& [row, column] : {std::pair{0, 1}, std::pair{0, 2}, std::pair{1, 2}}) {
    I(row, column) = I(column, row) = fields.f64("product", kProductRange);
  }
  inertia.gravity_W = fields.vector("gravity", kGravityRange);
  inertia.damping = fields.f64("damping", kDampingRange);
  inertia.angular_damping = fields.f64("angular damping", kDampingRange);
  if (!fields.fault()) {
    fields.require(is_inertia(I),
                   "its principal moments must be > 0, none more than the others' sum");
  }
  return inertia;
}

SceneRecord read_joint(RecordFields& fields) {
  BodyJoint joint;
  fields.name("joint");
  joint.body = fields.number<std::uint32_t>();
  fields.name("joint of body " + std::to_string(joint.body), joint.body);
  joint.parent = fields.number<std::uint32_t>();
  joint.type = static_cast<JointType>(fields.number<std::uint8_t>());
  joint.X_PJ = fields.pose("frame in the parent");
  joint.X_BJ = fields.pose("frame in the body");
  joint.axis = fields.vector("axis", {-2, 2, ""});
  joint.lower = fields.f64("lower limit", kCoordinateRange);
  joint.upper = fields.f64("upper limit", kCoordinateRange);
  joint.stiffness = fields.f64("stiffness", kJointNumberRange);
  joint.reference = fields.f64("reference", kCoordinateRange);
  joint.damping = fields.f64("damping", kJointNumberRange);
  joint.friction = fields.f64("friction", kJointNumberRange);
  joint.armature = fields.f64("armature", kJointNumberRange);
  if (fields.fault()) return joint;
  fields.require(has_axis(joint.type), "type must be 1 (revolute) or 2 (prismatic)");
  fields.require(joint.parent != joint.body, "its parent must be another body");
  fields.require(normalize_if_near(joint.axis), "axis must be of length 1 within 0.001");
  fields.require(joint.lower <= joint.upper, "upper limit must be at least the lower one");
  return joint;
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
    case SceneRecordKind::kInertia:
      return read_inertia(fields);
    case SceneRecordKind::kJoint:
      return read_joint(fields);
  }
  fields.name("record");
  fields.refuse(SceneError::kMalformed,
                "kind " + std::to_string(static_cast<int>(kind)) + " must be 1 to 7");
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
