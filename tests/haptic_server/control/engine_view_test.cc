// What the environment's engine knew of the device when it sent its tool.
#include "hlm/haptic_server/control/engine_view.h"

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

Pose at(double x) {
  Pose X;
  X.p.x() = x;
  return X;
}

/// Acknowledges steps first to last, the device at 1 mm a step.
void acknowledge(EngineView& view, std::uint64_t first, std::uint64_t last) {
  for (std::uint64_t step = first; step <= last; ++step) {
    const double x = 0.001 * static_cast<double>(step);
    view.acknowledge(step, at(x), Twist::Constant(x));
  }
}

TEST_CASE("A session begins with tool and device at rest where the proxy is") {
  EngineView view;
  view.begin(at(0.2));
  CHECK(view.tool().X_WH.p.x() == 0.2);
  CHECK(view.device().X_WD.p.x() == 0.2);
  CHECK(view.tool().V_WH.norm() + view.device().V_WD.norm() == 0);
  CHECK_FALSE(view.device().F_hand);
}

TEST_CASE("An update shows its tool, and the device of the step that it echoes") {
  EngineView view;
  view.begin(at(0));
  acknowledge(view, 1, 100);
  view.update(90, {at(0.5), Twist::Constant(3)});
  CHECK(view.tool().X_WH.p.x() == 0.5);
  CHECK(view.tool().V_WH == Twist::Constant(3));
  CHECK(view.device().X_WD.p.x() == Approx(0.09));  // m
  CHECK(view.device().V_WD[0] == Approx(0.09));     // m/s
}

TEST_CASE("64 acknowledgements are remembered, an echo of an older one leaves the device") {
  EngineView view;
  view.begin(at(0));
  acknowledge(view, 1, 100);
  view.update(37, {});
  CHECK(view.device().X_WD.p.x() == Approx(0.037));
  view.update(36, {at(0.7), Twist::Zero()});
  CHECK(view.device().X_WD.p.x() == Approx(0.037));
  CHECK(view.tool().X_WH.p.x() == 0.7);
}

TEST_CASE("An update that echoes nothing leaves the device where the session began") {
  EngineView view;
  view.begin(at(0.2));
  view.update(0, {});
  CHECK(view.device().X_WD.p.x() == 0.2);
}

TEST_CASE("A new session remembers no step of the one before") {
  EngineView view;
  view.begin(at(0));
  acknowledge(view, 1, 10);
  view.begin(at(0.2));
  view.update(10, {});
  CHECK(view.device().X_WD.p.x() == 0.2);
}

}  // namespace
}  // namespace hlm::server
