#include "hlm/scene/sdf_joints.h"

#include <numbers>
#include <stdexcept>

#include <sdf/JointAxis.hh>

#include "hlm/common/range.h"
#include "hlm/scene/sdf_geometry.h"
#include "hlm/scene/sdf_messages.h"
#include "hlm/scene/sdf_places.h"

namespace hlm::ve {
namespace {

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
  AxisReader(const sdf::JointAxis& axis, Diagnostics& diagnostics, JointDescription& joint)
      : axis_(axis), place_(place_of(axis.Element())), diagnostics_(diagnostics), joint_(joint) {}

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
    if (!(lower <= 0 && upper >= 0)) {
      diagnostics_.refuse(place_, "limits " + shortest_text(lower) + " to " + shortest_text(upper) +
                                      " must include 0, the initial position; place the child "
                                      "within them and count from there");
      return;
    }
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
  JointDescription& joint_;
};

}  // namespace

JointDescription to_joint(const sdf::Joint& joint, Diagnostics& diagnostics) {
  JointDescription result;
  result.type = type_of(joint, diagnostics);
  if (result.type == BodyJoint::kFixed) return result;
  const sdf::JointAxis* axis = joint.Axis(0);
  if (result.type == BodyJoint::kBall) {
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

}  // namespace hlm::ve
