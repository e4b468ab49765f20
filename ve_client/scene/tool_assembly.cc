#include "hlm/ve_client/scene/tool_assembly.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "hlm/geometry/convex.h"

namespace hlm::ve {
namespace {

constexpr int kWorld = -1;

[[noreturn]] void fail(const ModelDescription& model, const std::string& why) {
  throw std::runtime_error("tool '" + model.name + "': " + why);
}

/// Makes the links of one tool, parents first.
class Assembler {
 public:
  Assembler(const WorldDescription& world, const ModelDescription& model)
      : world_(world), model_(model) {}

  ToolAssembly assemble() {
    if (model_.fixed) fail(model_, "a static model cannot be a tool");
    if (model_.body_count > static_cast<int>(kMaxLinks)) {
      fail(model_, std::to_string(model_.body_count) + " links; at most " +
                       std::to_string(kMaxLinks) + " are allowed");
    }
    add_root();
    for (std::size_t parent = 0; parent < tool_.bodies.size(); ++parent) {
      add_children(static_cast<int>(parent));
    }
    if (static_cast<int>(tool_.bodies.size()) != model_.body_count) {
      fail(model_, "its joints must join all links to one tree");
    }
    set_gravity();
    set_hand();
    if (model_.gripper) set_gripper(*model_.gripper);
    tool_.description.length = largest_extent();
    if (const auto error = find_error(tool_.description)) fail(model_, *error);
    return std::move(tool_);
  }

 private:
  const BodyDescription& body(int index) const {
    return world_.bodies[static_cast<std::size_t>(index)];
  }
  bool contains(int index) const {
    return index >= model_.first_body && index < model_.first_body + model_.body_count;
  }
  /// The joint that moves a link; null if there is none.
  const JointDescription* joint_to(int child) const {
    const JointDescription* found = nullptr;
    for (const JointDescription& joint : world_.joints) {
      if (joint.child != child) continue;
      if (found) fail(model_, "link '" + body(child).name + "' is the child of two joints");
      found = &joint;
    }
    return found;
  }

  void add_root() {
    int root = kWorld;
    for (int i = model_.first_body; i < model_.first_body + model_.body_count; ++i) {
      const JointDescription* joint = joint_to(i);
      if (joint != nullptr && joint->parent != kWorld) continue;
      if (root != kWorld) fail(model_, "its joints must join all links to one tree");
      root = i;
    }
    if (root == kWorld) fail(model_, "its joints form a loop");
    if (const JointDescription* joint = joint_to(root)) {
      if (model_.tool_joint) {
        fail(model_, "<haptic:tool_joint> is not allowed with a joint to the world");
      }
      add_jointed(*joint, kWorld);
    } else {
      add_mobile_root(root, model_.tool_joint.value_or(JointType::kFree));
    }
  }

  /// A root that moves freely in space or in the plane.
  void add_mobile_root(int root, JointType type) {
    const Pose& X_WB = body(root).X_WB;
    Link link;
    link.joint = type;
    Pose X_LB;
    if (type == JointType::kPlanar) {
      const Vector3 x_axis = X_WB.R * Vector3::UnitX();
      const double heading = std::atan2(x_axis.y(), x_axis.x());
      const Quaternion R_WL(Eigen::AngleAxisd(heading, Vector3::UnitZ()));
      link.X_PJ.p = {0, 0, X_WB.p.z()};
      X_LB.R = R_WL.conjugate() * X_WB.R;
      tool_.q = Vector3(X_WB.p.x(), X_WB.p.y(), heading);
      tool_.planar_normal_W = Vector3::UnitZ();
    } else {
      tool_.q.resize(7);
      tool_.q << X_WB.p, X_WB.R.w(), X_WB.R.vec();
    }
    add(link, root, X_LB);
  }

  void add_children(int parent) {
    for (const JointDescription& joint : world_.joints) {
      if (joint.parent == tool_.bodies[static_cast<std::size_t>(parent)]) {
        add_jointed(joint, parent);
      }
    }
  }

  JointType type_of(const JointDescription& joint) const {
    switch (joint.type) {
      case BodyJoint::kFixed:
        return JointType::kFixed;
      case BodyJoint::kRevolute:
        return JointType::kRevolute;
      case BodyJoint::kPrismatic:
        return JointType::kPrismatic;
      case BodyJoint::kBall:
        break;
    }
    fail(model_, "joint '" + joint.name +
                     "' is a ball joint; a tool's must be fixed, revolute, continuous or "
                     "prismatic: make it of three revolute ones, with small links between them");
  }

