// The joints of the world's bodies: where they are, their springs, their limits.
#pragma once

#include <span>
#include <vector>

#include <ode/ode.h>

#include "hlm/ve_client/scene/world_description.h"

namespace hlm::ve {

/// Joints are named by their index in the description. Those between two fixed bodies do nothing.
class Joints {
 public:
  /// `bodies`: the engine's, null for fixed ones, in their initial poses.
  Joints(dWorldID world, const WorldDescription& description, std::span<const dBodyID> bodies);

  /// Angle or displacement from the initial poses, rad or m; 0 for a fixed or ball joint.
  double position(int joint) const;
  /// Rate of the joint, rad/s or m/s.
  double velocity(int joint) const;
  /// What its spring does along its axis: torque or force on the child, N·m or N; the parent gets
  /// the opposite. Damping is the solver's own.
  double spring_force(int joint) const;
  /// Load on the joint's limit along its axis in the latest step of the solver, N·m or N, >= 0.
  double limit_force(int joint) const;
  /// Applies the springs' forces of the present state during the next step of the solver.
  void push_springs();
  /// All joints of a body end.
  void remove_from(dBodyID body);

 private:
  struct Joint {
    JointDescription description;
    dJointID handle = nullptr;  ///< Null between two fixed bodies, and after its end.
    dJointFeedback feedback{};
  };
  const Joint& at(int joint) const { return joints_[static_cast<std::size_t>(joint)]; }

  std::vector<Joint> joints_;
};

}  // namespace hlm::ve
