// The records of the scene stream (PROTOCOL.md, section "Scenes"): shapes, where they are placed,
// and when they make a scene. To bytes and back; what holds them is in scene_store.h.
//
// For a thread beside the loop: all of this allocates, within SceneLimits.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "hlm/common/body_joint.h"
#include "hlm/common/contact.h"
#include "hlm/common/spatial.h"
#include "hlm/protocol/messages.h"

namespace hlm::protocol {

enum class SceneRecordKind : std::uint8_t {
  kShape = 1,
  kPlacement = 2,
  kRemoval = 3,
  kApart = 4,
  kCommit = 5,
  kInertia = 6,
  kJoint = 7,
};

/// As enum haptic_shape_kind. Each shape is centred in its own frame.
enum class SceneShapeKind : std::uint8_t {
  kSphere = 0,
  kCapsule = 1,
  kCylinder = 2,
  kBox = 3,
  kEllipsoid = 4,
  kHull = 5,
  kHalfSpace = 6,
  kMesh = 7,
};

/// A shape, which its hash names.
struct SceneShape {
  std::uint64_t hash = 0;  ///< Of its bytes: hash_of().
  SceneShapeKind kind = SceneShapeKind::kSphere;
  /// m, as the kind says: radius; radius and length along z (of a capsule that of its cylindrical
  /// part); edges; semi-axes. What a kind does not use is 0.
  Vector3 size = Vector3::Zero();
  std::vector<Vector3> vertices{};  ///< Of a hull or mesh, m.
  /// Of a mesh: three vertices each, counter-clockwise seen from outside.
  std::vector<std::array<std::uint32_t, 3>> triangles{};

  bool operator==(const SceneShape&) const = default;
};

/// A piece of the world, of the tool or of a body: a shape at a place.
struct ScenePlacement {
  std::uint32_t id = 0;     ///< The client's number for it.
  std::uint64_t shape = 0;  ///< Hash of the shape.
  ContactSide side{};       ///< Whose it is.
  Pose X_BS{};              ///< The shape's frame in that of the link or body, or in the world.
  Friction friction = {};   ///< Negative: the server's own. Single precision.
  std::uint32_t group = 1;  ///< Two may touch if a bit of one's group is in the other's mask.
  std::uint32_t mask = ~0u;

  bool operator==(const ScenePlacement&) const = default;
};

/// The placement goes, with what was said of its pairs.
struct SceneRemoval {
  std::uint32_t id = 0;

  bool operator==(const SceneRemoval&) const = default;
};

/// Two placements never touch.
struct SceneApart {
  std::uint32_t a = 0;
  std::uint32_t b = 0;

  bool operator==(const SceneApart&) const = default;
};

/// All records so far make a scene.
struct SceneCommit {
  std::uint32_t scene = 0;  ///< Its number: above 0 and that of the commit before.

  bool operator==(const SceneCommit&) const = default;
};

/// A body's inertia, and its joint, replace what was said of them before.
using SceneRecord = std::variant<SceneShape, ScenePlacement, SceneRemoval, SceneApart, SceneCommit,
                                 BodyInertia, BodyJoint>;

/// What a server holds. Larger ones let a client fill its memory and take the loader's time.
struct SceneLimits {
  std::size_t record_bytes = std::size_t{16} << 20u;  ///< Of one record, bytes.
  std::size_t vertices = 50'000;                      ///< Of one shape; so are the triangles.
  std::size_t triangles = 50'000;
  std::size_t placements = 20'000;
  std::size_t shape_bytes = std::size_t{16} << 20u;  ///< Of all shapes, bytes.
  std::size_t apart = 100'000;                       ///< Pairs that never touch.
};

/// Why a record cannot be used.
struct SceneFault {
  SceneError error = SceneError::kNone;
  std::uint32_t item = 0;  ///< Id of the placement that it is about; otherwise 0.
  std::string text;        ///< What is wrong, its value, and what is allowed.
};

/// FNV-1a, 64 bits.
std::uint64_t fnv1a(std::span<const std::byte> bytes) noexcept;
/// The hash that names a shape: of the bytes that its record has behind the hash.
std::uint64_t hash_of(const SceneShape& shape);

/// Appends a record to the stream. Checks nothing; a shape's hash is computed, whatever it says.
void append(const SceneRecord& record, std::vector<std::uint8_t>& to);

/// Reads records from a stream that comes in pieces of any size. Checks all that a record says by
/// itself: lengths, kinds, finite numbers in their ranges, indices, the hash. Quaternions come out
/// of length 1. Holds no more than the record that is coming, and the piece that was fed last.
class SceneRecordReader {
 public:
  explicit SceneRecordReader(const SceneLimits& limits = {}) : limits_(limits) {}

  /// More of the stream; then next() is due until it gives none.
  void feed(std::span<const std::byte> bytes);
  /// The next record that is there as a whole; empty if there is none, or after a fault.
  std::optional<SceneRecord> next();
  /// Why the stream cannot be read any further; empty as long as it can.
  const std::optional<SceneFault>& fault() const noexcept { return fault_; }

 private:
  SceneLimits limits_;
  std::vector<std::byte> bytes_;
  std::size_t begin_ = 0;  ///< Of the next record.
  std::optional<SceneFault> fault_;
};

}  // namespace hlm::protocol

namespace hlm {

template <>
inline constexpr std::array<Word<protocol::SceneRecordKind>, 7> kWords<protocol::SceneRecordKind>{{
    {protocol::SceneRecordKind::kShape, "shape", "a shape, by its hash"},
    {protocol::SceneRecordKind::kPlacement, "placement", "a shape at a place"},
    {protocol::SceneRecordKind::kRemoval, "removal", "a placement goes"},
    {protocol::SceneRecordKind::kApart, "apart", "two placements never touch"},
    {protocol::SceneRecordKind::kCommit, "commit", "the records so far make a scene"},
    {protocol::SceneRecordKind::kInertia, "inertia", "mass and inertia of a body"},
    {protocol::SceneRecordKind::kJoint, "joint", "what a body hangs on"},
}};

template <>
inline constexpr std::array<Word<protocol::SceneShapeKind>, 8> kWords<protocol::SceneShapeKind>{{
    {protocol::SceneShapeKind::kSphere, "sphere", "radius"},
    {protocol::SceneShapeKind::kCapsule, "capsule",
     "along z: radius, length of the cylindrical part"},
    {protocol::SceneShapeKind::kCylinder, "cylinder", "along z: radius, length"},
    {protocol::SceneShapeKind::kBox, "box", "edge lengths"},
    {protocol::SceneShapeKind::kEllipsoid, "ellipsoid", "semi-axes"},
    {protocol::SceneShapeKind::kHull, "hull", "the convex hull of its vertices"},
    {protocol::SceneShapeKind::kHalfSpace, "half_space", "z <= 0, of the world only"},
    {protocol::SceneShapeKind::kMesh, "mesh", "triangles, counter-clockwise seen from outside"},
}};

}  // namespace hlm
