#include "hlm/ve_client/world/virtual_tool.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace hlm::ve {
namespace {

constexpr int kFreeQuaternion = 3;  ///< First coordinate of a free root's quaternion.

/// `angle` plus the whole turns that bring it nearest to `reference`, rad.
double unwrapped(double angle, double reference) {
  return reference + std::remainder(angle - reference, 2 * std::numbers::pi);
}

/// Angle of the turn about a unit axis that R makes, rad.
double turn_about(const Vector3& axis, const Quaternion& R) {
  return 2 * std::atan2(R.vec().dot(axis), R.w());
}

/// `v` shortened to `limit`.
Vector3 bounded(const Vector3& v, double limit) {
  const double length = v.norm();
  return length > limit ? Vector3(v * (limit / length)) : v;
}

}  // namespace

VirtualTool::VirtualTool(World& world, const ToolAssembly& assembly, const FollowOptions& options)
    : world_(world),
      assembly_(assembly),
      options_(options),
      model_(assembly.description),
      v_(Velocity::Zero(model_.dof())),
      target_(assembly.description),
      v_target_(v_),
      v_proxy_(v_) {
  model_.set_configuration(assembly.q);
  target_.set_configuration(assembly.q);
  for (const int body : assembly_.bodies) {
    if (options_.mode == FollowMode::kKinematic) {
      world_.make_kinematic(body);
    } else if (assembly_.planar_normal_W && body == assembly_.bodies.front()) {
      world_.keep_planar(body);
    }
  }
}

bool VirtualTool::can_follow(const Configuration& q, const Velocity& v) const noexcept {
  constexpr double kLargestCoordinate = 1e3;  // m or rad.
  constexpr double kLargestVelocity = 1e3;    // m/s or rad/s.
  if (q.size() != model_.configuration_size() || v.size() != model_.dof()) return false;
  if (assembly_.description.links[0].joint == JointType::kFree) {
    const double length = q.segment<4>(kFreeQuaternion).norm();
    if (!(std::abs(length - 1) <= kUnitTolerance)) return false;
  }
  return (q.array().abs() <= kLargestCoordinate).all() &&
         (v.array().abs() <= kLargestVelocity).all();
}

void VirtualTool::set_target(const Configuration& q, const Velocity& v) {
  Configuration unit = q;
  if (assembly_.description.links[0].joint == JointType::kFree) {
    unit.segment<4>(kFreeQuaternion).normalize();
  }
  target_.set_configuration(unit);
  v_target_ = v;
  v_proxy_ = v;
  target_speed_ = 0;
  for (int link = 0; link < target_.links(); ++link) {
    const Vector3 p_WB = (target_.X_WL(link) * assembly_.X_LB[at(link)]).p;
    target_speed_ = std::max(target_speed_, point_speed(target_.jacobian(link, p_WB) * v));
  }
}

double VirtualTool::point_speed(const Twist& V_WB) const noexcept {
  // No point of the tool is farther from a link's centre of mass than twice its length.
  return V_WB.head<3>().norm() + 2 * assembly_.description.length * V_WB.tail<3>().norm();
}

void VirtualTool::set_pace(double pace) {
  if (pace == pace_) return;
  v_ *= pace_ / pace;
  pace_ = pace;
  place(q());
}

void VirtualTool::carry() {
  pace_ = 1;
  v_ = v_proxy_;
  place(on_the_way(q(), 1));
  v_target_.setZero();
}

double VirtualTool::follow(double dt) {
  double reach = 0;
  for (int link = 0; link < target_.links(); ++link) {
    if (options_.mode == FollowMode::kKinematic) {
      const int body = assembly_.bodies[at(link)];
      const Twist V_WB = displacement(world_.X_WB(body), X_WB_target(link)) / dt;
      world_.set_velocity(body, V_WB);
      reach = std::max(reach, point_speed(V_WB) * dt);
    } else {
      reach = std::max(reach, free_travel(link, dt));
    }
  }
  return reach;
}

void VirtualTool::pull(double h) {
  if (options_.mode == FollowMode::kKinematic) return;
  for (int link = 0; link < target_.links(); ++link) {
    const int body = assembly_.bodies[at(link)];
    const Pose X_WB = world_.X_WB(body);
    const Vector6 a =
        acceleration(link, displacement(X_WB, X_WB_target(link)), world_.V_WB(body), h);
    Wrench F;
    F << world_.description().bodies[at(body)].mass * a.head<3>(), inertia(body) * a.tail<3>();
    world_.add_wrench(body, F);
  }
}

double VirtualTool::free_travel(int link, double dt) const {
  const int body = assembly_.bodies[at(link)];
  const int steps = world_.substeps(dt);
  const double h = dt / steps;
  Vector6 e = displacement(world_.X_WB(body), X_WB_target(link));
  Twist V_WB = world_.V_WB(body);
  double travel = 0;
  for (int i = 0; i < steps; ++i) {
    V_WB += h * acceleration(link, e, V_WB, h);
    e -= h * V_WB;
    travel += h * point_speed(V_WB);
  }
  return travel;
}

