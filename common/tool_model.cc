#include "hlm/common/tool_model.h"

#include <algorithm>

#include "hlm/common/range.h"

namespace hlm {
namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

/// Velocity or acceleration of a rigid body, or force on it, about a point fixed in the world.
struct Spatial {
  Vector3 linear = Vector3::Zero();
  Vector3 angular = Vector3::Zero();
};

/// Force and torque about the point, for a body whose centre of mass is at `com` from it, that give
/// it the spatial acceleration A at the spatial velocity V.
Spatial inertial_force(const Link& link, const Matrix3& R_WL, const Vector3& com, const Spatial& V,
                       const Spatial& A) noexcept {
  const Vector3& omega = V.angular;
  const Vector3 force =
      link.mass * (A.linear + A.angular.cross(com) + omega.cross(V.linear + omega.cross(com)));
  const auto inertia = [&](const Vector3& x) -> Vector3 {
    return R_WL * (link.I_LCom * (R_WL.transpose() * x));
  };
  return {force, com.cross(force) + inertia(A.angular) + omega.cross(inertia(omega))};
}

}  // namespace

ToolModel::ToolModel(const ToolDescription& tool) noexcept
    : tool_(tool), dof_(tool.dof()), configuration_size_(tool.configuration_size()) {
  number_joints();
  set_configuration(neutral());
}

void ToolModel::number_joints() noexcept {
  int velocity = 0;
  int coordinate = 0;
  int motion = 0;
  std::array<int, kMaxLinks> velocities{};  // First one of each link's joint.
  for (int i = 0; i < links(); ++i) {
    const Link& link = tool_.links[at(i)];
    Joint& joint = joints_[at(i)];
    joint.first = motion;
    joint.count = link.joint == JointType::kFollowing ? 1 : joint_dof(link.joint);
    joint.coordinate = coordinate;
    velocities[at(i)] = velocity;
    if (has_curve(link.joint)) {
      const auto own = std::ranges::find(tool_.curves, i, &JointCurve::link);
      joint.curve = static_cast<int>(own - tool_.curves.begin());
      joint.coordinate = joints_[own->leader].coordinate;
      velocities[at(i)] = velocities[own->leader];
    }
    for (int k = 0; k < joint.count; ++k) coordinates_[at(motion + k)] = velocities[at(i)] + k;
    const std::uint32_t own = ((1u << joint.count) - 1u) << motion;
    moving_[at(i)] = own | (link.parent < 0 ? 0u : moving_[at(link.parent)]);
    motion += joint.count;
    velocity += joint_dof(link.joint);
    coordinate += joint_configuration_size(link.joint);
  }
  axes_.resize(6, motion);
}

Configuration ToolModel::neutral() const noexcept {
  Configuration q = Configuration::Zero(configuration_size_);
  constexpr int kQuaternionW = 3;
  if (tool_.links[0].joint == JointType::kFree) q[kQuaternionW] = 1;
  return q;
}

CurvePoint ToolModel::curve_point(const Joint& joint) const noexcept {
  const JointCurve& curve = tool_.curves[at(joint.curve)];
  const Link& leader = tool_.links[curve.leader];
  return point_of(curve, leader.lower, leader.upper, q_[joint.coordinate]);
}

Pose ToolModel::joint_transform(const Link& link, const Joint& joint) const noexcept {
  const int first = joint.coordinate;
  switch (link.joint) {
    case JointType::kFixed:
      return {};
    case JointType::kRevolute:
      return {Vector3::Zero(), Quaternion(Eigen::AngleAxisd(q_[first], link.axis))};
    case JointType::kPrismatic:
      return {q_[first] * link.axis, Quaternion::Identity()};
    case JointType::kPlanar:
      return {Vector3(q_[first], q_[first + 1], 0),
              Quaternion(Eigen::AngleAxisd(q_[first + 2], Vector3::UnitZ()))};
    case JointType::kFree:
      return {q_.segment<3>(first),
              Quaternion(q_[first + 3], q_[first + 4], q_[first + 5], q_[first + 6])};
    case JointType::kGuided:
    case JointType::kFollowing:
      return curve_point(joint).X_JL;
  }
  return {};
}

