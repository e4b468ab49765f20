#include "hlm/world/scene_dynamics.h"

#include <algorithm>
#include <map>
#include <optional>
#include <vector>

#include "hlm/common/body_joint.h"
#include "hlm/geometry/index.h"

namespace hlm::ve {
namespace {

std::optional<JointType> type_of(BodyJoint joint) {
  switch (joint) {
    case BodyJoint::kRevolute:
      return JointType::kRevolute;
    case BodyJoint::kPrismatic:
      return JointType::kPrismatic;
    case BodyJoint::kFixed:
    case BodyJoint::kBall:
      break;
  }
  return std::nullopt;
}

/// The movable bodies that joints connect, and the joints that they hang on.
class Trees {
 public:
  explicit Trees(const World& world) : world_(world) {
    for (const JointDescription& joint : world.description().joints) {
      if (moves(joint.child)) hangs_on_[joint.child].push_back(&joint);
    }
    for (int body = 0; body < static_cast<int>(world.description().bodies.size()); ++body) {
      if (moves(body)) trees_[root_of(body)].push_back(body);
    }
  }

  /// Those that a server can move.
  template <class Use>
  void for_each(Use use) const {
    for (const auto& [root, bodies] : trees_) {
      const std::size_t freedoms = bodies.size() + (joint_of(root) == nullptr ? 5 : 0);
      const bool fits = bodies.size() <= kMaxMovedBodies && freedoms <= std::size_t{kMaxDof};
      if (!fits || !std::ranges::all_of(bodies, [&](int body) { return can_be_told(body); })) {
        continue;
      }
      for (const int body : bodies) use(body, joint_of(body));
    }
  }

 private:
  bool moves(int body) const { return body >= 0 && world_.is_movable(body); }

  const JointDescription* joint_of(int body) const {
    const auto joint = hangs_on_.find(body);
    return joint == hangs_on_.end() ? nullptr : joint->second.front();
  }

  /// The body among those that joints connect that hangs on none of them, or is met again.
  int root_of(int body) const {
    std::size_t passed = 0;
    for (const JointDescription* joint = joint_of(body); joint != nullptr && moves(joint->parent);
         joint = joint_of(body)) {
      body = joint->parent;
      if (++passed > hangs_on_.size()) break;  // In a loop.
    }
    return body;
  }

  bool can_be_told(int body) const {
    const auto joints = hangs_on_.find(body);
    if (joints == hangs_on_.end()) return true;
    const JointDescription& joint = *joints->second.front();
    const bool of_tool = joint.parent >= 0 && world_.is_tool(joint.parent);
    return joints->second.size() == 1 && type_of(joint.type) && !of_tool;
  }

  const World& world_;
  std::map<int, std::vector<const JointDescription*>> hangs_on_;  ///< By child.
  std::map<int, std::vector<int>> trees_;                         ///< By root.
};

BodyInertia inertia_of(const World& world, int body) {
  const BodyDescription& description = world.description().bodies[at(body)];
  BodyInertia inertia;
  inertia.body = static_cast<std::uint32_t>(body);
  inertia.mass = description.mass;
  inertia.I_BCom = description.I_B;
  if (!description.weightless) inertia.gravity_W = world.description().gravity_W;
  return inertia;
}

hlm::BodyJoint joint_of(const World& world, const JointDescription& joint) {
  const auto X_WB = [&](int body) { return world.description().bodies[at(body)].X_WB; };
  const bool has_parent = joint.parent >= 0 && world.is_movable(joint.parent);
  hlm::BodyJoint told;
  told.body = static_cast<std::uint32_t>(joint.child);
  told.type = *type_of(joint.type);
  told.X_PJ = joint.X_WJ;
  if (has_parent) {
    told.parent = static_cast<std::uint32_t>(joint.parent);
    told.X_PJ = X_WB(joint.parent).inverse() * joint.X_WJ;
  }
  told.X_BJ = X_WB(joint.child).inverse() * joint.X_WJ;
  told.axis = joint.axis_J;
  told.lower = std::max(joint.lower, -kNoLimit);
  told.upper = std::min(joint.upper, kNoLimit);
  told.stiffness = joint.stiffness;
  told.reference = joint.rest;
  told.damping = joint.damping;
  return told;
}

}  // namespace

void add_dynamics(const World& world, protocol::SceneOffer& scene) {
  Trees(world).for_each([&](int body, const JointDescription* joint) {
    scene.inertias.push_back(inertia_of(world, body));
    if (joint != nullptr) scene.joints.push_back(joint_of(world, *joint));
  });
}

}  // namespace hlm::ve