Vector6 VirtualTool::acceleration(int link, const Vector6& e, const Twist& V_WB, double h) const {
  const int index = assembly_.bodies[at(link)];
  const double mass = world_.description().bodies[at(index)].mass;
  const Twist V_WB_target = target_.jacobian(link, X_WB_target(link).p) * v_target_ / pace_;
  const double w = 2 * std::numbers::pi * options_.frequency / pace_;
  const double b = 2 * options_.damping_ratio * w;
  const Vector6 a =
      (w * w * (e - h * V_WB) + b * (V_WB_target - V_WB)) / (1 + b * h + w * w * h * h);

  const Matrix3 I_W = inertia(index);
  const double max_force = options_.max_force / (pace_ * pace_);
  const Vector3 force = bounded(mass * a.head<3>(), max_force);
  const Vector3 torque = bounded(I_W * a.tail<3>(), max_force * assembly_.description.length);
  return (Vector6() << force / mass, I_W.inverse() * torque).finished();
}

Matrix3 VirtualTool::inertia(int body) const {
  const Matrix3 R = world_.X_WB(body).R.toRotationMatrix();
  return R * world_.description().bodies[at(body)].I_B * R.transpose();
}

void VirtualTool::read_back() {
  Configuration q = model_.configuration();
  int coordinate = 0;
  int velocity = 0;
  for (int link = 0; link < model_.links(); ++link) {
    read_joint(link, coordinate, velocity, q);
    const JointType joint = assembly_.description.links[at(link)].joint;
    coordinate += joint_configuration_size(joint);
    velocity += joint_dof(joint);
  }
  place(q);
  v_target_.setZero();
}

void VirtualTool::place(const Configuration& q) {
  model_.set_configuration(q);
  for (int link = 0; link < model_.links(); ++link) {
    const Pose X_WB_link = X_WB(link);
    const Twist V_WB = model_.jacobian(link, X_WB_link.p) * v_;
    world_.set_pose(assembly_.bodies[at(link)], X_WB_link);
    world_.set_velocity(assembly_.bodies[at(link)], V_WB);
  }
}

double VirtualTool::lag() const {
  double lag = 0;
  for (int link = 0; link < model_.links(); ++link) {
    lag = std::max(lag, point_speed(displacement(X_WB(link), X_WB_target(link))));
  }
  return lag;
}

Configuration VirtualTool::on_the_way(const Configuration& q, double share) const {
  Configuration target = target_.configuration();
  int coordinate = 0;
  for (const Link& link : assembly_.description.links) {
    const int turn = coordinate + (link.joint == JointType::kPlanar ? 2 : 0);
    const bool turns = link.joint == JointType::kPlanar || link.joint == JointType::kRevolute;
    if (turns && link.upper - link.lower == 2 * kNoLimit) {
      target[turn] = unwrapped(target[turn], q[turn]);
    }
    coordinate += joint_configuration_size(link.joint);
  }
  const bool is_free = assembly_.description.links[0].joint == JointType::kFree;
  if (is_free && target.segment<4>(kFreeQuaternion).dot(q.segment<4>(kFreeQuaternion)) < 0) {
    target.segment<4>(kFreeQuaternion) *= -1;
  }
  Configuration between = q + share * (target - q);
  if (is_free) between.segment<4>(kFreeQuaternion).normalize();
  return between;
}

/// Reads the joint above a link from the poses and twists of the two bodies that it joins into q
/// (from `coordinate` on) and v_ (from `velocity` on).
void VirtualTool::read_joint(int link, int coordinate, int velocity, Configuration& q) {
  const Link& description = assembly_.description.links[at(link)];
  const auto X_WL = [&](int l) {
    return world_.X_WB(assembly_.bodies[at(l)]) * assembly_.X_LB[at(l)].inverse();
  };
  const bool rooted = description.parent < 0;
  const Pose X_WJ = (rooted ? Pose{} : X_WL(description.parent)) * description.X_PJ;
  const Pose X_WL_link = X_WL(link);
  const Pose X_JL = X_WJ.inverse() * X_WL_link;

  // Twist of the link at its origin against the parent's material there, axes of J.
  const auto V_at_L = [&](int l) {
    const int body = assembly_.bodies[at(l)];
    Twist V;
    V << world_.velocity_at(body, X_WL_link.p), world_.V_WB(body).tail<3>();
    return V;
  };
  const Twist V_W = rooted ? V_at_L(link) : Twist(V_at_L(link) - V_at_L(description.parent));
  const Vector3 v_J = X_WJ.R.conjugate() * V_W.head<3>();
  const Vector3 w_J = X_WJ.R.conjugate() * V_W.tail<3>();

  switch (description.joint) {
    case JointType::kFixed:
      return;
    case JointType::kRevolute:
      q[coordinate] = unwrapped(turn_about(description.axis, X_JL.R), q[coordinate]);
      v_[velocity] = description.axis.dot(w_J);
      return;
    case JointType::kPrismatic:
      q[coordinate] = description.axis.dot(X_JL.p);
      v_[velocity] = description.axis.dot(v_J);
      return;
    case JointType::kPlanar:
      q.segment<3>(coordinate) << X_JL.p.x(), X_JL.p.y(),
          unwrapped(turn_about(Vector3::UnitZ(), X_JL.R), q[coordinate + 2]);
      v_.segment<3>(velocity) << v_J.x(), v_J.y(), w_J.z();
      return;
    case JointType::kFree: {
      Eigen::Vector4d R(X_JL.R.w(), X_JL.R.x(), X_JL.R.y(), X_JL.R.z());
      R.normalize();
      // q and -q are one rotation: keep to the side of the latest.
      if (R.dot(q.segment<4>(coordinate + kFreeQuaternion)) < 0) R = -R;
      q.segment<7>(coordinate) << X_JL.p, R;
      v_.segment<6>(velocity) << v_J, w_J;
      return;
    }
    case JointType::kGuided:
    case JointType::kFollowing:
      return;  // No joint of a world is one.
  }
}

}  // namespace hlm::ve
