// The tick: its order, its sessions, its faults, and what reaches proxy, device and client.
#include "hlm/haptic_server/loop/servo.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "hlm/haptic_server/scene/loader.h"
#include "tests/haptic_server/loop/servo_bench.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::server {
namespace {

using test::Journal;
using test::planar_wrench;
using test::ServoBench;
using test::wall_ahead;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// No spring ties proxy and device, and contacts have no friction.
ServoOptions untied() {
  ServoOptions options;
  options.gains = {.stiffness = 0, .damping = 0, .angular_stiffness = 0, .angular_damping = 0};
  options.local_model.static_friction = options.local_model.kinetic_friction = 0;
  options.silence_time = 10;
  return options;
}

/// A session in which the hand's 3 N are balanced by the coupling, so that the device feels them.
void begin_under_load(ServoBench& bench) {
  bench.device.state->F_hand = planar_wrench(3, 0, 0);
  bench.begin();
  bench.tick_with(bench.update());
  REQUIRE(bench.ticks(240).F_command.norm() == Approx(3).epsilon(0.1));  // N
}

protocol::Control holding(bool holds) {
  return {.telemetry = false, .holds = holds, .X_WTarget = {}, .tuned = false};
}

// The tick.

TEST_CASE("A tick receives, reads the device, commands it, and then acknowledges") {
  ServoBench bench;
  bench.begin();
  bench.tick_with(bench.update());
  CHECK(bench.journal == Journal{"receive update", "read", "write", "send state"});
  bench.tick();
  CHECK(bench.journal == Journal{"read", "write"});
}

TEST_CASE("The force of a contact is commanded in the tick that takes its update") {
  ServoOptions options = untied();
  options.local_model.update_rule = UpdateRule::kIntermediateRepresentation;
  ServoBench bench(options);
  bench.begin();
  bench.tick_with(bench.update());
  REQUIRE(bench.ticks(150).F_command.isZero(0));
  const TickRecord& record = bench.tick_with(bench.update({wall_ahead(-0.5e-3)}));  // m
  CHECK(record.F_env[0] == Approx(-2).epsilon(0.2));                                // N: 4 kN/m
  CHECK(bench.device.written[0] < -1);
}

TEST_CASE("Without a session a tick touches no device") {
  ServoBench bench;
  const TickRecord& record = bench.ticks(3);
  CHECK(bench.journal.empty());
  CHECK(record.server == ServerState::kOff);
  CHECK(record.step == 0);
  CHECK_FALSE(bench.servo->local_model());
}

TEST_CASE("Every step of a session counts, and its record says what was read and commanded") {
  ServoBench bench;
  bench.device.state->X_WD.p = {0.001, 0, 0};
  bench.device.state->F_hand = planar_wrench(0.5, 0, 0);
  CHECK(bench.begin().step == 1);
  const TickRecord& record = bench.ticks(150);
  CHECK(record.step == 151);
  CHECK(record.session == bench.session.id());
  CHECK(record.X_WD.p.x() == 0.001);
  CHECK(record.hand_measured);
  CHECK(record.F_hand == planar_wrench(0.5, 0, 0));
  CHECK(record.F_command == bench.device.written);
}

// Sessions.

TEST_CASE("A hello begins a session: device aligned to the tool's hand, enabled, client welcomed") {
  ServoOptions options;
  options.rate = 500;
  options.local_model.stiffness = 2500;
  ServoBench bench(options, /*configuration=*/77);
  ToolDescription tool = test::planar_tool();
  tool.X_LH.p = {0, 0.03, 0};
  bench.say_hello(tool, Vector3(0.1, -0.05, 0.3));
  const TickRecord& record = bench.tick();
  CHECK(bench.journal ==
        Journal{"receive hello", "align", "enable", "send welcome", "read", "write"});
  CHECK(record.server == ServerState::kArming);

  const Vector3 hand(0.1 - 0.03 * std::sin(0.3), -0.05 + 0.03 * std::cos(0.3), 0);  // m
  CHECK((bench.device.aligned_to.p - hand).norm() < 1e-12);
  CHECK(rotation_vector(bench.device.aligned_to.R).z() == Approx(0.3));  // rad
  const auto welcome = bench.last_sent<protocol::Welcome>();
  CHECK(welcome.servo_rate == 500);
  CHECK(welcome.fingerprint == 77);
  CHECK(welcome.tuning.stiffness == 2500);
  CHECK(welcome.device.guidable);
}

TEST_CASE("Where the tool moves and the device does not, the record and the welcome say so") {
  ServoBench planar({}, 0, {.freedoms = kPlanarFreedoms});
  CHECK(planar.begin(test::planar_tool()).missing_freedoms == 0);
  CHECK(planar.last_sent<protocol::Welcome>().device.freedoms == kPlanarFreedoms);
  const ToolDescription free = test::rigid_tool(1, Matrix3::Identity() * 2e-3, JointType::kFree);
  ServoBench spatial({}, 0, {.freedoms = kPlanarFreedoms});
  CHECK(spatial.begin(free).missing_freedoms == (kAllFreedoms & ~kPlanarFreedoms));
  CHECK(describe_mismatch(spatial.tick().missing_freedoms) ==
        "tool and device do not match: the tool also moves along z and about x, y, the device does "
        "not");
  ServoBench matching;
  CHECK(matching.begin(free).missing_freedoms == 0);
}

TEST_CASE("Buttons, gripper, scale and health of the device are reported") {
  ServoBench bench;
  bench.device.rated.scale = 2;
  bench.begin();
  bench.device.state->buttons = 0b101;
  bench.device.state->gripper = 0.25;
  bench.device.state->health = DeviceHealth::kSaturated;
  CHECK(bench.tick_with(bench.update()).health == DeviceHealth::kSaturated);
  const auto state = bench.last_sent<protocol::ProxyState>();
  CHECK(state.buttons == 0b101);
  CHECK(state.gripper == 0.25);
  CHECK(state.scale == 2);
}

TEST_CASE("The ledger of a scaled device counts the way of the handle, not that in the world") {
  ServoBench bench(ServoBench::patient(), 0, {.scale = 4});
  begin_under_load(bench);
  const double force = bench.device.written[0];
  const PortLedger before = bench.tick().port;
  bench.device.state->X_WD.p.x() += 1e-3;  // m, of which 0.25 mm at the handle
  const PortLedger after = bench.tick().port;
  const double work = (after.given - after.taken) - (before.given - before.taken);
  CHECK(work == Approx(force * 0.25e-3).epsilon(0.02));  // J
}

TEST_CASE("While the clutch is held force fades, and rises anew when it is let go") {
  ServoBench bench;
  begin_under_load(bench);
  const auto largest_change = [&bench](int count) {
    double largest = 0;
    for (int i = 0; i < count; ++i) {
      const double before = bench.device.written[0];
      bench.tick_with(bench.update());
      largest = std::max(largest, std::abs(bench.device.written[0] - before));
    }
    return largest;  // N, in one tick
  };
  bench.device.state->clutched = true;
  CHECK(largest_change(25) < 0.3);  // N: 3 N in 20 ms
  CHECK(bench.device.written.norm() == 0);
  bench.device.state->clutched = false;
  CHECK(largest_change(50) < 0.1);  // N: 3 N in 0.1 s
  CHECK(bench.tick_with(bench.update()).limit == ForceLimit::kFade);
  largest_change(60);
  CHECK(bench.tick_with(bench.update()).limit == ForceLimit::kNone);
  CHECK(std::abs(bench.device.written[0]) > 1);  // N
}

TEST_CASE("The cause that a device gives for its failure stays with the fault") {
  ServoBench bench;
  bench.begin();
  bench.device.why = "its cable is loose";
  bench.device.state.reset();
  CHECK(std::string(bench.tick_with(bench.update()).cause) == "its cable is loose");
  bench.device.why = "";
  CHECK(std::string(bench.tick().cause) == "its cable is loose");
  bench.clears_fault = false;
  bench.say_hello();
  bench.tick();
  const auto reject = bench.last_sent<protocol::Reject>();
  CHECK(std::string(reject.text.begin(), reject.text.end())
            .starts_with("fault: its cable is loose; "));
}

TEST_CASE("A device that fails otherwise in a later session gives that cause, not the one before") {
  ServoBench bench;
  bench.begin();
  bench.device.state->V_WD[0] = std::numeric_limits<double>::quiet_NaN();
  CHECK(std::string(bench.tick().cause) == "a number of its state is not finite");
  bench.servo->obey(Intervention::kClear);
  bench.device.state = DeviceState{};
  REQUIRE(bench.begin().server == ServerState::kArming);
  bench.device.why = "its cable is loose";
  bench.device.state.reset();
  CHECK(std::string(bench.tick().cause) == "its cable is loose");
}

TEST_CASE("A new hello begins again: steps from 1, the proxy where the hello says, no old force") {
  ServoBench bench;
  begin_under_load(bench);
  bench.device.state->X_WD.p = {0.01, 0, 0};
  const std::uint64_t first = bench.session.id();
  bench.say_hello(test::planar_tool(), Vector3(0.01, 0, 0));
  const TickRecord& record = bench.tick();
  CHECK(record.step == 1);
  CHECK(record.session != first);
  CHECK((record.X_WP.p - Vector3(0.01, 0, 0)).norm() < 1e-5);  // m
  CHECK(record.F_command.norm() < 0.1);                        // N: the 3 N fall by 3 N a step
  CHECK(bench.tick().F_command.norm() == 0);
}

TEST_CASE("No force before the first update, then it rises: 7.5 N begin with 0.075 N") {
  ServoBench bench;
  bench.device.state->X_WD.p = {0.005, 0, 0};  // 5 mm at 1500 N/m
  CHECK(bench.begin().F_command.norm() == 0);
  CHECK(bench.tick().F_command.norm() == 0);
  CHECK(bench.tick_with(bench.update()).F_command.norm() == Approx(0.075).epsilon(0.1));
  CHECK(bench.tick().server == ServerState::kRamping);
  CHECK(bench.ticks(100).server == ServerState::kActive);
}

TEST_CASE("While a world waits for its shapes there is no force, and the tool weighs nothing") {
  ServoBench bench{ServoOptions{}};
  ToolDescription tool = test::planar_tool();
  tool.gravity_W = {0, -9.81, 0};
  bench.begin(tool);
  CHECK(bench.ticks(200).fade == Fade::kClientSilent);
  protocol::ContactUpdate waiting = bench.update();
  waiting.ve_period = 0;
  for (int i = 0; i < 100; ++i) {
    CHECK(bench.tick_with(waiting).server == ServerState::kArming);
    CHECK(bench.ticks(5).F_command.norm() == 0);
    CHECK(bench.tick().fade == Fade::kNone);
  }
  CHECK(bench.servo->local_model()->velocity().norm() < 1e-12);
  CHECK(bench.tick_with(bench.update()).server == ServerState::kRamping);

  SECTION("Contacts of its own begin it, too") {
    ServoBench other;
    other.begin();
    protocol::ContactUpdate update = other.update({wall_ahead(0.020, 0, /*approach=*/0.1)});
    update.ve_period = 0;
    CHECK(other.tick_with(update).server == ServerState::kRamping);
  }
}

TEST_CASE("A controller in the proxy's place takes a rigid tool, and refuses a linkage by name") {
  ServoOptions options;
  options.controller = ControllerKind::kDirect;
  ServoBench bench(options);
  CHECK(bench.begin(test::planar_linkage()).server == ServerState::kOff);
  CHECK(bench.journal == Journal{"receive hello", "send reject"});
  const auto reject = bench.last_sent<protocol::Reject>();
  CHECK(std::string(reject.text.begin(), reject.text.end()) ==
        "this controller needs a tool of one link, without a curve; use another one");
  ToolDescription guided = test::planar_tool();
  guided.links[0].joint = JointType::kGuided;
  guided.links[0].lower = 0;
  guided.links[0].upper = 1;
  guided.curves.emplace_back().terms.col(0) << 0, 0, 0, 1, 0, 0, 0;
  guided.curves[0].terms(0, 1) = 0.1;
  CHECK(bench.begin(guided).server == ServerState::kOff);
  CHECK(bench.begin(test::planar_tool()).server == ServerState::kArming);
}

TEST_CASE("Goodbye: force fades, the proxy goes on meanwhile, then the device is off") {
  ServoBench bench;
  begin_under_load(bench);
  bench.send(protocol::Goodbye{});
  double previous = bench.device.written.norm();
  bench.tick();
  int fading = 0;
  while (bench.servo->local_model()) {
    CHECK(bench.device.enabled);
    CHECK(bench.device.written.norm() < previous);
    previous = bench.device.written.norm();
    bench.tick();
    REQUIRE(++fading < 150);
  }
  CHECK(fading == Approx(20).margin(2));  // ms
  CHECK(previous == 0);
  CHECK(bench.journal == Journal{"disable"});
  CHECK(bench.tick().server == ServerState::kOff);
  CHECK(bench.journal.empty());
}

TEST_CASE("Force rises anew when the device's enable switch closes") {
  ServoBench bench;
  begin_under_load(bench);
  bench.device.state->health = DeviceHealth::kForceOff;
  CHECK(bench.tick_with(bench.update()).F_command.isZero(0));
  CHECK(bench.ticks(20).F_command.isZero(0));
  bench.device.state->health = DeviceHealth::kGood;
  CHECK(bench.tick_with(bench.update()).F_command.norm() < 0.1);  // N
  CHECK(bench.ticks(200).F_command.norm() == Approx(3).epsilon(0.1));
}

TEST_CASE("Motors that get warm are health saturated, with that cause, and no fault") {
  ServoBench bench(ServoBench::patient(), 0, {.max_force = 12, .continuous_force = 1});
  begin_under_load(bench);
  CHECK(bench.tick().health == DeviceHealth::kGood);
  bench.device.state->warm = true;
  for (int i = 0; i < 12; ++i) {
    bench.tick_with(bench.update());
    bench.ticks(100);
  }
  const TickRecord& record = bench.tick();
  CHECK(record.F_command.norm() == Approx(1).epsilon(0.01));  // N
  CHECK(record.health == DeviceHealth::kSaturated);
  CHECK(std::string_view(record.cause).starts_with("motors get warm"));
  CHECK(record.fault == Fault::kNone);
}

TEST_CASE("A silent client: the session stays, and an update brings force back") {
  ServoBench bench;
  begin_under_load(bench);
  CHECK(bench.ticks(8).server == ServerState::kActive);
  CHECK(bench.ticks(4).server == ServerState::kFading);  // after 0.25 s
  CHECK(bench.ticks(105).F_command.norm() == 0);
  CHECK(bench.device.enabled);
  bench.tick_with(bench.update());
  const TickRecord& record = bench.ticks(120);
  CHECK(record.server == ServerState::kActive);
  CHECK(record.F_command.norm() == Approx(3).epsilon(0.1));  // N
}

TEST_CASE("Shutting down commands zero, disables the device and says goodbye, in this order") {
  ServoBench bench;
  begin_under_load(bench);
  bench.journal.clear();
  bench.servo->shut_down(1);
  CHECK(bench.journal == Journal{"write", "disable", "send goodbye"});
  CHECK(bench.device.written.norm() == 0);
  CHECK(bench.last_sent<protocol::Goodbye>().reason == protocol::GoodbyeReason::kShutdown);
  CHECK(bench.tick().server == ServerState::kOff);
  CHECK(bench.journal.empty());
}

// Faults.

struct Failure {
  const char* name;
  Fault fault;
  void (*cause)(ServoBench&);
};

const Failure kFailures[] = {
    {"the device cannot be read", Fault::kDevice, [](ServoBench& b) { b.device.state.reset(); }},
    {"the device takes no wrench", Fault::kDevice,
     [](ServoBench& b) { b.device.takes_wrenches = false; }},
    {"a position is not finite", Fault::kDevice,
     [](ServoBench& b) { b.device.state->X_WD.p.y() = kNaN; }},
    {"an orientation is not finite", Fault::kDevice,
     [](ServoBench& b) { b.device.state->X_WD.R.w() = kNaN; }},
    {"a velocity is not finite", Fault::kDevice,
     [](ServoBench& b) { b.device.state->V_WD[5] = kNaN; }},
    {"the hand's wrench is not finite", Fault::kDevice,
     [](ServoBench& b) { b.device.state->F_hand = planar_wrench(0, kNaN, 0); }},
    {"the handle is too fast", Fault::kHandleSpeed,
     [](ServoBench& b) { b.device.state->V_WD[0] = 5.1; }},
    {"the handle is too far away", Fault::kWorkspace,
     [](ServoBench& b) { b.device.state->X_WD.p.x() = 2.1; }},
};

TEST_CASE("A fault is no force, device off, in the same tick, until a session that may end it") {
  const Failure& failure = GENERATE(from_range(std::begin(kFailures), std::end(kFailures)));
  INFO(failure.name);
  ServoBench bench;
  begin_under_load(bench);
  const DeviceState healthy = *bench.device.state;
  failure.cause(bench);
  const TickRecord& record = bench.tick_with(bench.update());
  CHECK(record.server == ServerState::kFault);
  CHECK(record.fault == failure.fault);
  CHECK(record.F_command.norm() == 0);
  CHECK(bench.device.written.norm() == 0);
  CHECK_FALSE(bench.device.enabled);
  CHECK(record.X_WP.p.allFinite());

  // Later ticks leave the device alone, and the client learns in finite numbers.
  bench.device.state = healthy;
  bench.device.takes_wrenches = true;
  bench.tick_with(bench.update());
  CHECK(bench.journal == Journal{"receive update", "send state"});
  const auto state = bench.last_sent<protocol::ProxyState>();
  CHECK(state.server == ServerState::kFault);
  CHECK(state.fault == failure.fault);
  CHECK(state.F_command.norm() == 0);

  if (ends_at_device(failure.fault)) {
    CHECK(bench.begin().fault == failure.fault);
    bench.servo->obey(Intervention::kClear);
  }
  CHECK(bench.begin().server == ServerState::kArming);
  CHECK(bench.tick().fault == Fault::kNone);
  CHECK(bench.device.enabled);
}

TEST_CASE(
    "A fault of the loop outlives goodbyes, lost sessions and hellos: it ends at the device") {
  ServoBench bench;
  begin_under_load(bench);
  CHECK(bench.tick(251).fault == Fault::kOverrun);
  bench.clears_fault = false;
  CHECK(bench.begin().fault == Fault::kOverrun);
  const auto reject = bench.last_sent<protocol::Reject>();
  CHECK(reject.reason == protocol::RejectReason::kFault);
  CHECK(
      std::string(reject.text.begin(), reject.text.end()) ==
      "fault: the loop stood still for longer than allowed; give the server free cores, real-time "
      "rights or a lower rate, run haptic_doctor clear at the server, ask for a new session");
  CHECK(bench.ticks(3000).fault == Fault::kOverrun);
  CHECK_FALSE(bench.device.enabled);
  bench.clears_fault = true;
  CHECK(bench.begin().fault == Fault::kOverrun);
  bench.servo->obey(Intervention::kClear);
  CHECK(bench.begin().server == ServerState::kArming);
  CHECK(bench.device.enabled);
}

TEST_CASE("The silence that is endured follows the client's rate, within bounds, or the option") {
  const auto silence = [](const ServoOptions& options, double ve_rate) {
    ServoBench bench(options);
    bench.ve_rate = ve_rate;
    bench.begin();
    const auto welcome = bench.last_sent<protocol::Welcome>();
    bench.tick_with(bench.update());
    int ticks = 0;
    while (renders_force(bench.tick().server) && ticks < 20000) ++ticks;
    CHECK(1e-3 * ticks == Approx(welcome.silence_time).margin(2e-3));  // s
    return welcome.silence_time;
  };
  CHECK(silence({}, 60) == Approx(0.075));  // s
  CHECK(silence({}, 30) == Approx(0.15));
  CHECK(silence({}, 1000) == Approx(0.05));
  CHECK(silence({}, 1e-6) == Approx(0.25));
  ServoOptions options;
  options.silence_time = 2;
  CHECK(silence(options, 60) == 2);
}

TEST_CASE("Frames that are longer than the hello said are endured as long as they say") {
  ServoBench bench{ServoOptions{}};
  bench.begin();
  for (int i = 0; i < 20; ++i) {
    protocol::ContactUpdate slow = bench.update();
    slow.ve_period = 0.05;
    bench.tick_with(slow);
    CHECK(bench.ticks(190).server == ServerState::kActive);
  }
  CHECK(bench.ticks(70).server == ServerState::kFading);
}

TEST_CASE("A proxy that contacts carry away faster than a hand is a fault, before any force") {
  ServoBench bench;
  bench.begin();
  bench.ticks(150);
  const TickRecord* record = &bench.tick_with(bench.update({wall_ahead(0.001, 0, 900)}));
  for (int i = 0; i < 10 && record->fault == Fault::kNone; ++i) {
    CHECK(record->F_command.norm() <= 12);
    record = &bench.tick();
  }
  CHECK(record->fault == Fault::kImplausible);
  CHECK(bench.device.written.norm() == 0);
  CHECK_FALSE(bench.device.enabled);
}

TEST_CASE("A proxy that leaves all bounds is a fault, and the client learns it in finite numbers") {
  const auto [inertia, fault] =
      GENERATE(table<double, Fault>({{2e-3, Fault::kImplausible}, {1e-4, Fault::kNonFinite}}));
  ServoBench bench;
  bench.begin(test::rigid_tool(1, Matrix3::Identity() * inertia, JointType::kPlanar));
  bench.device.state->F_hand = planar_wrench(0, 0, 1.7e308);  // N·m
  const TickRecord* record = &bench.tick_with(bench.update());
  while (record->fault == Fault::kNone) {
    record = &bench.tick_with(bench.update());
    REQUIRE(record->step < 10);
  }
  CHECK(record->fault == fault);
  CHECK_FALSE(bench.device.enabled);
  CHECK(bench.last_sent<protocol::ProxyState>().fault == fault);
}

TEST_CASE("A contact wrench that is not finite is a fault, and no record has it") {
  ServoOptions options = untied();
  options.controller = ControllerKind::kDirect;
  options.local_model.update_rule = UpdateRule::kIntermediateRepresentation;
  options.local_model.stiffness = 1e308;  // N/m
  ServoBench bench(options);
  bench.begin();
  const TickRecord& record = bench.tick_with(bench.update({wall_ahead(-2)}));  // m
  CHECK(record.fault == Fault::kNonFinite);
  CHECK(record.F_env.allFinite());
  CHECK(bench.device.written.norm() == 0);
  CHECK_FALSE(bench.device.enabled);
  CHECK(bench.last_sent<protocol::ProxyState>().fault == Fault::kNonFinite);
}

TEST_CASE("A gap of 250 periods is endured, one of 251 is an overrun") {
  ServoBench bench;
  bench.begin();
  CHECK(bench.tick(250).server == ServerState::kArming);
  CHECK(bench.tick(251).fault == Fault::kOverrun);
  CHECK_FALSE(bench.device.enabled);
}

TEST_CASE("An operator's stop is a fault in any state, with a session or without one") {
  for (const bool in_session : {false, true}) {
    ServoBench bench;
    if (in_session) begin_under_load(bench);
    bench.servo->obey(Intervention::kStop);
    CHECK(bench.device.written.norm() == 0);
    CHECK_FALSE(bench.device.enabled);
    CHECK(bench.tick().fault == Fault::kOperatorStop);
    bench.clears_fault = false;
    CHECK(bench.begin().fault == Fault::kOperatorStop);
    bench.clears_fault = true;
    CHECK(bench.begin().fault == Fault::kOperatorStop);  // No packet ends it.
    bench.servo->obey(Intervention::kClear);
    bench.clears_fault = false;
    CHECK(bench.begin().fault == Fault::kOperatorStop);  // Nor does its client by itself.
    bench.clears_fault = true;
    CHECK(bench.begin().server == ServerState::kArming);
  }
}

TEST_CASE("After a halt by the guard the device is on again, and force rises from none") {
  ServoBench bench;
  begin_under_load(bench);
  bench.device.enabled = false;
  bench.servo->obey(Intervention::kHalted);
  const TickRecord& first = bench.tick_with(bench.update());
  CHECK(bench.device.enabled);
  CHECK(first.F_command.norm() < 0.1);  // N: of 3
  CHECK(first.fault == Fault::kNone);
  CHECK(bench.ticks(150).F_command.norm() == Approx(3).epsilon(0.1));
}

TEST_CASE("Without a guard force fades in 20 ms, comes back with it, and after 0.5 s is a fault") {
  ServoBench bench;
  begin_under_load(bench);
  const auto unguarded = [&](int count) {
    for (int i = 0; i < count; ++i) {
      bench.servo->obey(Intervention::kUnguarded);
      i % 100 == 0 ? bench.tick_with(bench.update()) : bench.tick();
    }
    return bench.device.written.norm();
  };
  CHECK(unguarded(21) == 0);
  for (int i = 0; i < 2; ++i) {
    bench.servo->obey(Intervention::kNone);
    bench.tick_with(bench.update());
    bench.ticks(120);
  }
  CHECK(bench.device.written.norm() == Approx(3).epsilon(0.1));  // N
  unguarded(495);
  CHECK(bench.device.enabled);
  unguarded(10);
  CHECK_FALSE(bench.device.enabled);
  CHECK(bench.begin().fault == Fault::kDevice);
  const auto reject = bench.last_sent<protocol::Reject>();
  CHECK(std::string(reject.text.begin(), reject.text.end()).find("guards its motors is gone") !=
        std::string::npos);
}

TEST_CASE("A stop after a fault that a client may end is a stop, and ends an earlier release") {
  ServoBench bench;
  bench.begin();
  bench.ticks(150);
  bench.tick_with(bench.update({wall_ahead(0.001, 0, 900)}));
  CHECK(bench.ticks(10).fault == Fault::kImplausible);
  bench.servo->obey(Intervention::kClear);
  bench.servo->obey(Intervention::kStop);
  CHECK(bench.begin().fault == Fault::kOperatorStop);
  bench.servo->obey(Intervention::kClear);
  bench.servo->obey(Intervention::kStop);
  CHECK(bench.begin().fault == Fault::kOperatorStop);
}

TEST_CASE("Refused updates are no word of the client, and the reason why force fades") {
  ServoBench bench{ServoOptions{}};
  bench.begin();
  bench.tick_with(bench.update());
  protocol::ContactUpdate wrong = bench.update();
  wrong.q_VE = Configuration::Zero(1);
  for (int i = 0; i < 10; ++i) bench.tick_with(wrong), bench.ticks(16);
  bench.tick_with(wrong);
  CHECK(bench.tick().server == ServerState::kFading);
  CHECK(bench.tick().fade == Fade::kUpdatesInvalid);
}

TEST_CASE(
    "Contacts that a network held for 0.8 s give no force, though half of that is their age") {
  ServoBench bench;
  const double way = GENERATE(0.002, 0.15);  // s
  const auto echo = [&](double age) {
    protocol::ContactUpdate update = bench.update();
    update.echo_step = bench.tick().step - static_cast<std::uint64_t>(age * 1e3);
    return bench.tick_with(update);
  };
  bench.begin();
  bench.ticks(1000);
  for (int i = 0; i < 10; ++i) echo(2 * way), bench.ticks(16);
  CHECK(renders_force(echo(2 * way).server));
  bench.ticks(800);
  const TickRecord held = echo(2 * way + 0.8);
  CHECK(held.fade == Fade::kContactsOld);
  CHECK_FALSE(renders_force(held.server));
  CHECK(renders_force(echo(2 * way).server));
}

TEST_CASE("Updates that answer no state give no force half a second after the session began") {
  ServoBench bench;
  bench.begin();
  protocol::ContactUpdate first = bench.update();
  first.echo_step = 0;
  CHECK(renders_force(bench.tick_with(first).server));
  bench.ticks(600);
  CHECK_FALSE(renders_force(bench.tick_with(first).server));
  protocol::ContactUpdate answer = bench.update();
  answer.echo_step = bench.tick().step;
  CHECK(renders_force(bench.tick_with(answer).server));
}

TEST_CASE("With a scene, poses that answer no state give force for two seconds of the session") {
  std::vector<std::uint8_t> records;
  protocol::SceneShape ball{.kind = protocol::SceneShapeKind::kSphere, .size = {0.1, 0, 0}};
  ball.hash = hash_of(ball);
  append(ball, records);
  append(protocol::ScenePlacement{.id = 1, .shape = ball.hash}, records);
  append(protocol::SceneCommit{1}, records);
  server::SceneLoader loader;
  ServoBench bench(ServoBench::patient(), 0, {}, &loader);
  bench.begin();
  REQUIRE(loader.take(std::as_bytes(std::span(records))));
  loader.work();
  protocol::ContactUpdate first = bench.update();
  first.echo_step = 0;
  first.scene = 1;
  bench.tick_with(first);
  CHECK(renders_force(bench.tick_with(first).server));
  bench.ticks(1500);  // Contacts would be too old after half a second.
  CHECK(renders_force(bench.tick_with(first).server));
  bench.ticks(600);
  CHECK_FALSE(renders_force(bench.tick_with(first).server));
}

TEST_CASE(
    "A body that appears at the tool is cut, and an overrun in it ends with the next session") {
  constexpr std::uint32_t kHeap = 7;
  std::vector<std::uint8_t> records;
  protocol::SceneShape box{.kind = protocol::SceneShapeKind::kBox, .size = {0.1, 0.1, 0.1}};
  box.hash = hash_of(box);
  append(box, records);
  test::Random random;
  for (std::uint32_t id = 1; id <= 80; ++id) {
    const ContactSide side = id % 2 == 0 ? ContactSide{SideKind::kMovableBody, kHeap}
                                         : ContactSide{SideKind::kToolLink, 0};
    append(
        protocol::ScenePlacement{
            .id = id, .shape = box.hash, .side = side, .X_BS = random.pose(0.03)},
        records);
  }
  append(protocol::SceneCommit{1}, records);
  server::SceneLoader loader;
  ServoBench bench(ServoBench::patient(), 0, {}, &loader);
  const auto with_heap_at = [&](double x) {
    protocol::ContactUpdate update = bench.update();
    update.scene = 1;
    update.poses.push_back({.body = kHeap, .X_WB = {{x, 0, 0}, Quaternion::Identity()}});
    return bench.tick_with(update);
  };
  bench.begin();
  for (auto left = std::as_bytes(std::span(records)); !left.empty();) {
    const auto chunk = left.first(std::min(left.size(), protocol::kChunkSize));
    REQUIRE(loader.take(chunk));
    left = left.subspan(chunk.size());
  }
  loader.work();
  with_heap_at(1);
  const TickRecord apart = with_heap_at(1);
  CHECK(apart.scene == 1);
  CHECK(apart.left_out == 0);
  const TickRecord cut = with_heap_at(0);
  CHECK(cut.left_out > 100);
  CHECK(cut.fault == Fault::kNone);
  bench.timing.previous_execution = 0.3;
  CHECK(bench.tick(251).fault == Fault::kImplausible);
  bench.timing.previous_execution = 0;
  CHECK(bench.begin().fault == Fault::kNone);
}

TEST_CASE("What a stalled server may have given counts, and what it took does not") {
  const bool gives = GENERATE(true, false);
  ServoBench bench;
  begin_under_load(bench);
  const PortLedger before = bench.tick().port;
  const Vector3 F = bench.device.written.head<3>();
  REQUIRE(F.norm() > 1);  // N
  bench.device.state->X_WD.p += (gives ? 0.01 : -0.01) * F.normalized();
  bench.servo->obey(Intervention::kHalted);
  const TickRecord after = bench.tick();
  CHECK(after.port.given - before.given == Approx(gives ? 0.01 * F.norm() : 0));  // J
  CHECK(after.port.taken == before.taken);
  CHECK(after.F_command.isZero(0));
}

// Controls.

TEST_CASE("A control takes effect with the next update, before it is adopted") {
  ServoBench bench;
  bench.begin();
  bench.send(holding(true));
  bench.tick();
  CHECK(bench.journal == Journal{"receive control", "read", "write"});
  bench.tick_with(bench.update());
  CHECK(bench.journal == Journal{"receive update", "hold the hand", "read", "write", "send state"});
  CHECK(bench.last_sent<protocol::ProxyState>().control == 1);
  bench.send(holding(false));
  bench.tick_with(bench.update());
  CHECK(bench.journal[2] == "let go of the hand");
}

TEST_CASE("A control puts the device in the place of a rigid proxy, never of a linkage") {
  const bool linkage = GENERATE(false, true);
  ServoBench bench;
  bench.begin(linkage ? test::planar_linkage() : test::planar_tool());
  bench.device.state->X_WD.p = {0.01, 0, 0};
  protocol::Control control = holding(false);
  control.tuned = true;
  control.tuning.controller = ControllerKind::kDirect;
  bench.send(control);
  const TickRecord& record = bench.tick_with(bench.update());
  CHECK(record.fault == Fault::kNone);
  // The spring of 1500 N/m moves 1 kg by 15 µm in 1 ms, direct control by all of 10 mm.
  CHECK(record.X_WP.p.x() == Approx(linkage ? 0 : 0.01).margin(1e-4));
}

TEST_CASE(
    "What a control asks of a late device is bounded as at the start, unless it is to be kept") {
  server::ServoOptions options = ServoBench::patient();
  options.keep_stiffness = GENERATE(false, true);
  const ControllerKind kind = GENERATE(ControllerKind::kVirtualCoupler, ControllerKind::kDirect);
  server::DeviceRatings late;
  late.mass = 0.5;     // kg
  late.damping = 5;    // N·s/m
  late.delay = 0.020;  // s
  ServoBench bench(options, 0, late);
  bench.begin();
  protocol::Control control = holding(false);
  control.tuned = true;
  control.tuning.controller = kind;
  control.tuning.stiffness = 4000;            // N/m
  control.tuning.damping = 0;                 // N·s/m
  control.tuning.coupling_stiffness = 20000;  // N/m
  control.tuning.coupling_damping = 0;
  bench.send(control);
  bench.device.state->X_WD.p.x() = 1e-3;  // m; the wall holds the proxy, if there is one.
  bench.tick_with(bench.update({wall_ahead(0)}));
  const double force = bench.ticks(150).F_command.norm();
  CAPTURE(name_of(kind), options.keep_stiffness);
  const double lowered = bench.last_sent<protocol::ProxyState>().lowered;
  if (options.keep_stiffness) {
    CHECK(force > 2);  // N
    CHECK(lowered == 0);
  } else {
    CHECK(lowered > 0.95);
    CHECK(force == Approx(0.5 * 5 / 0.0205 * 1e-3).epsilon(0.1));  // 70 % of b / lag, N/m
  }
}

// The age of contacts.

TEST_CASE("Contacts are as old as the client took to find them: their wall has come nearer") {
  ServoBench bench;
  bench.begin();
  bench.ticks(10);
  protocol::ContactUpdate update = bench.update({wall_ahead(0.020, 0, /*approach=*/0.1)});
  update.compute_time = 0.02;  // s
  const TickRecord& record = bench.tick_with(update);
  CHECK(record.age == Approx(0.02));  // s
  // 2 mm while the client computed.
  CHECK(record.smallest_separation == Approx(0.018).margin(1e-9));  // m
  CHECK(bench.last_sent<protocol::ProxyState>().age == Approx(0.02));
}

TEST_CASE("And half of the round trip older, without the time that the client held the echo") {
  ServoBench bench;
  bench.begin();
  bench.ticks(40);
  protocol::ContactUpdate update = bench.update({wall_ahead(0.020, 0, /*approach=*/0.1)});
  update.echo_step = 1;     // 40 ms ago
  update.echo_hold = 0.01;  // s
  const TickRecord& record = bench.tick_with(update);
  CHECK(record.age == Approx(0.015));                                // s
  CHECK(record.smallest_separation == Approx(0.0185).margin(1e-9));  // m
}

TEST_CASE("An echo of no step, of one to come or held too long counts as no travel") {
  ServoBench bench;
  bench.begin();
  bench.ticks(40);
  protocol::ContactUpdate update = bench.update();
  update.compute_time = 0.004;
  const auto [step, hold] = GENERATE(table<std::uint64_t, double>({{0, 0}, {42, 0}, {1, 0.5}}));
  update.echo_step = step;
  update.echo_hold = hold;
  CHECK(bench.tick_with(update).age == Approx(0.004));  // s
}

TEST_CASE("An age beyond a second comes from a broken clock: constraints go no further") {
  ServoBench bench;
  bench.begin();
  protocol::ContactUpdate update = bench.update();
  update.compute_time = 7;
  CHECK(bench.tick_with(update).age == 1);  // s
}

// What the hand feels of a collision.

struct Felt {
  double speed = 0;                  ///< Of the proxy before any force, m/s.
  double speed_after = 0;            ///< m/s.
  double force_momentum = 0;         ///< Commanded along x from the first force on, N·s.
  double torque_momentum = 0;        ///< About z, N·m·s.
  double largest_force = 0;          ///< Commanded, N.
  double largest_step = 0;           ///< Of the commanded force from tick to tick, N.
  static constexpr int kTicks = 30;  ///< After the collision; spreading ends within 25.
};

/// The hand pushes the proxy with 1 N into a wall 20 mm ahead, which it meets at height y.
Felt fly_into_wall(double y) {
  ServoBench bench(untied());
  bench.device.state->F_hand = planar_wrench(1, 0, 0);
  bench.begin();
  bench.tick_with(bench.update({wall_ahead(0.02, y)}));
  Felt felt;
  const TickRecord* record = &bench.tick();
  while (record->F_command.isZero(0)) {
    felt.speed = record->V_WP[0];
    record = &bench.tick();
    REQUIRE(record->step < 1000);
  }
  Wrench before = Wrench::Zero();
  for (int i = 0; i < Felt::kTicks; ++i) {
    if (i > 0) record = &bench.tick();
    felt.force_momentum += record->F_command[0] * 1e-3;
    felt.torque_momentum += record->F_command[5] * 1e-3;
    felt.largest_step = std::max(felt.largest_step, (record->F_command - before).head<3>().norm());
    before = record->F_command;
    felt.largest_force = std::max(felt.largest_force, record->F_command.head<3>().norm());
    felt.speed_after = record->V_WP[0];
  }
  return felt;
}

TEST_CASE("The momentum that a collision takes from the proxy reaches the hand, 12 N at most") {
  const Felt felt = fly_into_wall(0);
  // 1 N on 1 kg over 20 mm are 0.2 m/s; the contact takes a little before it closes.
  REQUIRE(felt.speed == Approx(0.2).epsilon(0.04));  // m/s
  // The proxy's 0.2 N·s, and what the hand pushed meanwhile.
  const double pushed = 1 * Felt::kTicks * 1e-3;  // N·s
  CHECK(felt.force_momentum == Approx(felt.speed_after - felt.speed - pushed).margin(1e-3));
  CHECK(felt.largest_force <= 12 + 1e-9);
  CHECK(felt.largest_step == Approx(3));  // N: 3 kN/s, also where the impulse ends
}

TEST_CASE("A collision off centre reaches the hand with its torque: lever times momentum") {
  const double lever = 0.03;  // m
  const Felt felt = fly_into_wall(lever);
  REQUIRE(felt.force_momentum < -0.1);                                                // N·s
  CHECK(felt.torque_momentum == Approx(-lever * felt.force_momentum).epsilon(0.03));  // N·m·s
}

}  // namespace
}  // namespace hlm::server