/// Writes the joint's columns of axes_: the twist that each of its motions gives to a body point
/// now at the root link's origin.
void ToolModel::write_motion_axes(const Link& link, const Pose& X_WJ, const Pose& X_WL,
                                  const Joint& joint) noexcept {
  const int first = joint.first;
  const Vector3 root = X_WL_[0].p;
  const auto translation = [&](int column, const Vector3& axis) {
    axes_.col(column) << axis, Vector3::Zero();
  };
  const auto rotation = [&](int column, const Vector3& axis) {
    axes_.col(column) << axis.cross(root - X_WL.p), axis;
  };
  switch (link.joint) {
    case JointType::kFixed:
      return;
    case JointType::kRevolute:
      rotation(first, X_WJ.R * link.axis);
      return;
    case JointType::kPrismatic:
      translation(first, X_WJ.R * link.axis);
      return;
    case JointType::kPlanar:
      translation(first, X_WJ.R * Vector3::UnitX());
      translation(first + 1, X_WJ.R * Vector3::UnitY());
      rotation(first + 2, X_WJ.R * Vector3::UnitZ());
      return;
    case JointType::kFree:
      for (int i = 0; i < 3; ++i) {
        translation(first + i, X_WJ.R * Vector3::Unit(i));
        rotation(first + 3 + i, X_WJ.R * Vector3::Unit(i));
      }
      return;
    case JointType::kGuided:
    case JointType::kFollowing: {
      const CurvePoint point = curve_point(joint);
      rotation(first, X_WJ.R * point.omega_J);
      axes_.col(first).head<3>() += X_WJ.R * point.v_J;
      return;
    }
  }
}

void ToolModel::set_configuration(const Configuration& q) noexcept {
  q_ = q;
  for (int i = 0; i < links(); ++i) {
    const Link& link = tool_.links[at(i)];
    const Pose X_WJ = link.parent < 0 ? link.X_PJ : X_WL_[at(link.parent)] * link.X_PJ;
    X_WL_[at(i)] = X_WJ * joint_transform(link, joints_[at(i)]);
    write_motion_axes(link, X_WJ, X_WL_[at(i)], joints_[at(i)]);
  }
}

Configuration ToolModel::integrate(const Configuration& q, const Velocity& v,
                                   double dt) const noexcept {
  Configuration moved = q;
  if (tool_.links[0].joint != JointType::kFree) {
    moved += dt * v;
    return moved;
  }
  moved.head<3>() += dt * v.head<3>();
  const Quaternion R(q[3], q[4], q[5], q[6]);
  const Quaternion R_moved = (rotation_from_vector(dt * v.segment<3>(3)) * R).normalized();
  moved.segment<4>(3) << R_moved.w(), R_moved.vec();
  constexpr int kFreeCoordinates = 7;
  const int rest = configuration_size_ - kFreeCoordinates;
  moved.tail(rest) += dt * v.tail(rest);
  return moved;
}

Jacobian ToolModel::jacobian(int link, const Vector3& p_W) const noexcept {
  Jacobian J(6, dof_);
  const Vector3 arm = p_W - X_WL_[0].p;
  J.setZero();
  for (int j = 0; j < axes_.cols(); ++j) {
    if (!moves(j, link)) continue;
    const Vector3 angular = axes_.col(j).tail<3>();
    J.col(coordinate_of(j)).head<3>() += axes_.col(j).head<3>() + angular.cross(arm);
    J.col(coordinate_of(j)).tail<3>() += angular;
  }
  return J;
}

PointJacobian ToolModel::point_jacobian(int link, const Vector3& p_W) const noexcept {
  return jacobian(link, p_W).topRows<3>();
}

/// Composite rigid bodies, all about the root link's origin in world axes, so that inertias add
/// without transformation.
MassMatrix ToolModel::mass_matrix() const noexcept {
  std::array<Matrix6, kMaxLinks> composite;
  for (int i = 0; i < links(); ++i) {
    const Link& link = tool_.links[at(i)];
    const Matrix3 R = X_WL(i).R.toRotationMatrix();
    const Matrix3 arm = skew(X_WL(i) * link.p_LCom - X_WL_[0].p);
    composite[at(i)] << link.mass * Matrix3::Identity(), -link.mass * arm, link.mass * arm,
        R * link.I_LCom * R.transpose() - link.mass * arm * arm;
  }
  for (int i = links() - 1; i > 0; --i) {
    composite[at(tool_.links[at(i)].parent)] += composite[at(i)];
  }

  MassMatrix D = MassMatrix::Zero(dof_, dof_);
  for (int i = links() - 1; i >= 0; --i) {
    const Joint& joint = joints_[at(i)];
    for (int j = joint.first; j < joint.first + joint.count; ++j) {
      const Vector6 momentum = composite[at(i)] * axes_.col(j);
      for (int k = 0; k <= j; ++k) {
        if (!moves(k, i)) continue;
        const double share = axes_.col(k).dot(momentum);
        D(coordinate_of(j), coordinate_of(k)) += share;
        if (j != k) D(coordinate_of(k), coordinate_of(j)) += share;
      }
    }
    if (joint.curve < 0 || tool_.links[at(i)].joint != JointType::kGuided) continue;
    const int own = coordinate_of(joint.first);
    D(own, own) += tool_.curves[at(joint.curve)].armature;
  }
  return D;
}

