#include "hlm/ve_client/scene/sdf_joints.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <stdexcept>
#include <vector>

#include <sdf/JointAxis.hh>

#include "hlm/common/range.h"
#include "hlm/ve_client/scene/sdf_geometry.h"
#include "hlm/ve_client/scene/sdf_messages.h"
#include "hlm/ve_client/scene/sdf_places.h"

namespace hlm::ve {
namespace {

/// Positions beyond this, m or rad, are mistakes.
constexpr double kFarthest = 1e6;

BodyJoint type_of(const sdf::Joint& joint, Diagnostics& diagnostics) {
  switch (joint.Type()) {
    case sdf::JointType::FIXED:
      return BodyJoint::kFixed;
    case sdf::JointType::REVOLUTE:
    case sdf::JointType::CONTINUOUS:
      return BodyJoint::kRevolute;
    case sdf::JointType::PRISMATIC:
      return BodyJoint::kPrismatic;
    case sdf::JointType::BALL:
      return BodyJoint::kBall;
    case sdf::JointType::INVALID:
      return BodyJoint::kFixed;  // The parser has said so.
    case sdf::JointType::UNIVERSAL:
    case sdf::JointType::REVOLUTE2:
    case sdf::JointType::SCREW:
    case sdf::JointType::GEARBOX:
      break;
  }
  diagnostics.refuse(
      place_of(joint.Element()),
      "type '" + joint.Element()->Get<std::string>("type") +
          "' must be fixed, revolute, continuous, prismatic or ball; make it of these, "
          "with small links between them");
  return BodyJoint::kFixed;
}

/// Reads the axis of one joint.
class AxisReader {
 public:
  AxisReader(const sdf::JointAxis& axis, Diagnostics& diagnostics, FileJoint& result)
      : axis_(axis),
        place_(place_of(axis.Element())),
        diagnostics_(diagnostics),
        result_(result),
        joint_(result.joint) {}

  void read(bool continuous) {
    read_direction();
    joint_.stiffness = at_least_zero(axis_.SpringStiffness(), "spring_stiffness");
    joint_.damping = at_least_zero(axis_.Damping(), "damping");
    joint_.rest = axis_.SpringReference();
    if (!continuous) read_limits();
  }

 private:
  void read_direction() {
    // libsdformat takes a direction of length 0 for one that is not given.
    if (axis_.Element()->Get<ignition::math::Vector3d>("xyz").Length() == 0) {
      return diagnostics_.refuse(place_, "<xyz> must not be 0 0 0");
    }
    try {
      ignition::math::Vector3d axis_J;
      require_none(axis_.ResolveXyz(axis_J));
      joint_.axis_J = to_vector(axis_J).normalized();
    } catch (const std::runtime_error& error) {
      diagnostics_.refuse(place_, error.what());
    }
  }

  double at_least_zero(double value, const char* what) {
    const auto error = find_error(what, value, from_zero(""));
    if (error) diagnostics_.refuse(place_, *error);
    return error ? 0 : value;
  }

  void read_limits() {
    const double lower = axis_.Lower();
    const double upper = axis_.Upper();
    const std::string text = "limits " + shortest_text(lower) + " to " + shortest_text(upper) + " ";
    const double start = lower > 0 ? lower : std::min(upper, 0.0);
    if (!(lower <= upper))
      return diagnostics_.refuse(place_, text + "must not be the wrong way round");
    if (!(std::abs(start) <= kFarthest)) {
      return diagnostics_.refuse(place_, text + "must include a position within ±1e6");
    }
    set_limits(lower - start, upper - start);
    result_.start = start;
    result_.limits = place_;
    joint_.rest -= start;
  }

  void set_limits(double lower, double upper) {
    // Files write "no limit" as a very large number. The engine knows angles up to half a turn.
    constexpr double kUnlimited = 1e15;
    const bool turns = joint_.type == BodyJoint::kRevolute;
    const double most = turns ? std::numbers::pi : kUnlimited;
    if (lower > -most) joint_.lower = lower;
    if (upper < most) joint_.upper = upper;
    const auto is_lost = [&](double limit) { return limit >= most && limit < kUnlimited; };
    if (turns && (is_lost(-lower) || is_lost(upper))) {
      diagnostics_.approximate(place_, "limits of half a turn and more are none");
    }
  }

  const sdf::JointAxis& axis_;
  Place place_;
  Diagnostics& diagnostics_;
  FileJoint& result_;
  JointDescription& joint_;
};

std::size_t at(int index) { return static_cast<std::size_t>(index); }

/// Bodies that are joined to `body` without that joint, itself too. Empty if there is a fixed one,
/// the world, or the joint's parent among them.
std::set<int> joined_beyond(const WorldDescription& world, std::size_t joint, int body) {
  std::set<int> found;
  std::vector<int> next{body};
  while (!next.empty()) {
    const int one = next.back();
    next.pop_back();
    const bool held = one == world.joints[joint].parent || one < 0 || world.bodies[at(one)].fixed;
    if (held) return {};
    if (!found.insert(one).second) continue;
    for (std::size_t i = 0; i < world.joints.size(); ++i) {
      const JointDescription& other = world.joints[i];
      if (i == joint) continue;
      if (other.child == one) next.push_back(other.parent);
      if (other.parent == one) next.push_back(other.child);
    }
  }
  return found;
}

}  // namespace

FileJoint to_joint(const sdf::Joint& joint, Diagnostics& diagnostics) {
  FileJoint result;
  result.joint.type = type_of(joint, diagnostics);
  if (result.joint.type == BodyJoint::kFixed) return result;
  const sdf::JointAxis* axis = joint.Axis(0);
  if (result.joint.type == BodyJoint::kBall) {
    if (axis == nullptr) return result;
    diagnostics.approximate(
        place_of(axis->Element()),
        "<axis> is not read: a ball joint turns any way, without limits or springs");
  } else if (axis == nullptr) {
    diagnostics.refuse(place_of(joint.Element()), "has no <axis>");
  } else {
    AxisReader(*axis, diagnostics, result).read(joint.Type() == sdf::JointType::CONTINUOUS);
  }
  return result;
}

bool move_child(WorldDescription& world, std::size_t joint, double position) {
  const JointDescription& moved = world.joints[joint];
  const std::set<int> bodies = joined_beyond(world, joint, moved.child);
  const Vector3 axis_W = moved.X_WJ.R * moved.axis_J;
  Pose X;
  if (moved.type == BodyJoint::kRevolute) {
    X.R = Quaternion(Eigen::AngleAxisd(position, axis_W));
    X.p = moved.X_WJ.p - X.R * moved.X_WJ.p;
  } else {
    X.p = position * axis_W;
  }
  for (const int body : bodies) world.bodies[at(body)].X_WB = X * world.bodies[at(body)].X_WB;
  for (JointDescription& other : world.joints) {
    if (bodies.contains(other.child)) other.X_WJ = X * other.X_WJ;
  }
  return !bodies.empty();
}

}  // namespace hlm::ve
