// The experiments, each in a file of its own.
#pragma once

#include "experiments/bench.h"

namespace hlm::experiments {

void one_dof_hole_unstable(Bench& bench);  ///< Fig. 6.
void one_dof_hole_delay(Bench& bench);     ///< Fig. 9.
void static_contact(Bench& bench);         ///< Fig. 14.
void tight_hole(Bench& bench);             ///< Fig. 16.
void stiff_hole(Bench& bench);             ///< Fig. 17.
void updates(Bench& bench);                ///< What adopting an update changes.
void stiffness_limits(Bench& bench);       ///< k_max of each method, side by side.
void stiffness_maps(Bench& bench);         ///< k_max over rates, delays, jitter, loss.
void approach_map(Bench& bench);           ///< Perceived wall and drift over approach speed.
void near_shapes(Bench& bench);            ///< The geometry near the hand in the server.
void ocean(Bench& bench);                  ///< What a hand perceives across an ocean.
void roams(Bench& bench);                  ///< A peg about the testbed's hole.
void hand_observer(Bench& bench);          ///< The hand measured, observed, unknown.
void spatial(Bench& bench);                ///< Six degrees of freedom.
void linkages(Bench& bench);               ///< Tools of several links.
void collisions(Bench& bench);             ///< Collisions and friction.
void bodies(Bench& bench);                 ///< Bodies that move when pushed.
void body_limits(Bench& bench);            ///< Where their forces are right.
void holding(Bench& bench);                ///< Bodies that hold each other.
void held(Bench& bench);                   ///< What the hand holds, against no delay.
void external(Bench& bench);               ///< Wrenches that no contact explains.
void two_tools(Bench& bench);              ///< Bodies that two tools hold.
void scenes(Bench& bench);                 ///< The scenes of scripts/run.

}  // namespace hlm::experiments