  void add_jointed(const JointDescription& joint, int parent) {
    if (!contains(joint.child)) fail(model_, "joint '" + joint.name + "' leaves the model");
    if (joint.sprung()) {
      fail(model_, "joint '" + joint.name + "' has a spring or damping; a tool's joints have none");
    }
    Link link;
    link.parent = parent;
    link.joint = type_of(joint);
    link.axis = joint.axis_J;
    link.lower = std::max(joint.lower, -kNoLimit);
    link.upper = std::min(joint.upper, kNoLimit);
    link.X_PJ = parent == kWorld ? joint.X_WJ : X_WL(parent).inverse() * joint.X_WJ;
    add(link, joint.child, joint.X_WJ.inverse() * body(joint.child).X_WB);
    const auto size = tool_.q.size();
    const int added = joint_configuration_size(link.joint);
    tool_.q.conservativeResize(size + added);
    tool_.q.tail(added).setZero();
  }

  void add(Link link, int index, const Pose& X_LB) {
    const Matrix3 R = X_LB.R.toRotationMatrix();
    link.mass = body(index).mass;
    link.p_LCom = X_LB.p;
    link.I_LCom = R * body(index).I_B * R.transpose();
    tool_.description.links.push_back(link);
    tool_.bodies.push_back(index);
    tool_.X_LB.push_back(X_LB);
  }

  /// Initial pose of a link.
  Pose X_WL(int link) const {
    const auto i = static_cast<std::size_t>(link);
    return body(tool_.bodies[i]).X_WB * tool_.X_LB[i].inverse();
  }

  void set_gravity() {
    const bool weightless = body(tool_.bodies.front()).weightless;
    for (const int index : tool_.bodies) {
      if (body(index).weightless != weightless) {
        fail(model_, "all links must have the same <gravity>, true or false");
      }
    }
    if (!weightless) tool_.description.gravity_W = world_.gravity_W;
  }

  void set_hand() {
    std::size_t held = 0;
    if (model_.hand_link) {
      const std::string name = model_.name + "::" + *model_.hand_link;
      while (held < tool_.bodies.size() && body(tool_.bodies[held]).name != name) ++held;
      if (held == tool_.bodies.size()) {
        fail(model_, "<haptic:hand> <link> '" + *model_.hand_link + "' is not a link of the model");
      }
    }
    const Pose X_BS{body(tool_.bodies[held]).p_BS, Quaternion::Identity()};
    const Pose X_BH = model_.hand_link ? X_BS * model_.X_SH : Pose{};
    tool_.description.hand_link = static_cast<int>(held);
    tool_.description.X_LH = tool_.X_LB[held] * X_BH;
  }

  void set_gripper(const GripperDescription& gripper) {
    for (const std::string& name : gripper.joints) {
      const auto joint =
          std::ranges::find(world_.joints, model_.name + "::" + name, &JointDescription::name);
      const auto link = joint == world_.joints.end()
                            ? tool_.bodies.end()
                            : std::ranges::find(tool_.bodies, joint->child);
      if (link == tool_.bodies.end() || tool_.drives.size() == tool_.drives.capacity()) {
        fail(model_, "<haptic:gripper> <joint> '" + name + "' must be a joint of the model");
      }
      tool_.drives.push_back({.link = static_cast<std::uint8_t>(link - tool_.bodies.begin()),
                              .follows_device = true,
                              .target = gripper.open,
                              .closed = gripper.closed,
                              .open = gripper.open,
                              .stiffness = gripper.stiffness,
                              .damping = gripper.damping,
                              .most = gripper.force});
    }
    if (const auto error = find_error(tool_.drives, tool_.description)) {
      fail(model_, "<haptic:gripper>: " + std::string(*error));
    }
  }

  /// Largest distance, m, of a corner of a collision's bounding box from the hand; without
  /// collisions the description's default.
  double largest_extent() const {
    const Vector3 p_WH = X_WL(tool_.description.hand_link) * tool_.description.X_LH.p;
    double extent = 0;
    for (const int index : tool_.bodies) {
      for (const CollisionDescription& collision : body(index).collisions) {
        const Eigen::AlignedBox3d box =
            Convex(collision.shape).bounds(body(index).X_WB * collision.X_BG);
        extent = std::max(extent, ((box.center() - p_WH).cwiseAbs() + box.sizes() / 2).norm());
      }
    }
    return extent > 0 ? extent : ToolDescription{}.length;
  }

  const WorldDescription& world_;
  const ModelDescription& model_;
  ToolAssembly tool_;
};

}  // namespace

ToolAssembly assemble_tool(const WorldDescription& world, const std::string& name) {
  return Assembler(world, find_model(world, name)).assemble();
}

}  // namespace hlm::ve
