// How many steps an engine takes in a frame, so that its time is the hand's.
#include "hlm/client/world_time.h"

#include <algorithm>
#include <cmath>

#include "tests/support/catch.h"

namespace hlm {
namespace {

constexpr double kPeriod = 1.0 / 60;  // s, of the frames
constexpr double kStep = 0.002;       // s, of the engine
constexpr double kSilence = 4.5 * kPeriod;

/// A world whose frames begin at any time. The server answers those in which there are steps.
struct World {
  static constexpr double kStart = 10;     // s
  static constexpr double kAnswer = 1e-3;  // s: until one is here
  WorldTime time{kPeriod};
  double now = kStart;
  double engine = 0;  ///< Simulated, s.
  double sent = kStart;
  double reported = kStart;  ///< Until when it is known what the hand did.
  bool server_answers = true;

  /// Steps of a frame that begins so many seconds after the one before. cost: s of computing for a
  /// second of the world.
  int frame(double after, double cost = 0) {
    now += after;
    time.begin_frame(now, kSilence);
    if (server_answers && now - sent >= kAnswer) reported = sent;
    const int steps = time.take_steps(kStep, reported - kStart - engine + 2 * kPeriod);
    engine += steps * kStep;
    time.end_steps(now + cost * steps * kStep, steps * kStep);
    if (steps > 0) sent = now;
    return steps;
  }
  /// How far the engine is behind, s.
  double behind() const { return now - kStart - engine; }
};

TEST_CASE("An engine's time is the hand's at every rate of the user's loop") {
  for (const double rate : {25.0, 50.0, 60.0, 144.0, 500.0, 2000.0}) {
    CAPTURE(rate);
    World world;
    for (int frame = 0; frame < 500; ++frame) world.frame(1 / rate);
    const double before = world.behind();
    CHECK(std::abs(before) < 2 * std::max(kPeriod, 1 / rate));  // s
    for (int frame = 0; frame < 1000; ++frame) world.frame(1 / rate);
    CHECK(std::abs(world.behind() - before) < 1.01 * kStep);
  }
}

TEST_CASE("After frames in which nobody asked for steps the world goes on from where it was") {
  WorldTime time{kPeriod};
  double now = 0;
  for (int frame = 0; frame < 300; ++frame) time.begin_frame(now += kPeriod, kSilence);
  const double everything = 1e9;  // s: reported
  CHECK(time.take_steps(kStep, everything) * kStep <= kSilence + kStep);
}

TEST_CASE("Time that was missed is made up for when it is known what the hand did in it") {
  World world;
  for (int frame = 0; frame < 10; ++frame) world.frame(kPeriod);
  const double before = world.behind();
  CHECK(world.frame(0.055) * kStep <= 3 * kPeriod);
  CHECK(world.behind() > before + kPeriod / 2);  // s
  CHECK(world.frame(0.0005) == 0);               // The server has not answered yet.
  world.frame(0.001);
  CHECK(std::abs(world.behind() - before) < 1.01 * kStep);
}

TEST_CASE(
    "A report that is late is waited for, and where none come the engine's time goes on slowly") {
  World world;
  for (int frame = 0; frame < 10; ++frame) world.frame(kPeriod);
  const double before = world.behind();
  world.server_answers = false;
  int frames = 1;
  while (frames < 5 && world.frame(kPeriod) > 0) ++frames;
  CHECK(frames < 5);
  SECTION("late") {
    world.server_answers = true;
    world.frame(kPeriod);
    CHECK(std::abs(world.behind() - before) < 1.01 * kStep);  // s
  }
  SECTION("none") {
    const double engine = world.engine;
    for (int frame = 0; frame < 60; ++frame) world.frame(kPeriod);
    CHECK(world.engine - engine > 60 * kPeriod / 4);  // s
  }
}

TEST_CASE("A silence in which the server lets go of the bodies is not made up for") {
  World world;
  for (int frame = 0; frame < 10; ++frame) world.frame(kPeriod);
  const double before = world.behind();
  constexpr double kStall = 0.3;  // s
  world.frame(kStall);
  for (int frame = 0; frame < 10; ++frame) world.frame(kPeriod);
  CHECK(std::abs(world.behind() - before - (kStall - kPeriod)) < 1.01 * kStep);  // s
}

TEST_CASE("An engine that is slower than its world keeps its rate of frames") {
  World world;
  double after = kPeriod;
  int steps = 0;
  for (int frame = 0; frame < 100; ++frame) {
    constexpr double kCost = 2;
    steps = world.frame(after, kCost);
    after = std::max(kPeriod, kCost * steps * kStep);
  }
  CHECK(after <= 2.2 * kPeriod);  // s: it would grow to the silence time if it made up for all
  CHECK(steps > 0);
}

}  // namespace
}  // namespace hlm
