// How fast and how far the handle may go.
#include "hlm/haptic_server/safety/handle_limits.h"

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

Twist twist(double v, double w) {
  Twist V = Twist::Zero();
  V[1] = v;
  V[5] = w;
  return V;
}

TEST_CASE("A quick hand is endured, what no hand does is a fault, in metres of the handle") {
  const HandleLimits limits;
  Pose far;
  far.p.z() = 2.1;  // m
  CHECK(limits.exceeded({}, {}, twist(2, 30), 1) == Fault::kNone);
  CHECK(limits.exceeded({}, {}, twist(5.1, 0), 1) == Fault::kHandleSpeed);
  CHECK(limits.exceeded({}, {}, twist(0, 101), 1) == Fault::kHandleSpeed);
  CHECK(limits.exceeded({}, far, twist(0, 0), 1) == Fault::kWorkspace);
  CHECK(limits.exceeded(far, far, twist(0, 0), 1) == Fault::kNone);
  CHECK(limits.exceeded({}, far, twist(5.1, 0), 2) == Fault::kNone);
  CHECK(limits.exceeded({}, {}, twist(0, 101), 1, 2) == Fault::kNone);
  CHECK(limits.exceeded({}, {}, twist(0, 51), 1, 0.5) == Fault::kHandleSpeed);
}

}  // namespace
}  // namespace hlm::server
