// What a haptic server must know of MuJoCo's bodies to move them, and how they are put in a place.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <set>
#include <vector>

#include <mujoco/mujoco.h>

#include "hlm/client/haptic_client.h"
#include "hlm/client/mujoco/bodies.h"
#include "hlm/common/body_joint.h"

namespace hlm::mujoco {

/// The bodies of one model; what is welded to one counts as a part of it. It changes the model:
/// what is kept in its place resists nothing else.
class Bodies {
 public:
  Bodies(mjModel& model, int tool, Changes& changes)
      : model_(model), tool_(tool), changes_(changes) {}

  /// Puts a body with a joint in its place; of a free one pose and twist of its frame.
  void place(mjData& data, int body, const Pose& X_WB, const Twist& V_W,
             const JointState& state = {}) {
    const int joint = model_.body_jntadr[body];
    mjtNum* q = data.qpos + model_.jnt_qposadr[joint];
    mjtNum* v = data.qvel + model_.jnt_dofadr[joint];
    if (model_.jnt_type[joint] != mjJNT_FREE) {
      const double due = state.q + model_.qpos0[model_.jnt_qposadr[joint]];
      constexpr double kTurn =
          2 * std::numbers::pi;  // A pose does not tell how often it has turned.
      const bool turns = model_.jnt_type[joint] == mjJNT_HINGE;
      *q = turns ? due + kTurn * std::round((*q - due) / kTurn) : due;
      *v = state.v;
      put_[body] = {{*q, 0, 0}, {*v, 0, 0}};
      return;
    }
    std::copy_n(X_WB.p.data(), 3, q);
    q[3] = X_WB.R.w();
    std::copy_n(X_WB.R.vec().data(), 3, q + 4);
    const Vector3 spin_B = X_WB.R.conjugate() * Vector3(V_W.tail<3>());  // As MuJoCo has it.
    put_[body] = {X_WB.p, V_W.head<3>()};
    std::copy_n(V_W.data(), 3, v);
    std::copy_n(spin_B.data(), 3, v + 3);
  }

  /// A frame of so many seconds has ended. Returns the bodies that are kept and that somebody has
  /// put elsewhere within it, by more than steps of MuJoCo would.
  std::vector<int> leave(const mjData& data, double length) {
    std::vector<int> moved;
    for (auto& [body, q] : kept_) {
      const std::vector<mjtNum> now = place_of(data, body);
      const auto put = put_.find(body);
      if (put != put_.end() && body != tool_) {
        const Vector3 due = put->second.q + length * put->second.v;
        const std::size_t count = std::min<std::size_t>(3, now.size());
        if (!std::equal(now.begin(), now.begin() + static_cast<std::ptrdiff_t>(count), due.data(),
                        is_near)) {
          moved.push_back(body);
        }
      }
      q = now;
    }
    put_.clear();
    return moved;
  }
  /// Whether somebody has put a body that is kept elsewhere since the frame before, by more than
  /// steps of MuJoCo would.
  bool was_moved(const mjData& data, int body) const {
    const auto kept = kept_.find(body);
    if (kept == kept_.end() || kept->second.empty()) return false;
    const std::vector<mjtNum> now = place_of(data, body);
    return !std::ranges::equal(now, kept->second, is_near);
  }

  /// Nothing moves it within a frame, until let_go().
  void keep(int body) {
    if (!kept_.try_emplace(body).second) return;
    constexpr double kKept = 1e6;  // kg and kg·m². Of free joints MuJoCo reads dof_M0 alone.
    const int along = model_.body_dofadr[body];
    for (int i = along; i < along + model_.body_dofnum[body]; ++i) {
      changes_.set(model_.dof_armature[i], kKept);
      changes_.set(model_.dof_M0[i], kKept);
    }
    keep_awake(model_, body, changes_);
  }
  void let_go(int body) {
    if (kept_.erase(body) == 0) return;
    const int along = model_.body_dofadr[body];
    for (int i = along; i < along + model_.body_dofnum[body]; ++i) {
      changes_.give_back(model_.dof_armature[i]);
      changes_.give_back(model_.dof_M0[i]);
    }
  }