GeneralisedForce ToolModel::gravity() const noexcept {
  GeneralisedForce G = GeneralisedForce::Zero(dof_);
  if (tool_.gravity_W.isZero(0)) return G;
  for (int i = 0; i < links(); ++i) {
    const Link& link = tool_.links[at(i)];
    const Vector3 com = X_WL(i) * link.p_LCom;
    G -= point_jacobian(i, com).transpose() * (link.mass * tool_.gravity_W);
  }
  return G;
}

Vector6 ToolModel::bend_of(int i, double speed) const noexcept {
  if (joints_[at(i)].curve < 0) return Vector6::Zero();
  const Link& link = tool_.links[at(i)];
  const Pose X_WJ = link.parent < 0 ? link.X_PJ : X_WL(link.parent) * link.X_PJ;
  const CurvePoint point = curve_point(joints_[at(i)]);
  const Vector3 alpha = X_WJ.R * point.alpha_J;
  const Vector3 omega = X_WJ.R * point.omega_J;
  Vector6 bend;
  bend << X_WJ.R * point.a_J + alpha.cross(X_WL_[0].p - X_WL(i).p) -
              omega.cross(X_WJ.R * point.v_J),
      alpha;
  return speed * speed * bend;
}

/// Outwards the accelerations with q̈ = 0, inwards the forces that they take, all about the point
/// where the root link's origin is now, which stays where it is while the root moves on.
GeneralisedForce ToolModel::bias_force(const Velocity& v) const noexcept {
  std::array<Spatial, kMaxLinks> V, A, force;
  for (int i = 0; i < links(); ++i) {
    const Link& link = tool_.links[at(i)];
    const Spatial parent_V = link.parent < 0 ? Spatial{} : V[at(link.parent)];
    const Spatial parent_A = link.parent < 0 ? Spatial{} : A[at(link.parent)];
    Spatial joint;
    Vector3 translation = Vector3::Zero();  // Velocity of the axes that rotations turn about.
    const Joint& own = joints_[at(i)];
    for (int j = own.first; j < own.first + own.count; ++j) {
      const Vector3 linear = v[coordinate_of(j)] * axes_.col(j).head<3>();
      const Vector3 angular = v[coordinate_of(j)] * axes_.col(j).tail<3>();
      joint.linear += linear;
      joint.angular += angular;
      if (angular.isZero(0)) translation += linear;
    }
    V[at(i)] = {parent_V.linear + joint.linear, parent_V.angular + joint.angular};
    // The joint's axes are carried along by the parent, those of its rotations by its translations
    // too, and those of a curve bend.
    const Vector6 bend = bend_of(i, own.curve < 0 ? 0 : v[coordinate_of(own.first)]);
    A[at(i)] = {parent_A.linear + parent_V.angular.cross(joint.linear) +
                    (parent_V.linear + translation).cross(joint.angular) + bend.head<3>(),
                parent_A.angular + parent_V.angular.cross(joint.angular) + bend.tail<3>()};
    force[at(i)] = inertial_force(link, X_WL(i).R.toRotationMatrix(),
                                  X_WL(i) * link.p_LCom - X_WL_[0].p, V[at(i)], A[at(i)]);
  }

  GeneralisedForce c = GeneralisedForce::Zero(dof_);
  for (int i = links() - 1; i >= 0; --i) {
    const Link& link = tool_.links[at(i)];
    const Joint& own = joints_[at(i)];
    for (int j = own.first; j < own.first + own.count; ++j) {
      c[coordinate_of(j)] += axes_.col(j).head<3>().dot(force[at(i)].linear) +
                             axes_.col(j).tail<3>().dot(force[at(i)].angular);
    }
    if (i > 0) {
      force[at(link.parent)].linear += force[at(i)].linear;
      force[at(link.parent)].angular += force[at(i)].angular;
    }
  }
  return c;
}

std::optional<Sentence> find_singular_error(const ToolModel& tool) noexcept {
  const MassMatrix D = tool.mass_matrix();
  MassMatrix rest = D;  // What is left where the coordinates before are free.
  int k = 0;
  for (int i = 0; i < tool.links(); ++i) {
    const int dof = joint_dof(tool.description().links[static_cast<std::size_t>(i)].joint);
    for (const int end = k + dof; k < end; ++k) {
      const double share = D(k, k) > 0 ? std::max(0.0, rest(k, k) / D(k, k)) : 0;
      if (!(share >= kSmallestShare)) {
        return Sentence("link ") + i + ": the share of its joint's inertia that no joint before " +
               "moves is " + brief_text(share) + " in the initial configuration and must be " +
               "at least " + brief_text(kSmallestShare);
      }
      const int after = tool.dof() - k - 1;
      const Velocity column = rest.col(k).tail(after);
      rest.bottomRightCorner(after, after) -= column * column.transpose() / rest(k, k);
    }
  }
  return std::nullopt;
}

}  // namespace hlm
