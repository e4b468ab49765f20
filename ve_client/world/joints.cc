#include "hlm/ve_client/world/joints.h"

#include <cmath>

namespace hlm::ve {
namespace {

dJointID create_hinge(dWorldID world, const JointDescription& joint, dBodyID child,
                      dBodyID parent) {
  const Vector3 axis = joint.X_WJ.R * joint.axis_J;
  const Vector3& p = joint.X_WJ.p;
  const dJointID hinge = dJointCreateHinge(world, nullptr);
  dJointAttach(hinge, child, parent);
  dJointSetHingeAnchor(hinge, p.x(), p.y(), p.z());
  dJointSetHingeAxis(hinge, axis.x(), axis.y(), axis.z());
  dJointSetHingeParam(hinge, dParamLoStop, joint.lower);
  dJointSetHingeParam(hinge, dParamHiStop, joint.upper);
  return hinge;
}

dJointID create_slider(dWorldID world, const JointDescription& joint, dBodyID child,
                       dBodyID parent) {
  const Vector3 axis = joint.X_WJ.R * joint.axis_J;
  const dJointID slider = dJointCreateSlider(world, nullptr);
  dJointAttach(slider, child, parent);
  dJointSetSliderAxis(slider, axis.x(), axis.y(), axis.z());
  dJointSetSliderParam(slider, dParamLoStop, joint.lower);
  dJointSetSliderParam(slider, dParamHiStop, joint.upper);
  return slider;
}

dJointID create_ball(dWorldID world, const JointDescription& joint, dBodyID child, dBodyID parent) {
  const Vector3& p = joint.X_WJ.p;
  const dJointID ball = dJointCreateBall(world, nullptr);
  dJointAttach(ball, child, parent);
  dJointSetBallAnchor(ball, p.x(), p.y(), p.z());
  return ball;
}

dJointID create(dWorldID world, const JointDescription& joint, dBodyID child, dBodyID parent) {
  switch (joint.type) {
    case BodyJoint::kRevolute:
      return create_hinge(world, joint, child, parent);
    case BodyJoint::kPrismatic:
      return create_slider(world, joint, child, parent);
    case BodyJoint::kBall:
      return create_ball(world, joint, child, parent);
    case BodyJoint::kFixed:
      break;
  }
  const dJointID fixed = dJointCreateFixed(world, nullptr);
  dJointAttach(fixed, child, parent);
  dJointSetFixed(fixed);
  return fixed;
}

/// Damping as the solver takes it implicitly, stable in steps of any length: a motor that stands
/// still and yields by 1/c for each unit of force.
void add_damper(dWorldID world, const JointDescription& joint, dBodyID child, dBodyID parent) {
  constexpr int kFirstBody = 1;
  const Vector3 axis = joint.X_WJ.R * joint.axis_J;
  const auto add = [&](auto create, auto set_axes, auto set_axis, auto set) {
    const dJointID motor = create(world, nullptr);
    dJointAttach(motor, child, parent);
    set_axes(motor, 1);
    set_axis(motor, 0, kFirstBody, axis.x(), axis.y(), axis.z());
    set(motor, dParamFMax, dInfinity);
    set(motor, dParamCFM, 1 / joint.damping);
  };
  if (joint.type == BodyJoint::kRevolute) {
    add(dJointCreateAMotor, dJointSetAMotorNumAxes, dJointSetAMotorAxis, dJointSetAMotorParam);
  } else {
    add(dJointCreateLMotor, dJointSetLMotorNumAxes, dJointSetLMotorAxis, dJointSetLMotorParam);
  }
}

}  // namespace

Joints::Joints(dWorldID world, const WorldDescription& description,
               std::span<const dBodyID> bodies) {
  const auto body = [&](int index) {
    return index < 0 ? nullptr : bodies[static_cast<std::size_t>(index)];
  };
  joints_.reserve(description.joints.size());  // The engine keeps pointers to their feedback.
  for (const JointDescription& joint : description.joints) {
    const dBodyID child = body(joint.child);
    const dBodyID parent = body(joint.parent);
    const bool moves = child != nullptr || parent != nullptr;
    joints_.push_back({joint, moves ? create(world, joint, child, parent) : nullptr});
    if (moves && joint.limited()) {
      dJointSetFeedback(joints_.back().handle, &joints_.back().feedback);
    }
    if (moves && joint.damping > 0) add_damper(world, joint, child, parent);
  }
}

double Joints::position(int joint) const {
  const JointDescription& description = at(joint).description;
  const dJointID handle = at(joint).handle;
  if (handle == nullptr) return 0;
  if (description.type == BodyJoint::kRevolute) return dJointGetHingeAngle(handle);
  if (description.type == BodyJoint::kPrismatic) return dJointGetSliderPosition(handle);
  return 0;
}

double Joints::velocity(int joint) const {
  const JointDescription& description = at(joint).description;
  const dJointID handle = at(joint).handle;
  if (handle == nullptr) return 0;
  if (description.type == BodyJoint::kRevolute) return dJointGetHingeAngleRate(handle);
  if (description.type == BodyJoint::kPrismatic) return dJointGetSliderPositionRate(handle);
  return 0;
}

double Joints::spring_force(int joint) const {
  const JointDescription& description = at(joint).description;
  const dJointID handle = at(joint).handle;
  if (handle == nullptr || description.stiffness == 0) return 0;
  return -description.stiffness * (position(joint) - description.rest);
}

double Joints::limit_force(int joint) const {
  const dJointID handle = at(joint).handle;
  if (handle == nullptr || !at(joint).description.limited()) return 0;
  const auto vector = [](const dReal* v) { return Vector3(v[0], v[1], v[2]); };
  const Vector3 force = vector(at(joint).feedback.f1);
  dVector3 axis;
  if (at(joint).description.type == BodyJoint::kPrismatic) {
    dJointGetSliderAxis(handle, axis);
    return std::abs(force.dot(vector(axis)));
  }
  // Forces of the hinge pass through the anchor.
  dVector3 anchor;
  dJointGetHingeAnchor(handle, anchor);
  dJointGetHingeAxis(handle, axis);
  const Vector3 arm = vector(dBodyGetPosition(dJointGetBody(handle, 0))) - vector(anchor);
  const Vector3 torque = vector(at(joint).feedback.t1) + arm.cross(force);
  return std::abs(torque.dot(vector(axis)));
}

void Joints::push_springs() {
  for (int i = 0; i < static_cast<int>(joints_.size()); ++i) {
    const double force = spring_force(i);
    if (force == 0) continue;
    if (at(i).description.type == BodyJoint::kRevolute) {
      dJointAddHingeTorque(at(i).handle, force);
    } else {
      dJointAddSliderForce(at(i).handle, force);
    }
  }
}

void Joints::remove_from(dBodyID body) {
  while (dBodyGetNumJoints(body) > 0) {
    const dJointID handle = dBodyGetJoint(body, 0);
    for (Joint& joint : joints_) {
      if (joint.handle == handle) joint.handle = nullptr;
    }
    dJointDestroy(handle);
  }
}

}  // namespace hlm::ve