  /// Adds inertias and joints of the bodies that can be pushed and that the server can move, where
  /// they are now: all that joints connect have a shape among those that are offered, and nothing
  /// moves them that it cannot be told.
  void add_dynamics(const mjData& data, protocol::SceneOffer& offer) const {
    const std::set<int> moved = moved_by_others();
    const auto has_shape = [&](int body) {
      return std::ranges::any_of(offer.shapes, [&](const protocol::OfferedShape& shape) {
        return shape.side == ContactSide{SideKind::kMovableBody, static_cast<std::uint32_t>(body)};
      });
    };
    std::set<int> roots;
    std::set<int> untold;  // Trees.
    std::map<int, int> freedoms;
    for (int body = 1; body < model_.nbody; ++body) {
      if (model_.body_dofnum[body] == 0 || body == tool_) continue;
      roots.insert(body);
      freedoms[tree_of(body)] += model_.body_dofnum[body];
      if (!has_shape(body) || !can_be_told(body) || moved.contains(body)) {
        untold.insert(tree_of(body));
      }
    }
    for (const int body : roots) {
      if (untold.contains(tree_of(body)) || freedoms[tree_of(body)] > kMaxDof) continue;
      offer.inertias.push_back(inertia_of(data, body));
      const int joint = model_.body_jntadr[body];
      if (model_.jnt_type[joint] != mjJNT_FREE) offer.joints.push_back(joint_of(body, joint));
    }
  }

 private:
  /// Of numbers of qpos, m or rad: as near as MuJoCo's steps leave them.
  static bool is_near(double a, double b) { return std::abs(a - b) <= 5e-3; }

  static constexpr double kLeastMass = 1e-6;  // kg
  static constexpr double kMostMass = 1e6;

  std::vector<mjtNum> place_of(const mjData& data, int body) const {
    const int joint = model_.body_jntadr[body];
    const mjtNum* q = data.qpos + model_.jnt_qposadr[joint];
    return {q, q + (model_.jnt_type[joint] == mjJNT_FREE ? 7 : 1)};
  }

  struct Root {
    int body;   ///< 0: the world.
    Pose X_RB;  ///< Of the body that is welded to it.
  };

  Pose own_frame(int body) const {
    return {row3(model_.body_pos, body), rotation_of(model_.body_quat + std::ptrdiff_t{4} * body)};
  }
  Root root_of(int body) const {
    Root root{body, {}};
    while (root.body != 0 && model_.body_dofnum[root.body] == 0 &&
           model_.body_mocapid[root.body] < 0) {
      root.X_RB = own_frame(root.body) * root.X_RB;
      root.body = model_.body_parentid[root.body];
    }
    return root;
  }

  /// It has one joint, free, a slide or a hinge, and hangs on no mocap body and not on the tool.
  bool can_be_told(int body) const {
    double mass = 0;  // kg
    for (int part = 1; part < model_.nbody; ++part) {
      if (model_.body_weldid[part] == body) mass += model_.body_mass[part];
    }
    if (model_.body_jntnum[body] != 1 || mass < kLeastMass || mass > kMostMass) return false;
    const int joint = model_.body_jntadr[body];
    const int along = model_.jnt_dofadr[joint];
    if (model_.jnt_type[joint] == mjJNT_FREE) {
      bool loose = model_.jnt_stiffness[joint] == 0;
      for (int i = along; i < along + 6; ++i) {
        loose = loose && model_.dof_frictionloss[i] == 0 && model_.dof_armature[i] == 0 &&
                model_.dof_damping[i] == 0;
      }
      return loose;
    }
    const Root root = root_of(model_.body_parentid[body]);
    const bool one_axis =
        model_.jnt_type[joint] == mjJNT_SLIDE || model_.jnt_type[joint] == mjJNT_HINGE;
    const double range = model_.jnt_range[2 * joint + 1] - model_.jnt_range[2 * joint];
    const bool counts_turns = model_.jnt_type[joint] == mjJNT_HINGE &&
                              (model_.jnt_limited[joint] ? range > 2 * std::numbers::pi
                                                         : model_.jnt_stiffness[joint] > 0);
    return one_axis && !counts_turns && root.body != tool_ && model_.body_mocapid[root.body] < 0;
  }

  /// The body among those that joints connect with it that hangs on the world, or on what only
  /// moves by itself.
  int tree_of(int body) const {
    const int parent = root_of(model_.body_parentid[body]).body;
    return model_.body_dofnum[parent] == 0 ? body : tree_of(parent);
  }

