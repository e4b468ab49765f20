// Bodies that joints connect, as a tree that moves by itself (docs/method.md 21).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "hlm/common/body_joint.h"
#include "hlm/common/tool_model.h"

namespace hlm::server {

/// A tree of bodies whose root hangs on the world or is free. Springs, dampers, dry friction and
/// stops of its joints act implicitly, at the end of a step; whether friction sticks and a stop
/// carries is what the step before found. Nothing allocates.
class Mechanism {
 public:
  /// A body, and the joint that it hangs on; a root may be of type kFree.
  struct Member {
    BodyInertia inertia;
    BodyJoint joint;
  };
  /// Parents before children. Throws std::invalid_argument, which names the body, if there are too
  /// many, or it cannot move.
  explicit Mechanism(std::span<const Member> members);

  std::size_t size() const noexcept { return parts_.size(); }
  std::uint32_t body(std::size_t i) const noexcept { return parts_[i].body; }
  int dof() const noexcept { return model_.dof(); }

  /// Whether another one has the same bodies and joints.
  bool is_built_as(const Mechanism& other) const noexcept;

  /// poses: of its bodies, in their order. pace: of its time in the hand's, as in begin_step().
  void set_state(std::span<const BodyPose> poses, double pace) noexcept;

  /// A step of dt, s, begins where it is now. pace: of its time in the hand's.
  void begin_step(double dt, double pace) noexcept;
  /// Pose of a body.
  Pose X_WB(std::size_t i) const noexcept;
  /// Velocity of the point of a body that is at p_W, and how it changes without contacts, 1/s.
  Twist velocity(std::size_t i, const Vector3& p_W) const noexcept;
  Twist acceleration(std::size_t i, const Vector3& p_W) const noexcept;
  /// 6×dof B of that point: an impulse P there changes the velocity of another by its B (Bᵀ P). In
  /// these coordinates, y, the mechanism has unit mass.
  Jacobian mobility(std::size_t i, const Vector3& p_W) const noexcept;

  /// Impulses change its velocity by y.
  void push(const Velocity& y) noexcept;
  /// The step ends with a change of velocity by y.
  void advance(const Velocity& y) noexcept;

 private:
  /// A body, which is the link of its number.
  struct Part {
    std::uint32_t body = 0;
    BodyJoint joint;
    int coordinate = -1;  ///< Of velocity, of its joint; -1: it is the free root.
    Pose X_LB = {};       ///< Its frame in its link's.
    Vector3 gravity_W = Vector3::Zero();
  };
  /// What acts on one coordinate.
  struct Force {
    std::size_t part = 0;  ///< Of whose joint.
    double lower = -kNoLimit;
    double upper = kNoLimit;

    double strain = 0;        ///< Of dry friction that sticks, m or rad.
    double slips = 0;         ///< Sign of the velocity at which it slips; 0: it sticks.
    double against = 0;       ///< What dry friction was up against in the step before, N or N·m.
    double at_stop = 0;       ///< 1: at the lower one, -1: at the upper one, 0: between them.
    double inertia = 0;       ///< In this step, kg or kg·m²,
    double grip = 0;          ///< and stiffness of what sticks and stops,
    double grip_damping = 0;  ///< and its damping.

    double bound() const noexcept { return at_stop > 0 ? lower : upper; }
  };

  static ToolDescription tree_of(std::span<const Member> members);
  const BodyJoint& joint_of(const Force& force) const noexcept { return parts_[force.part].joint; }
  double q(int coordinate) const noexcept { return model_.configuration()[coordinate + extra_]; }
  void decide(Force& force, double v) const noexcept;
  /// After a step that began at q with v_before and ends with v.
  void settle(Force& force, double q, double v_before, double v) const noexcept;
  double held_by(const Force& force, double strain, double v) const noexcept;

  ToolModel model_;
  int extra_ = 0;  ///< By which the configuration is longer than the velocity.
  StaticVector<Part, kMaxLinks> parts_;
  StaticVector<Force, kMaxDof> forces_;  ///< By coordinate of velocity.
  Velocity v_;
  Velocity a_;     ///< v̇ without contacts.
  MassMatrix T_;   ///< v changes by T y.
  double dt_ = 0;  ///< s.
  double pace_ = 1;
};

/// The trees of bodies that joints connect. What is too large, or cannot move, is none, and is not
/// among `inertias` any more: it is a wall. Throws std::invalid_argument, which names the body, if
/// a joint's bodies are not known, or joints make a loop.
std::vector<Mechanism> mechanisms_of(std::vector<BodyInertia>& inertias,
                                     std::span<const BodyJoint> joints);

}  // namespace hlm::server
