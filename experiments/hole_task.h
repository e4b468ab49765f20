// The peg in its exactly fitting hole, shaken sideways (paper Sec. V-B and V-C).
#pragma once

#include "experiments/trial.h"
#include "tests/support/worlds.h"

namespace hlm::experiments {

/// The peg upright, on the bottom of the hole.
inline ve::WorldDescription world_of_hole() {
  return ve::with_start(test::repository_world("testbed.sdf"), "peg", "hole");
}
inline Pose peg_in_hole() { return ve::find_model(world_of_hole(), "peg").X_WM; }

/// amplitude: of the hand's force along x, N, at 2.5 Hz (the paper's sin(5πt)).
inline Task hole_task(double amplitude, double stiffness, double damping, double duration = 6) {
  Task task;
  task.world = world_of_hole();
  task.tool = "peg";
  task.hand = shake({amplitude, 0, 0}, 2.5);
  task.duration = duration;
  task.stiffness = stiffness;
  task.damping = damping;
  return task;
}

}  // namespace hlm::experiments
