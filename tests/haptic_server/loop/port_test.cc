// The port to the device: what of a gripper's force gets through, and when (docs/method.md 13).
#include "hlm/haptic_server/loop/port.h"

#include "tests/haptic_server/loop/servo_bench.h"
#include "tests/support/catch.h"

namespace hlm::server {
namespace {

constexpr double kWanted = 5;  // N

/// A session on a device with a gripper of 8 N and 30 mm, half open.
struct Session {
  explicit Session(const ServoOptions& of = {}) : options(of) {
    device.rated.gripper = true;
    device.rated.max_gripper_force = 8;
    device.rated.gripper_travel = 0.03;
    port.emplace(options, device);
    port->begin(Pose{});
  }

  Fault tick(std::optional<double> opening) {
    TickRecord record;
    device.state->gripper = opening;
    port->clear();
    port->allow(true);
    const Fault fault = port->observe(*port->read(false, record), record);
    port->grip(kWanted);
    port->write(Wrench::UnitX(), Wrench::Zero(), Wrench::Zero(), *device.state, record);
    return fault;
  }
  void rise() {
    for (int i = 0; i < 2000; ++i) REQUIRE(tick(0.5) == Fault::kNone);
    REQUIRE(device.gripped == kWanted);
  }

  ServoOptions options;
  test::Journal journal;
  test::ScriptedDevice device{journal};
  std::optional<Port> port;
};

TEST_CASE("A gripper has its force while it is read, and what it gives in a stall counts") {
  Session session;
  session.rise();
  session.tick({});
  CHECK(session.device.gripped == 0);
  session.rise();
  session.port->cut();
  CHECK(session.device.gripped == 0);
  session.tick(0.5);
  CHECK(session.device.gripped < 0.1 * kWanted);
  session.rise();
  session.port->begin(Pose{});
  session.tick(0.5);
  CHECK(session.device.gripped < 0.1 * kWanted);

  ServoOptions options;
  options.limits.max_energy = 0.03;  // J, of which a stall gives 5 N * 15 mm
  Session small(options);
  small.rise();
  // Against what the handle's force did, which may not have been there.
  small.device.state->X_WD.p.x() -= 1e-3;
  small.port->halt();
  CHECK(small.tick(1) == Fault::kEnergy);
  CHECK(small.port->giver() == std::string("by its gripper"));
  small.port->settle();
  small.port->cut();
  CHECK(small.tick(1) == Fault::kNone);
}

}  // namespace
}  // namespace hlm::server
