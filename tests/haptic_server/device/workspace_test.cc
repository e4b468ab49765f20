// A device's own space in the world: frame, scales, clutch, limits, and the energy that they keep.
#include "hlm/haptic_server/device/workspace.h"

#include <utility>

#include "hlm/haptic_server/device/simulated_device.h"
#include "hlm/haptic_server/safety/energy_tank.h"
#include "hlm/haptic_server/safety/force_budget.h"
#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"
#include "tests/support/random.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;

/// Stands where the test puts it.
class RawDevice final : public Device {
 public:
  std::string_view name() const noexcept override { return "raw device"; }
  const DeviceRatings& ratings() const noexcept override { return rated; }
  bool measures_hand_wrench() const noexcept override { return true; }
  void align(const Pose& X_WH) noexcept override { aligned_to = X_WH; }
  void enable() noexcept override {}
  void disable() noexcept override {}
  std::optional<DeviceState> read() noexcept override { return state; }
  bool write(const Wrench& F) noexcept override {
    written = F;
    return true;
  }

  DeviceRatings rated{.max_force = 10,
                      .max_torque = 0.4,
                      .max_stiffness = 4000,
                      .max_angular_stiffness = 2,
                      .mass = 0.3,
                      .inertia = 1e-3,
                      .damping = 2,
                      .buttons = 2};
  DeviceState state;
  Wrench written = Wrench::Zero();
  Pose aligned_to;
};

struct Bench {
  explicit Bench(const Workspace& workspace) {
    auto owned = std::make_unique<RawDevice>();
    raw = owned.get();
    device = std::make_unique<WorkspaceDevice>(std::move(owned), workspace);
  }

  RawDevice* raw;
  std::unique_ptr<WorkspaceDevice> device;
};

Wrench wrench(double fx, double fy, double fz, double tx, double ty, double tz) {
  return (Wrench() << fx, fy, fz, tx, ty, tz).finished();
}

Pose random_pose(test::Random& random, double reach, double angle) {
  return {random.vector(reach), rotation_from_vector(random.vector(angle))};
}

TEST_CASE("The handle's pose at align() is the one asked for, motions are relative to it") {
  Bench bench({.frame = "y z x", .scale = 2, .rotation_scale = 0.5});
  bench.raw->state.X_WD = {{0.3, -0.1, 0.2}, rotation_from_vector({0.4, 0, 0})};
  const Pose X_WH{{1, 2, 3}, rotation_from_vector({0, 0.7, 0})};
  bench.device->align(X_WH);
  CHECK(bench.device->read()->X_WD == X_WH);
  bench.raw->state.X_WD.p += Vector3(0.01, 0, 0);  // The device's x is the world's y.
  bench.raw->state.X_WD.R = rotation_from_vector({0, 0, 0.2}) * bench.raw->state.X_WD.R;
  bench.raw->state.V_WD << 0, 0, 1, 3, 0, 0;
  const DeviceState state = *bench.device->read();
  const Vector6 moved = displacement(X_WH, state.X_WD);
  CHECK((moved - wrench(0, 0.02, 0, 0.1, 0, 0)).norm() < 1e-15);    // m, rad
  CHECK((state.V_WD - wrench(2, 0, 0, 0, 1.5, 0)).norm() < 1e-15);  // m/s, rad/s
}

TEST_CASE("A force is the same at the handle, a torque r / s times as large") {
  Bench bench({.frame = "y z x", .scale = 4, .rotation_scale = 2});
  bench.device->write(wrench(0, 3, 0, 0.2, 0, 0));
  CHECK((bench.raw->written - wrench(3, 0, 0, 0, 0, 0.1)).norm() < 1e-15);
  bench.raw->state.F_hand = wrench(0, 0, 5, 0.1, 0, 0);
  CHECK((*bench.device->read()->F_hand - wrench(5, 0, 0, 0, 0.2, 0)).norm() < 1e-15);
}

TEST_CASE("The ledger at the handle is the raw device's own work, whatever frame and scales") {
  test::Random random;
  const auto [frame, s, r] = GENERATE(table<std::string, double, double>(
      {{"x y z", 1, 1}, {"-z x -y", 7, 1}, {"10 -40 120", 0.2, 3}, {"y z x", 30, 0.05}}));
  Bench bench({.frame = frame, .scale = s, .rotation_scale = r});
  EnergyTank tank({.capacity = 1e6}, bench.device->ratings().scale);
  double given = 0;
  double taken = 0;
  Wrench F = Wrench::Zero();
  Pose X_before = bench.raw->state.X_WD;
  bench.device->align(random_pose(random, 1, 1));
  for (int i = 0; i < 1000; ++i) {
    const double work = bench.raw->written.dot(displacement(X_before, bench.raw->state.X_WD));
    (work > 0 ? given : taken) += std::abs(work);
    tank.observe(bench.device->read()->X_WD, F, Wrench::Zero(), 0);
    for (double& component : F) component = random.uniform(-10, 10);
    bench.device->write(F);
    X_before = bench.raw->state.X_WD;
    bench.raw->state.X_WD = X_before * random_pose(random, 1e-3, 0.02);  // m, rad
  }
  CHECK(tank.ledger().given == Approx(given).epsilon(1e-9));  // J
  CHECK(tank.ledger().taken == Approx(taken).epsilon(1e-9));
}

