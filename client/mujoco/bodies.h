// MuJoCo's bodies, as a haptic server wants them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <utility>
#include <vector>

#include <mujoco/mujoco.h>

#include "hlm/client/mujoco/changes.h"
#include "hlm/common/contact.h"

namespace hlm::mujoco {

/// The vector in a row of one of MuJoCo's arrays with `columns` numbers in a row.
inline Vector3 row3(const mjtNum* array, int row, int columns = 3) {
  return Eigen::Map<const Vector3>(array + columns * row);
}
inline Quaternion rotation_of(const mjtNum* wxyz) {
  return Quaternion(wxyz[0], wxyz[1], wxyz[2], wxyz[3]).normalized();
}

/// A geom by the body that it moves with by joints: bodies without are welded to their parents, and
/// 0, the world, is also for what only a mocap body moves.
inline int body_of(const mjModel& model, int geom) {
  const int body = model.body_weldid[model.geom_bodyid[geom]];
  return model.body_dofnum[body] > 0 ? body : 0;
}

inline bool is_since(int major, int minor) {
  static const std::pair<int, int> version = [] {
    std::pair<int, int> read;
    std::sscanf(mj_versionString(), "%d.%d", &read.first, &read.second);
    return read;
  }();
  return version >= std::pair(major, minor);
}
/// Whether a gap lies beyond the margin, where contacts are listed without force. Before, it lay
/// within.
inline bool gap_is_beyond() { return is_since(3, 9); }

/// Margin and gap of a geom or pair.
struct Listing {
  mjtNum* margin;
  mjtNum* gap;
  mjtNum own_margin = *margin;
  mjtNum own_gap = *gap;

  /// Whether they have MuJoCo's force; they are listed where they were.
  void set_force(bool own, Changes& changes) const {
    constexpr double kNone = 1e3;  // m: a depth that none reaches.
    const bool beyond = gap_is_beyond();
    changes.set(*margin, !own && beyond ? -kNone : own_margin);
    changes.set(*gap, own ? own_gap : kNone + (beyond ? own_margin + own_gap : 0));
  }
};

/// The listings of the geoms and pairs for whose body `takes(body)` holds.
template <class Takes>
std::vector<Listing> listings(mjModel& model, Takes takes) {
  std::vector<Listing> found;
  for (int geom = 0; geom < model.ngeom; ++geom) {
    if (takes(body_of(model, geom))) {
      found.push_back({model.geom_margin + geom, model.geom_gap + geom});
    }
  }
  for (int pair = 0; pair < model.npair; ++pair) {
    if (takes(body_of(model, model.pair_geom1[pair])) ||
        takes(body_of(model, model.pair_geom2[pair]))) {
      found.push_back({model.pair_margin + pair, model.pair_gap + pair});
    }
  }
  return found;
}

/// A tool that sleeps would have no contacts with what does not move.
inline void keep_awake([[maybe_unused]] mjModel& model, [[maybe_unused]] int body,
                       [[maybe_unused]] Changes& changes) {
#if mjVERSION_HEADER >= 340
  changes.set(model.tree_sleep_policy[model.body_treeid[body]], mjSLEEP_NEVER);
#endif
}

/// What turning leaves of the one geom of a body that collides.
inline void set_roundness(const mjModel& model, const mjData& data, int body, MovableBody& to) {
  constexpr double kOffAxis = 1e-6;  // m: the axis passes the centre of mass no farther away.
  int only = -1;
  for (int geom = 0; geom < model.ngeom; ++geom) {
    const bool collides = model.geom_contype[geom] != 0 || model.geom_conaffinity[geom] != 0;
    if (body_of(model, geom) != body || !collides) continue;
    if (only >= 0) return;
    only = geom;
  }
  if (only < 0 || model.npair > 0) return;
  for (int joint = 0; joint < model.njnt; ++joint) {
    if (model.body_weldid[model.jnt_bodyid[joint]] == body && model.jnt_limited[joint]) return;
  }
  const Vector3 offset = row3(data.geom_xpos, only) - row3(data.xipos, body);
  const mjtNum* R = data.geom_xmat + 9 * only;
  const Vector3 axis(R[2], R[5], R[8]);
  const int type = model.geom_type[only];
  if (type == mjGEOM_SPHERE && offset.norm() < kOffAxis) to.roundness = Roundness::kSphere;
  const bool revolves = type == mjGEOM_CAPSULE || type == mjGEOM_CYLINDER;
  if (!revolves || axis.cross(offset).norm() >= kOffAxis) return;
  to.roundness = Roundness::kAxis;
  to.axis_W = axis;
}

/// A body in its present state, as mobile as its joints leave it here; without the centripetal part
/// of its acceleration, and without what the tool's push, a part of xfrc_applied, adds to that.
inline MovableBody describe(const mjModel& model, mjData& data, int body, const Vector6& push_W) {
  using Rows = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::RowMajor>;
  Rows J(6, model.nv);
  Rows solved(6, model.nv);
  mj_jacBodyCom(&model, &data, J.data(), J.data() + 3 * model.nv, body);
  mj_solveM(&model, &data, solved.data(), J.data(), 6);
  const Matrix6 W = J * solved.transpose();
  const Eigen::Map<const Eigen::VectorXd> v(data.qvel, model.nv);
  const Eigen::Map<const Eigen::VectorXd> a(data.qacc_smooth, model.nv);
  MovableBody found;
  found.id = static_cast<std::uint32_t>(body);
  found.p_WCom = row3(data.xipos, body);
  found.V_W = J * v;
  found.W = 0.5 * (W + W.transpose());
  found.A_W = J * a - W * push_W;
  set_roundness(model, data, body, found);
  return found;
}

/// What pushes a body with a free joint besides contacts and its weight: equalities, tendons,
/// actuators, springs, fluids, and what the program applies. About the body's origin, world axes, N
/// and N·m. The body resists as MuJoCo has it.
inline Wrench external_wrench(const mjModel& model, mjData& data, int body) {
  Eigen::VectorXd rows = Eigen::VectorXd::Zero(data.nefc);
  for (int i = 0; i < data.nefc; ++i) {
    const int type = data.efc_type[i];
    const bool is_no_contact =
        type == mjCNSTR_EQUALITY || type == mjCNSTR_FRICTION_TENDON || type == mjCNSTR_LIMIT_TENDON;
    if (is_no_contact) rows[i] = data.efc_force[i];
  }
  Eigen::VectorXd generalised = Eigen::VectorXd::Zero(model.nv);
  if (!rows.isZero(0)) mj_mulJacTVec(&model, &data, generalised.data(), rows.data());
  for (const mjtNum* other : {data.qfrc_passive, data.qfrc_actuator, data.qfrc_applied}) {
    generalised += Eigen::Map<const Eigen::VectorXd>(other, model.nv);
  }
  Wrench F_W = generalised.segment<6>(model.body_dofadr[body]);
  F_W.tail<3>() = rotation_of(data.xquat + std::ptrdiff_t{4} * body) * Vector3(F_W.tail<3>());
  const Eigen::Map<const Wrench> applied(data.xfrc_applied + std::ptrdiff_t{6} * body);
  F_W += applied;
  F_W.tail<3>() +=
      (row3(data.xipos, body) - row3(data.xpos, body)).cross(Vector3(applied.head<3>()));
  return F_W;
}

}  // namespace hlm::mujoco