  /// Bodies that fluids, equalities, tendons, actuators or flexes may move: all, where it is not
  /// known which.
  std::set<int> moved_by_others() const {
    std::set<int> all;
    for (int body = 1; body < model_.nbody; ++body) all.insert(body);
    const bool fluid = model_.opt.density > 0 || model_.opt.viscosity > 0;
    // What a model switches off besides gravity is off in all its joints.
    if ((model_.opt.disableflags & (mjDSBL_LIMIT | mjDSBL_FRICTIONLOSS)) != 0) return all;
    if (fluid || has_flexes() || model_.ntendon > 0) return all;
    std::set<int> moved;
    for (int i = 0; i < model_.nu; ++i) {
      const int kind = model_.actuator_trntype[i];
      if (kind != mjTRN_JOINT && kind != mjTRN_JOINTINPARENT) return all;
      moved.insert(model_.jnt_bodyid[model_.actuator_trnid[2 * i]]);
    }
    for (int i = 0; i < model_.neq; ++i) {
      if (model_.eq_type[i] != mjEQ_CONNECT && model_.eq_type[i] != mjEQ_WELD) return all;
      for (const int item : {model_.eq_obj1id[i], model_.eq_obj2id[i]}) {
#if mjVERSION_HEADER >= 324
        if (model_.eq_objtype[i] == mjOBJ_SITE) return all;
#endif
        moved.insert(model_.body_weldid[item]);
      }
    }
    return moved;
  }

  /// What MuJoCo 2 does not have.
  bool has_flexes() const {
#if mjVERSION_HEADER >= 300
    return model_.nflex > 0;
#else
    return false;
#endif
  }
  double buoyancy([[maybe_unused]] int body) const {
#if mjVERSION_HEADER >= 300
    return model_.body_gravcomp[body];
#else
    return 0;
#endif
  }

  BodyInertia inertia_of(const mjData& data, int root) const {
    BodyInertia to;
    to.body = static_cast<std::uint32_t>(root);
    to.mass = 0;
    double weight = 0;
    const Quaternion R = rotation_of(data.xquat + std::ptrdiff_t{4} * root).conjugate();
    const auto for_parts = [&](auto&& use) {
      for (int part = 1; part < model_.nbody; ++part) {
        if (model_.body_weldid[part] != root) continue;
        use(part, model_.body_mass[part], R * (row3(data.xipos, part) - row3(data.xpos, root)));
      }
    };
    for_parts([&](int part, double mass, const Vector3& centre) {
      to.mass += mass;
      to.p_BCom += mass * centre;
      weight += mass * (1 - buoyancy(part));
    });
    to.p_BCom /= to.mass;
    to.I_BCom.setZero();
    for_parts([&](int part, double mass, const Vector3& centre) {
      const Eigen::Map<const Eigen::Matrix<mjtNum, 3, 3, Eigen::RowMajor>> X(data.ximat + 9 * part);
      const Matrix3 turn = R.toRotationMatrix() * X;
      const Vector3 arm = centre - to.p_BCom;
      to.I_BCom += turn * row3(model_.body_inertia, part).asDiagonal() * turn.transpose() +
                   mass * (arm.squaredNorm() * Matrix3::Identity() - arm * arm.transpose());
    });
    const bool falls = (model_.opt.disableflags & mjDSBL_GRAVITY) == 0;
    if (falls) to.gravity_W = weight / to.mass * row3(model_.opt.gravity, 0);
    return to;
  }

  BodyJoint joint_of(int body, int joint) const {
    const int along = model_.jnt_dofadr[joint];
    const int at = model_.jnt_qposadr[joint];
    const double zero = model_.qpos0[at];
    const Root root = root_of(model_.body_parentid[body]);
    const Pose X_BJ{row3(model_.jnt_pos, joint), Quaternion::Identity()};
    BodyJoint to;
    to.body = static_cast<std::uint32_t>(body);
    to.parent = root.body == 0 ? kNoBody : static_cast<std::uint32_t>(root.body);
    to.type = model_.jnt_type[joint] == mjJNT_HINGE ? JointType::kRevolute : JointType::kPrismatic;
    to.X_PJ = root.X_RB * own_frame(body) * X_BJ;
    to.X_BJ = X_BJ;
    to.axis = row3(model_.jnt_axis, joint);
    if (model_.jnt_limited[joint]) {
      to.lower = model_.jnt_range[2 * joint] - zero;
      to.upper = model_.jnt_range[2 * joint + 1] - zero;
    }
    to.stiffness = model_.jnt_stiffness[joint];
    to.reference = model_.qpos_spring[at] - zero;
    to.damping = model_.dof_damping[along];
    to.friction = model_.dof_frictionloss[along];
    to.armature = model_.dof_armature[along];
    return to;
  }

  mjModel& model_;
  int tool_;
  /// Where a body was put in this frame, and how it moves, as far as qpos has it first.
  struct Put {
    Vector3 q;
    Vector3 v;
  };

  Changes& changes_;
  std::map<int, Put> put_;
  std::map<int, std::vector<mjtNum>> kept_;  ///< With their places in qpos at the latest leave().
};

}  // namespace hlm::mujoco
