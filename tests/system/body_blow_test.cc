// A body of the scene that a hand pushes onto a fixed post, over a late network: in virtual time.
#include <algorithm>
#include <cmath>
#include <sstream>

#include "tests/support/catch.h"
#include "tests/support/virtual_session.h"

namespace hlm::test {
namespace {

constexpr double kMass = 0.3;  // kg, of the brick
constexpr double kPush = 3;    // N

/// A brick of 0.1 m on a table, pushed at its middle by a tool of 46 mm, and a post `gap` m behind
/// it.
VirtualSessionOptions brick_before_post(double gap, double delay, double rate, double stiffness) {
  std::ostringstream brick;
  brick
      << "<model name='brick'><pose>0.08 0 0.0255 0 0 0</pose><link name='body'><inertial><mass>"
      << kMass
      << "</mass><inertia><ixx>3.1e-4</ixx><iyy>3.1e-4</iyy><izz>5e-4</izz></inertia></inertial>"
      << "<collision name='box'><geometry><box><size>0.1 0.1 0.05</size></box></geometry><surface>"
         "<friction><ode><mu>0.4</mu></ode></friction></surface></collision></link></model>";
  VirtualSessionOptions options;
  options.world =
      world_of(fixed_model("table", "0 0 -0.05 0 0 0", box("2 2 0.1")) +
                   fixed_model("post", std::to_string(0.13 + gap + 0.02) + " 0 0.05 0 0 0",
                               box("0.04 0.04 0.1")) +
                   brick.str() +
                   model("tool", "0 0 0.03 0 0 0", box("0.046 0.046 0.02"),
                         "<haptic:tool_joint>planar</haptic:tool_joint>"),
               "0 0 -9.81");
  options.tool = "tool";
  options.device.dry_friction = 0;
  server::Push push;
  push.constant = force(kPush, 0);
  // The scene comes before the hand begins.
  options.hand = {{{0.5, server::Push{}}, {1.0, push}}, server::AfterLastSegment::kHold};
  options.servo.local_model.stiffness = stiffness;
  options.servo.silence_time = 2;
  options.link = {.delay = delay};
  options.rate_low = options.rate_high = rate;
  options.frame.shapes = true;
  return options;
}

TEST_CASE("A body pushed onto a post gives the blow of its momentum, at any gap and delay",
          "[optimised]") {
  const double gap = GENERATE(0.0, 0.002, 0.005, 0.01, 0.02);  // m
  const double delay = GENERATE(0.0, 0.02, 0.05, 0.1);         // s, each way
  const double rate = GENERATE(30.0, 60.0, 480.0);             // Hz
  const double stiffness = GENERATE(4e3, 16e3, 50e3);          // N/m
  CAPTURE(gap, delay, rate, stiffness);
  VirtualSession session(brick_before_post(gap, delay, rate, stiffness));
  double largest = 0;  // Force at the hand, N.
  double fastest = 0;  // Proxy, m/s.
  double impulse = 0;  // Largest of a tick, N·s.
  double before = 0;   // Momentum of tool and body at most, N·s.
  session.observe(0, [&](const server::TickRecord& record) {
    const double speed = record.V_WP.head<3>().norm();
    largest = std::max(largest, record.F_env.head<3>().norm());
    impulse = std::max(impulse, record.F_env.head<3>().norm() * 1e-3);
    fastest = std::max(fastest, speed);
    before = std::max(before, speed * (1 + kMass));
  });
  session.run(3);
  CAPTURE(largest, fastest, impulse, before);
  CHECK(session.last().fault == Fault::kNone);
  CHECK(fastest < 0.6);
  // The peak as a spring stops the two, of which the brick may be faster, and the push.
  CHECK(largest < 1.6 * fastest * std::sqrt(stiffness * (1 + kMass)) + kPush);
  CHECK(impulse <= 1.1 * before);
  // At rest between hand and post.
  CHECK(session.last().F_env.x() == Approx(-kPush).margin(0.05));
}

}  // namespace
}  // namespace hlm::test
