#include "hlm/ve_client/world/scene_dynamics.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
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

/// The movable bodies, by what joints connect.
class Groups {
 public:
  explicit Groups(const World& world) : world_(world) {
    const int count = static_cast<int>(world.description().bodies.size());
    for (int body = 0; body < count; ++body) group_of_.push_back(body);
    for (const JointDescription& joint : world.description().joints) {
      if (moves(joint.child) && moves(joint.parent)) join(joint.child, joint.parent);
    }
    for (int body = 0; body < count; ++body) {
      if (moves(body)) groups_[group_of_[at(body)]].bodies.push_back(body);
    }
    for (const JointDescription& joint : world.description().joints) {
      const int body = moves(joint.child) ? joint.child : joint.parent;
      if (moves(body)) groups_[group_of_[at(body)]].joints.push_back(&joint);
    }
  }

  /// Those that a server can move, with their joints.
  template <class Use>
  void for_each(Use use) const {
    for (const auto& [number, group] : groups_) {
      if (can_be_told(group)) use(group.bodies, group.joints);
    }
  }

 private:
  struct Group {
    std::vector<int> bodies;
    std::vector<const JointDescription*> joints;
  };

  bool moves(int body) const { return body >= 0 && world_.is_movable(body); }

  void join(int a, int b) {
    const int gone = group_of_[at(a)];
    std::ranges::replace(group_of_, gone, group_of_[at(b)]);
  }

  /// They are a tree that hangs on the world or on nothing: each body hangs on one joint at most,
  /// and joints between them are fewer than they.
  bool can_be_told(const Group& group) const {
    std::set<int> hanging;
    std::size_t between = 0;
    for (const JointDescription* joint : group.joints) {
      const bool of_tool = joint->parent >= 0 && world_.is_tool(joint->parent);
      if (!moves(joint->child) || of_tool || !type_of(joint->type)) return false;
      if (!hanging.insert(joint->child).second) return false;
      between += moves(joint->parent) ? 1 : 0;
    }
    const bool is_free = hanging.size() < group.bodies.size();
    return between < group.bodies.size() && group.bodies.size() <= kMaxMovedBodies &&
           hanging.size() + (is_free ? 6 : 0) <= std::size_t{kMaxDof};
  }

  const World& world_;
  std::vector<int> group_of_;  ///< By body.
  std::map<int, Group> groups_;
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
  Groups(world).for_each([&](const std::vector<int>& bodies, const auto& joints) {
    for (const int body : bodies) scene.inertias.push_back(inertia_of(world, body));
    for (const JointDescription* joint : joints) scene.joints.push_back(joint_of(world, *joint));
  });
}

}  // namespace hlm::ve