TEST_CASE("Ratings are the world's: a handle's spring, mass and limits seen through the scales") {
  const double s = 4;
  const double r = 2;
  Bench bench({.scale = s, .rotation_scale = r});
  const DeviceRatings& handle = bench.raw->rated;
  const DeviceRatings& world = bench.device->ratings();
  CHECK(world.max_force == 10);            // N
  CHECK(world.max_torque == 0.4 * s / r);  // N·m
  // A spring in the world, felt at the handle: F = k s x there, τ = (r / s) κ r φ.
  CHECK(world.max_stiffness * s == Approx(handle.max_stiffness));
  CHECK(world.max_angular_stiffness * r * r / s == Approx(handle.max_angular_stiffness));
  // Kinetic energy and loss in the world are s times those of the handle.
  CHECK(world.mass * s * s == Approx(s * handle.mass));
  CHECK(world.inertia * r * r == Approx(s * handle.inertia));
  CHECK(world.damping * s * s == Approx(s * handle.damping));
  CHECK(world.scale == s);
  CHECK(world.rotation_scale == r);
}

TEST_CASE("The user's limits are those at the handle, whatever the scales") {
  const double s = 4;
  const double r = 0.5;
  Bench bench({.scale = s, .rotation_scale = r});
  const ForceBudget budget = ForceBudget::of({.max_torque = 0.3}, bench.device->ratings(), 1e-3);
  bench.device->write(wrench(0, 0, 0, 0, 0, budget.max_torque));
  CHECK(bench.raw->written[5] == Approx(0.3));  // N·m
}

TEST_CASE("Own limits lower the rating of force and torque, and never raise it") {
  CHECK(Bench({.max_force = 3, .max_torque = 0.1}).device->ratings().max_force == 3);
  CHECK(Bench({.max_force = 3, .max_torque = 0.1}).device->ratings().max_torque == 0.1);
  CHECK(Bench({.max_force = 50, .max_torque = 5}).device->ratings().max_force == 10);
  CHECK(Bench({.max_force = 50, .max_torque = 5}).device->ratings().max_torque == 0.4);
}

TEST_CASE("A planar device in a turned frame moves in the directions that it has there") {
  const auto in_world = [](const std::string& frame) {
    return ratings_in_world({.freedoms = kPlanarFreedoms}, {.frame = frame}).freedoms;
  };
  CHECK(in_world("x y z") == kPlanarFreedoms);
  CHECK(in_world("y z x") == 0b001110);  // along y and z, about x
  CHECK(in_world("0 0 30") == kPlanarFreedoms);
  CHECK(in_world("30 0 0") == 0b000001);  // along x alone
}

TEST_CASE("A frame that mirrors, or is none, is refused by name") {
  const auto error_of = [](const std::string& frame) {
    return find_error(Workspace{.frame = frame}).value_or("none");
  };
  CHECK(error_of("x y z") == "none");
  CHECK(error_of("-x +z y") == "none");
  CHECK(error_of("0 -12.5 90") == "none");
  CHECK(error_of("x y -z") ==
        "frame 'x y -z' must be right-handed: this one mirrors; turn one sign round");
  CHECK(error_of("x x z") == "frame 'x x z' must have each axis once");
  for (const char* frame : {"", "x y", "x y z z", "x 0 90", "0 0 900", "0 0 nan", "up y z"}) {
    INFO(frame);
    CHECK_THAT(error_of(frame), ContainsSubstring("three axes") && ContainsSubstring("degrees"));
  }
}

TEST_CASE("The clutch frees the handle once the device is without force, and not before") {
  Bench bench({.clutch = 2});
  bench.device->align(Pose{});
  bench.device->read();
  bench.device->write(wrench(1, 0, 0, 0, 0, 0));
  bench.raw->state.buttons = 0b10;
  bench.raw->state.X_WD.p.x() = 0.01;  // m, under force
  DeviceState state = *bench.device->read();
  CHECK(state.clutched);
  CHECK(state.X_WD.p.x() == 0.01);

  bench.device->write(Wrench::Zero());
  bench.raw->state.X_WD.p.x() = 0.05;
  bench.raw->state.V_WD[0] = 1;
  bench.raw->state.F_hand = wrench(2, 0, 0, 0, 0, 0);
  state = *bench.device->read();
  CHECK(state.X_WD.p.x() == 0.01);
  CHECK(state.V_WD.norm() == 0);
  CHECK(state.F_hand->norm() == 0);

  bench.raw->state.buttons = 0b01;
  bench.raw->state.X_WD.p.x() = 0.06;
  state = *bench.device->read();
  CHECK_FALSE(state.clutched);
  CHECK(state.X_WD.p.x() == Approx(0.02));
}

TEST_CASE("A person far away holds the handle in the world, whatever the frame") {
  const SimulatedDeviceOptions options{.freedom = DeviceFreedom::kSpatial};
  WorkspaceDevice device(std::make_unique<SimulatedDevice>(options, HandScript{}, 1e-3),
                         {.frame = "y z x", .scale = 3, .rotation_scale = 2});
  device.align(Pose{});
  const Pose target{{0.06, -0.03, 0.09}, rotation_from_vector({0, 0.3, 0})};
  for (int i = 0; i < 4000; ++i) {
    REQUIRE(device.read());
    device.guided_hand()->hold(target);
    device.write(Wrench::Zero());
  }
  // Dry friction of 0.2 N holds the handle within 1 mm, 3 mm in the world.
  const Vector6 rest = displacement(device.read()->X_WD, target);
  CHECK(rest.head<3>().norm() < 3e-3);
  CHECK(rest.tail<3>().norm() < 1e-3);
}

TEST_CASE("A tick of it allocates nothing") {
  Bench bench({.frame = "10 20 30", .scale = 2, .rotation_scale = 3, .clutch = 1});
  const test::NoMalloc guard;
  bench.device->align(Pose{});
  bench.device->read();
  bench.device->write(wrench(1, 2, 3, 0.1, 0.2, 0.3));
  CHECK(guard.allocations() == 0);
}

}  // namespace
}  // namespace hlm::server
