// Records of the scene stream for tests: small ones and random ones.
#pragma once

#include <cstdint>
#include <cstdio>
#include <string>

#include "hlm/protocol/scene_records.h"
#include "tests/support/random.h"

namespace hlm::test {

/// As texts for a person have a hash.
inline std::string hexadecimal(std::uint64_t hash) {
  char digits[17];
  std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(hash));
  return digits;
}

inline protocol::SceneShape tetrahedron(double size = 0.5) {
  protocol::SceneShape shape{.kind = protocol::SceneShapeKind::kMesh};
  shape.vertices = {{0, 0, 0}, {size, 0, 0}, {0, size, 0}, {0, 0, size}};
  shape.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  shape.hash = hash_of(shape);
  return shape;
}

inline protocol::SceneShape random_shape(Random& random) {
  using protocol::SceneShapeKind;
  protocol::SceneShape shape;
  shape.kind = static_cast<SceneShapeKind>(random.integer(0, 7));
  const int code = static_cast<int>(shape.kind);
  constexpr int kSizes[] = {1, 2, 2, 3, 3, 0, 0, 0};
  for (int i = 0; i < kSizes[code]; ++i) shape.size[i] = random.uniform(0.001, 1);
  const bool is_mesh = shape.kind == SceneShapeKind::kMesh;
  if (!is_mesh && shape.kind != SceneShapeKind::kHull) {
    shape.hash = hash_of(shape);
    return shape;
  }
  const int vertices = random.integer(1, 100);
  for (int i = 0; i < vertices; ++i) shape.vertices.push_back(random.vector(1));
  const int triangles = is_mesh ? random.integer(1, 200) : 0;
  for (int i = 0; i < triangles; ++i) {
    auto& triangle = shape.triangles.emplace_back();
    for (auto& corner : triangle) {
      corner = static_cast<std::uint32_t>(random.integer(0, vertices - 1));
    }
  }
  shape.hash = hash_of(shape);
  return shape;
}

inline protocol::ScenePlacement random_placement(Random& random, std::uint32_t id,
                                                 std::uint64_t shape) {
  protocol::ScenePlacement placement;
  placement.id = id;
  placement.shape = shape;
  placement.side = {static_cast<SideKind>(random.integer(0, 2)),
                    static_cast<std::uint32_t>(random.integer(0, 5))};
  placement.X_BS = random.pose(1);
  placement.friction.coefficient = static_cast<float>(random.uniform(-1, 1));
  placement.friction.rule = static_cast<FrictionRule>(random.integer(0, 3));
  placement.friction.priority = static_cast<std::uint8_t>(random.integer(0, 255));
  placement.group = static_cast<std::uint32_t>(random.integer(0, 1 << 30));
  placement.mask = static_cast<std::uint32_t>(random.integer(0, 1 << 30));
  return placement;
}

inline BodyInertia random_inertia(Random& random, std::uint32_t body) {
  const Matrix3 R = random.pose(1).R.toRotationMatrix();
  const Vector3 parts = Vector3::Constant(1.5) + random.vector(1);  // Of each axis, kg·m².
  const Vector3 moments(parts[1] + parts[2], parts[0] + parts[2], parts[0] + parts[1]);
  const Matrix3 I = R * moments.asDiagonal() * R.transpose();
  return {.body = body,
          .mass = random.uniform(0.01, 10),
          .p_BCom = random.vector(0.1),
          .I_BCom = (I + I.transpose()) / 2,
          .gravity_W = random.vector(10),
          .damping = random.uniform(0, 1),
          .angular_damping = random.uniform(0, 1)};
}

inline BodyJoint random_joint(Random& random, std::uint32_t body) {
  const double lower = random.uniform(-3, 3);
  return {.body = body,
          .parent = random.integer(0, 1) == 0 ? kNoBody : body + 1,
          .type = random.integer(0, 1) == 0 ? JointType::kRevolute : JointType::kPrismatic,
          .X_PJ = random.pose(1),
          .X_BJ = random.pose(1),
          .axis = random.direction(),
          .lower = lower,
          .upper = lower + random.uniform(0, 3),
          .stiffness = random.uniform(0, 100),
          .reference = random.uniform(-3, 3),
          .damping = random.uniform(0, 10),
          .friction = random.uniform(0, 10),
          .armature = random.uniform(0, 1)};
}

inline protocol::SceneRecord random_record(Random& random) {
  const auto number = [&] { return static_cast<std::uint32_t>(random.integer(1, 1 << 30)); };
  switch (random.integer(1, 7)) {
    case 1:
      return random_shape(random);
    case 2:
      return random_placement(random, number(), random.engine()());
    case 3:
      return protocol::SceneRemoval{number()};
    case 4: {
      const std::uint32_t a = number();
      return protocol::SceneApart{a, number()};
    }
    case 5:
      return random_inertia(random, number());
    case 6:
      return random_joint(random, number());
    default:
      return protocol::SceneCommit{number()};
  }
}

}  // namespace hlm::test
