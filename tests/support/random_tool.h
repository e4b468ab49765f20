// Random virtual tools and configurations.
#pragma once

#include "hlm/common/tool_model.h"
#include "tests/support/random.h"

namespace hlm::test {

/// Inertia of a random cloud of four point masses: symmetric, positive, physically possible.
inline Matrix3 random_inertia(Random& random, double size) {
  Matrix3 inertia = Matrix3::Zero();
  for (int i = 0; i < 4; ++i) {
    const Vector3 r = random.vector(size);
    inertia += random.uniform(0.1, 1) *
               (r.squaredNorm() * Matrix3::Identity() - Matrix3(r * r.transpose()));
  }
  return inertia;
}

/// Inertia of a uniform box about its centre. half_size: m.
inline Matrix3 box_inertia(double mass, const Vector3& half_size) {
  const Vector3 squares = half_size.cwiseAbs2();
  return mass / 3 * (squares.sum() * Vector3::Ones() - squares).asDiagonal().toDenseMatrix();
}

/// A tree of `count` links (about 0.1 m, 1 kg) on a root with the given joint.
inline ToolDescription random_tool(Random& random, int count, JointType root) {
  ToolDescription tool;
  tool.gravity_W = {0.3, -0.5, -9.81};
  for (int i = 0; i < count; ++i) {
    Link link;
    link.parent = i == 0 ? -1 : random.integer(0, i - 1);
    link.joint = i == 0 ? root : static_cast<JointType>(random.integer(1, 2));
    link.X_PJ = random.pose(0.2);
    link.axis = random.direction();
    link.mass = random.uniform(0.2, 2);
    link.p_LCom = random.vector(0.05);
    link.I_LCom = random_inertia(random, 0.05);
    tool.links.push_back(link);
  }
  tool.hand_link = random.integer(0, count - 1);
  tool.X_LH = random.pose(0.1);
  return tool;
}

/// Some of its links go over to curves: the first one that moves on the root leads the others, on
/// the root and on each other. Limits ±0.5.
inline ToolDescription guided(Random& random, ToolDescription tool, std::uint8_t leader = 1) {
  for (std::uint8_t i = leader; i < tool.links.size(); ++i) {
    if (i != leader && random.integer(0, 2) == 0) continue;
    Link& link = tool.links[i];
    link.joint = i == leader ? JointType::kGuided : JointType::kFollowing;
    link.lower = -0.5;
    link.upper = 0.5;
    JointCurve& curve = tool.curves.emplace_back();
    curve.link = i;
    curve.leader = leader;
    curve.armature = random.uniform(0, 0.01);
    for (int k = 0; k < kCurveTerms; ++k) {
      for (int row = 0; row < 7; ++row)
        curve.terms(row, k) = static_cast<float>(random.uniform(-0.1, 0.1) / (1 + k * k));
    }
    curve.terms(3, 0) = 1;
  }
  return tool;
}

/// A rigid tool in space, its frame at its centre of mass.
inline ToolDescription rigid_tool(double mass, const Matrix3& inertia,
                                  JointType joint = JointType::kFree) {
  ToolDescription tool;
  Link link;
  link.joint = joint;
  link.mass = mass;
  link.I_LCom = inertia;
  tool.links.push_back(link);
  return tool;
}

inline Velocity random_velocity(Random& random, int dof, double size) {
  Velocity v(dof);
  for (int i = 0; i < dof; ++i) v[i] = random.uniform(-size, size);
  return v;
}

inline Configuration random_configuration(Random& random, const ToolModel& model) {
  return model.integrate(model.neutral(), random_velocity(random, model.dof(), 1.0), 1.0);
}

}  // namespace hlm::test
