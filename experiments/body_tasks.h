// Tasks in which the tool moves a body: worlds and hands.
#pragma once

#include "experiments/body_trial.h"

namespace hlm::experiments {

inline constexpr double kGravity = 9.81;  // m/s²

/// The hand begins so much later, s.
BodyTask later(BodyTask task, double wait);

/// A cube of 50 mm on two rails is lifted by a tray of 0.5 kg from below.
BodyTask lift(double mass);

struct Brick {
  double mass = 0.375;    ///< kg.
  double friction = 0.4;  ///< Of all, μ.
  double off_centre = 0;  ///< Of the tool, m.
  double stroke = 0.3;    ///< m.
  double duration = 4;    ///< Of the stroke, s.
};
/// A brick on a table is pushed sideways at 75 mm/s, or as fast as it asks.
BodyTask slide(const Brick& brick);
/// The brick is pushed with 3 N against a post.
BodyTask jam(const Brick& brick);
/// The hand rests with 2 N on a box that stands loose on a table.
BodyTask rest(double mass);
/// The hand rests with 2 N on a tower of three cubes.
BodyTask rest_on_tower(double mass);
/// A body of 0.3 kg floats freely; the hand throws the tool at it, off its centre, and lets go.
BodyTask hit(double off_centre);
/// The same with a ball of 15 mm radius.
BodyTask hit_with_ball(double off_centre);
/// A brick is pushed at up to 75 mm/s over the table's edge, which is at x = kTableEdge.
inline constexpr double kTableEdge = 0.1;  // m
BodyTask tip();
/// A door of 0.4 kg, 200 mm wide, its hinge at the origin, the leaf along x: the hand knocks
/// against it so far from the hinge (m), and lets go.
BodyTask knock(double from_hinge);
/// A firm hand pushes that door open at up to `speed` (m/s), and stops after kDoorStroke.
inline constexpr double kDoorStroke = 0.08;  // m
BodyTask open_door(double from_hinge, double speed);
/// A plate is lifted by the tray of lift(), with a load on it. Masses in kg; the load is watched.
BodyTask carry_on_plate(double plate, double load);
/// So many cubes of 0.3 kg on each other are lifted by the tray of lift(), carried and put down;
/// the highest is watched.
BodyTask carry_tower(int count);
/// The tray of lift() throws the cube up, and catches it.
BodyTask throw_up(double mass);
/// A brick pushes another.
BodyTask slide_two(double mass);
/// The hand rests with 2 N on so many cubes on each other, the masses, kg, going evenly (as their
/// logarithms do) from the lowest to the highest, which is watched.
BodyTask rest_on_cubes(int count, double lowest, double highest);
/// A wall of 60 kg swings on a spring, 0.2 m/s and 1 m/s^2 at most; the hand presses on it with 2
/// N.
BodyTask press_swinging_wall();
/// Moment of inertia of that door about its hinge, kg·m².
double door_inertia();

}  // namespace hlm::experiments
