// When impulses on bodies are applied: evenly, however their reports come.
#include "hlm/client/impulse_playout.h"

#include "tests/support/catch.h"

namespace hlm {
namespace {

constexpr double kFrame = 34;  // steps
constexpr int kTouch = 10;     // Frame from which the body is pushed,
constexpr double kForce = 3;   // N, steadily.

/// At the begin of a frame.
protocol::Impulses report(int frame) {
  protocol::Impulses impulses;
  impulses.step = static_cast<std::uint64_t>(frame * kFrame);
  const double pushed = static_cast<double>(impulses.step) - kTouch * kFrame;
  if (pushed > 0) impulses.bodies.push_back({7, Vector6::Unit(2) * kForce * 1e-3 * pushed});
  return impulses;
}

/// What a frame gives the body, N.
double force(ImpulsePlayout& playout) {
  double P = 0;
  for (const auto& [body, P_W] : playout.take(kFrame)) P += P_W[2];
  return P / (1e-3 * kFrame);
}

TEST_CASE("Reports that come just before a frame or just after it give the body the same force") {
  ImpulsePlayout playout;
  for (int frame = 1; frame < 200; ++frame) {
    // Of every three reports one is late: none in its frame, two in the next.
    if (frame % 3 != 0) playout.receive(report(frame));
    const double felt = force(playout);
    if (frame > 20) CHECK(felt == Approx(kForce).epsilon(0.002));
  }
}

TEST_CASE("The first impulse on a body is applied whole, whenever the report before it came") {
  ImpulsePlayout playout;
  for (int frame = 1; frame <= kTouch; ++frame) {
    playout.hear(report(frame).step);  // Nothing is touched, so nothing is reported.
    CHECK(force(playout) == 0);
  }
  playout.receive(report(kTouch + 1));
  CHECK(force(playout) == Approx(kForce));
}

TEST_CASE("Where reports stay away the bodies' time goes on, and what was due follows") {
  ImpulsePlayout playout;
  for (int frame = 1; frame <= 20; ++frame) {
    playout.receive(report(frame));
    force(playout);
  }
  const double before = playout.step();
  for (int frame = 21; frame < 24; ++frame) force(playout);
  CHECK(playout.step() == Approx(before + 3 * kFrame).epsilon(0.01));
  playout.receive(report(24));
  force(playout);
  // 24 frames were simulated, and the playout is a frame behind.
  CHECK(playout.taken(7)[2] == Approx(kForce * 1e-3 * (23 - kTouch) * kFrame).epsilon(0.02));
}

TEST_CASE(
    "A world that stood still gives its bodies nothing of that time, and no frame gets more") {
  ImpulsePlayout playout;
  for (int frame = 1; frame <= 20; ++frame) {
    playout.receive(report(frame));
    force(playout);
  }
  playout.skip();
  const double before = playout.step();
  int taken = 0;
  for (int frame = 30; frame < 40; ++frame) {
    playout.receive(report(frame));
    if (playout.reported() < kFrame) continue;
    CHECK(force(playout) == Approx(kForce).epsilon(0.03));
    ++taken;
  }
  CHECK(taken >= 9);
  // The server is told that the bodies have what it counts of the time that was left out.
  CHECK(playout.step() - before == Approx((taken + 10) * kFrame).epsilon(0.01));
  CHECK(playout.taken(7)[2] == Approx(kForce * 1e-3 * (playout.step() - kTouch * kFrame)));
}

}  // namespace
}  // namespace hlm
