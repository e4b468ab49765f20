#include "hlm/haptic_server/local_model/free_motion.h"

#include <cmath>

#include <Eigen/Cholesky>

namespace hlm::server {
namespace {

/// First coordinate of a free root's quaternion.
constexpr int kQuaternion = 3;

Quaternion orientation(const Configuration& q) noexcept {
  return {q[kQuaternion], q[kQuaternion + 1], q[kQuaternion + 2], q[kQuaternion + 3]};
}

/// Rotation, in the body's axes, that a free body makes in dt. Pi: its angular momentum in these
/// axes, which obeys Π' = Π × ω with ω = I⁻¹ Π. Runge-Kutta for Π, Magnus' expansion
/// for the rotation; both of fourth order.
Quaternion turn_freely(const Matrix3& inverse_inertia, const Vector3& Pi, double dt) noexcept {
  const auto omega = [&](const Vector3& x) -> Vector3 { return inverse_inertia * x; };
  const auto moved = [&](const Vector3& x, const Vector3& omega_x, double time) -> Vector3 {
    return Pi + time * x.cross(omega_x);
  };
  const Vector3 a = omega(Pi);
  const Vector3 Pi_b = moved(Pi, a, dt / 2);
  const Vector3 b = omega(Pi_b);
  const Vector3 Pi_c = moved(Pi_b, b, dt / 2);
  const Vector3 c = omega(Pi_c);
  const Vector3 d = omega(moved(Pi_c, c, dt));
  return rotation_from_vector(dt / 6 * (a + 2 * b + 2 * c + d) + dt * dt / 12 * a.cross(d));
}

/// A tool of one free link: a rigid body.
void move_rigid_body(ToolModel& tool, Velocity& v, double dt) noexcept {
  const Link& link = tool.description().links[0];
  const Matrix3 inverse_inertia = link.I_LCom.inverse();
  Configuration q = tool.configuration();
  const Quaternion R = orientation(q);
  const Vector3 omega = v.tail<3>();
  const Vector3 arm = R * link.p_LCom;
  const Vector3 v_com = v.head<3>() + omega.cross(arm);
  const Vector3 Pi = link.I_LCom * (R.conjugate() * omega);

  const Quaternion R_moved = (R * turn_freely(inverse_inertia, Pi, dt)).normalized();
  const Vector3 omega_moved = R_moved * (inverse_inertia * (R_moved.conjugate() * (R * Pi)));
  const Vector3 arm_moved = R_moved * link.p_LCom;
  q.head<3>() += dt * v_com + arm - arm_moved;
  q.segment<4>(kQuaternion) << R_moved.w(), R_moved.vec();
  v << v_com - omega_moved.cross(arm_moved), omega_moved;
  tool.set_configuration(q);
}

/// ½ ω R, the rate of a quaternion, in the order of its coordinates: w, x, y, z.
Eigen::Vector4d quaternion_rate(const Quaternion& R, const Vector3& omega) noexcept {
  const Quaternion rate = Quaternion(0, omega.x() / 2, omega.y() / 2, omega.z() / 2) * R;
  return {rate.w(), rate.x(), rate.y(), rate.z()};
}

/// Rates of the coordinates and of their velocities.
struct Slope {
  Configuration q;
  Velocity v;

  friend Slope operator+(const Slope& a, const Slope& b) noexcept { return {a.q + b.q, a.v + b.v}; }
  friend Slope operator*(double x, const Slope& a) noexcept { return {x * a.q, x * a.v}; }
};

void move_linkage(ToolModel& tool, Velocity& v, double dt) noexcept {
  const bool free_root = tool.description().links[0].joint == JointType::kFree;
  const Configuration q_0 = tool.configuration();
  const Velocity v_0 = v;
  MassMatrix D = tool.mass_matrix();
  const double energy = v.dot(D * v);  // Twice the kinetic energy, J.

  const auto slope_at_present = [&] {
    Slope slope{Configuration(q_0.size()), -D.llt().solve(tool.bias_force(v))};
    if (free_root) {
      slope.q << v.head<3>(), quaternion_rate(orientation(tool.configuration()), v.segment<3>(3)),
          v.tail(v.size() - 6);
    } else {
      slope.q = v;
    }
    return slope;
  };
  const auto go = [&](const Slope& slope, double time) {
    tool.set_configuration(q_0 + time * slope.q);
    v = v_0 + time * slope.v;
  };
  const auto slope_after = [&](const Slope& slope, double time) {
    go(slope, time);
    D = tool.mass_matrix();
    return slope_at_present();
  };
  const Slope a = slope_at_present();
  const Slope b = slope_after(a, dt / 2);
  const Slope c = slope_after(b, dt / 2);
  const Slope d = slope_after(c, dt);
  go(a + 2 * b + 2 * c + d, dt / 6);
  if (free_root) {
    Configuration q = tool.configuration();
    q.segment<4>(kQuaternion).normalize();
    tool.set_configuration(q);
  }
  const double reached = v.dot(tool.mass_matrix() * v);
  if (reached > 0) v *= std::sqrt(energy / reached);
}

void move(ToolModel& tool, Velocity& v, double dt) noexcept {
  const Link& root = tool.description().links[0];
  const bool rigid = tool.links() == 1;
  if (rigid && root.joint == JointType::kFree) return move_rigid_body(tool, v, dt);
  // D is constant: about an axis at rest, or in the plane about the centre of mass.
  if (rigid && (root.joint != JointType::kPlanar || root.p_LCom.head<2>().isZero(0))) {
    return tool.set_configuration(tool.integrate(tool.configuration(), v, dt));
  }
  move_linkage(tool, v, dt);
}

}  // namespace

void move_freely(ToolModel& tool, Velocity& v, double dt) noexcept {
  const Configuration q_0 = tool.configuration();
  const Velocity v_0 = v;
  move(tool, v, dt);
  if (v.allFinite() && tool.configuration().allFinite()) return;
  // Faster than the equations of motion can be evaluated: it stays for this step.
  tool.set_configuration(q_0);
  v = v_0;
}

}  // namespace hlm::server
