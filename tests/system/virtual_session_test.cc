// Server tick and client frame together, in virtual time.
#include "tests/support/virtual_session.h"

#include <bit>
#include <cstdio>
#include <filesystem>
#include <limits>

#include "hlm/haptic_server/device/hand_script.h"
#include "hlm/tools/replay/offline_replay.h"
#include "hlm/tools/replay/recorded_session.h"
#include "tests/protocol/queue_link.h"
#include "tests/protocol/sample_messages.h"
#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"

namespace hlm::test {
namespace {

using server::TickRecord;

/// FNV-1a over the bits of what the tick computes.
class Hash {
 public:
  void add(const TickRecord& record) {
    for (const double x : record.X_WD.p) add(x);
    for (const double x : record.X_WP.p) add(x);
    for (const double x : record.X_WP.R.coeffs()) add(x);
    for (const double x : record.F_env) add(x);
    for (const double x : record.F_command) add(x);
    add(record.smallest_separation);
  }
  std::uint64_t value() const { return value_; }

 private:
  void add(double x) {
    auto bits = std::bit_cast<std::uint64_t>(x);
    for (int i = 0; i < 8; ++i, bits >>= 8) value_ = (value_ ^ (bits & 0xff)) * 0x100000001b3u;
  }

  std::uint64_t value_ = 0xcbf29ce484222325u;
};

VirtualSessionOptions demo() {
  VirtualSessionOptions options;
  options.hand = server::read_hand_script(std::string(HLM_WORLDS) + "/hands/session.toml");
  return options;
}

TEST_CASE("Pressed on the wall the peg rests: force as pushed, separation -f/k, drift < 0.1 mm") {
  VirtualSessionOptions options;
  options.device.dry_friction = 0;  // or it would carry part of the push
  options.hand = constant_push(force(0, 0.5));
  VirtualSession session(options);
  session.run(6);

  const TickRecord& at_rest = session.last();
  CHECK(at_rest.F_env[1] == Approx(-0.5).epsilon(0.02));      // N
  CHECK(at_rest.F_command[1] == Approx(-0.5).epsilon(0.02));  // N
  REQUIRE(at_rest.active_contacts == 2);
  // Two contacts share the push.
  CHECK(at_rest.smallest_separation == Approx(-0.5 / 2 / 4000).epsilon(0.02));  // m
  CHECK((at_rest.X_WD.p - at_rest.X_WP.p).norm() < 1e-4);                       // m
  CHECK(at_rest.X_WT.p.y() == Approx(0.124).margin(1e-4));                      // m
}

TEST_CASE("A client that dies under more force than the limit: the command fades, both ways") {
  VirtualSessionOptions options;
  options.servo.handle.workspace = 10;  // m: nothing holds the hand
  options.hand = constant_push(force(0, 14));
  double previous = 0;
  double largest_step = 0;
  bool watched = false;
  VirtualSession session(options, [&](const TickRecord& record) {
    const double command = record.F_command.head<3>().norm();
    if (watched) {
      largest_step = std::max(largest_step, std::abs(command - previous));
    }
    previous = command;
  });
  session.run(3);
  REQUIRE(session.last().F_command.head<3>().norm() == Approx(12).epsilon(1e-6));
  watched = true;
  session.run_server_alone(0.4);
  const double fade_step = 12 / 20.0;  // N: 12 N in the fade time of 0.02 s
  CHECK(largest_step <= fade_step + 1e-6);
  CHECK(session.last().F_command.norm() < 1e-9);
  largest_step = 0;
  session.run(0.1);
  CHECK(session.last().fault == Fault::kNone);
  CHECK(renders_force(session.last().server));
  const double rise_step = 12 / 100.0;  // N: 12 N in the rise time of 0.1 s
  CHECK(largest_step <= rise_step + 1e-6);
}

TEST_CASE("A coupling to the engine holds the wall too: force as pushed, depth f/K_c") {
  VirtualSessionOptions options;
  options.servo.controller = ControllerKind::kEngineCoupler;
  options.device.dry_friction = 0;
  options.hand = constant_push(force(0, 0.5));
  VirtualSession session(options);
  session.run(20);

  const TickRecord& at_rest = session.last();
  CHECK(at_rest.F_command[1] == Approx(-0.5).epsilon(0.02));                           // N
  CHECK(at_rest.X_WD.p.y() - at_rest.X_WT.p.y() == Approx(0.5 / 1500).epsilon(0.02));  // m
  CHECK(at_rest.X_WT.p.y() == Approx(0.124).margin(1e-4));                             // m
  CHECK(at_rest.active_contacts + at_rest.predicted_contacts == 0);
}

TEST_CASE("A control changes the physics of the running session, and lets go of it again") {
  VirtualSessionOptions options;
  options.device.dry_friction = 0;
  options.hand = constant_push(force(0, 0.5));
  options.link = {.delay = 0.01, .loss = 0.3};
  options.servo.silence_time = 2;
  VirtualSession session(options);
  session.run(4);
  protocol::Control control;
  control.tuned = true;
  control.tuning.stiffness = 8000;
  session.client().control(control);
  session.run(3);
  CHECK(session.last().smallest_separation == Approx(-0.5 / 2 / 8000).epsilon(0.02));  // m
  control.tuned = false;
  session.client().control(control);
  session.run(3);
  CHECK(session.last().smallest_separation == Approx(-0.5 / 2 / 4000).epsilon(0.02));
  CHECK(session.client().welcome().tuning.stiffness == 4000);
}

TEST_CASE("A control that leaves friction alone leaves static friction above kinetic friction") {
  VirtualSessionOptions options;
  options.device.dry_friction = 0;
  options.servo.local_model.static_friction = 0.6;
  options.servo.local_model.kinetic_friction = 0.3;
  options.frame.report_friction = {};
  // Against the wall, then along it with a force between what the two coefficients bear.
  server::Push along = {.constant = force(1.1, 3)};
  options.hand = constant_push(force(0, 3));
  options.hand.segments.front().duration = 2;
  options.hand.segments.push_back({1, along});
  VirtualSession session(options);
  session.run(4);
  const double x = session.last().X_WP.p.x();

  protocol::Control control;
  control.tuned = true;
  control.tuning = session.client().welcome().tuning;
  control.tuning.damping = 60;
  session.client().control(control);
  session.run(1);
  CHECK(std::abs(session.last().X_WP.p.x() - x) < 1e-4);  // m
  control.tuning.friction = 0.25;
  session.client().control(control);
  session.run(0.5);
  CHECK(session.last().X_WP.p.x() - x > 5e-3);  // m
}

TEST_CASE("A control holds the hand of the simulated device, and lets go") {
  VirtualSessionOptions options;
  VirtualSession session(options);
  session.run(0.5);
  REQUIRE(session.client().welcome().device.guidable);
  protocol::Control control;
  control.holds = true;
  control.X_WTarget.p = {0.05, -0.05, 0};
  session.client().control(control);
  session.run(3);
  // Dry friction of 0.2 N stops the grip of 200 N/m within 1 mm.
  CHECK((session.last().X_WD.p - control.X_WTarget.p).norm() < 1e-3);  // m
  control.holds = false;
  control.X_WTarget.p = {-0.1, 0, 0};
  session.client().control(control);
  session.run(1);
  CHECK((session.last().X_WD.p - Vector3(0.05, -0.05, 0)).norm() < 2e-3);
}

/// Keeps what telemetry brings.
struct Listener : protocol::TelemetryObserver {
  void observe(const protocol::Ticks& batch) override {
    for (const auto& tick : batch.ticks) ticks.push_back(tick);
    if (!first_step) first_step = batch.first_step;
    gaps += next_step != 0 && batch.first_step != next_step;
    next_step = batch.first_step + batch.ticks.size();
  }
  void observe(const protocol::LocalState& local) override { state = local; }

  std::vector<protocol::TickSignals> ticks;
  std::optional<std::uint64_t> first_step;
  std::uint64_t next_step = 0;
  int gaps = 0;
  protocol::LocalState state;
};

TEST_CASE("Telemetry brings every step once, and the contacts, to who asked, and only then") {
  Listener listener;
  VirtualSessionOptions options;
  options.hand = constant_push(force(0, 0.5));
  options.device.dry_friction = 0;
  options.telemetry = &listener;
  VirtualSession session(options);
  session.run(2);
  CHECK(listener.ticks.empty());
  protocol::Control control{.telemetry = true, .holds = false, .X_WTarget = {}, .tuned = false};
  session.client().control(control);
  session.run(3);
  CHECK(listener.ticks.size() > 2900);
  CHECK(listener.gaps == 0);
  CHECK(session.last().step - listener.next_step < 60);  // still under way
  CHECK(listener.ticks.back().F_env.y() == Approx(-0.5).epsilon(0.02));
  CHECK(listener.ticks.back().active_contacts == 2);
  REQUIRE(listener.state.contacts.size() >= 2);
  double sum = 0;
  for (const auto& contact : listener.state.contacts) sum += contact.f_W.y();
  CHECK(sum == Approx(-0.5).epsilon(0.02));  // N

  control.telemetry = false;
  session.client().control(control);
  session.run(0.2);
  const std::size_t heard = listener.ticks.size();
  session.run(0.5);
  CHECK(listener.ticks.size() == heard);
}

TEST_CASE("The demonstration ends with the peg in the hole, less than 1 mm of drift") {
  double largest_drift = 0;
  VirtualSession session(demo(), [&](const TickRecord& record) {
    const bool in_hole = record.X_WP.p.y() > 0.18;
    if (in_hole) {
      largest_drift = std::max(largest_drift, (record.X_WP.p - record.X_WT.p).norm());
    }
  });
  session.run(32);
  CHECK(session.last().X_WT.p.y() == Approx(0.184).margin(1e-3));  // m: on the hole's bottom
  CHECK(session.last().X_WT.p.x() == Approx(0.1).margin(1e-3));
  CHECK(largest_drift < 1e-3);  // m
  CHECK(session.session().statistics().total_dropped() == 0);
  CHECK(session.last().fault == Fault::kNone);
}

TEST_CASE("Two runs are equal bit for bit, and so are builds of any optimisation") {
  const auto hash = [] {
    VirtualSessionOptions options = demo();
    options.link = {.delay = 0.01, .jitter = 0.005, .loss = 0.05, .duplication = 0.05};
    Hash sum;
    VirtualSession session(options, [&](const TickRecord& record) { sum.add(record); });
    session.run(8);
    return sum.value();
  };
  const std::uint64_t first = hash();
  CHECK(first == hash());
  // One value for all builds on x86-64 with the libraries of Debian 12, optimised, instrumented or
  // not. A change of the method, the world or the hand changes it, and then it is set anew.
  CHECK(first == 0xf72a81b35053a7b4);
}

TEST_CASE("A lossy, late, disordered network costs drift, not stability") {
  VirtualSessionOptions options = demo();
  options.link = {
      .delay = 0.02, .jitter = 0.01, .loss = 0.2, .reordering = 0.1, .duplication = 0.1};
  double largest = 0;
  VirtualSession session(options, [&](const TickRecord& record) {
    largest = std::max(largest, record.F_env.head<3>().norm());
  });
  session.run(12);
  CHECK(largest <= 12 + 1e-9);                // N
  CHECK(session.last().X_WP.p.norm() < 0.3);  // m: within the enclosure
  CHECK(session.session().statistics().total_dropped() > 0);
}

TEST_CASE("When the client dies force fades to zero and comes back with it") {
  VirtualSessionOptions options;
  options.hand = constant_push(force(0, 0.5));
  VirtualSession session(options);
  session.run(4);
  REQUIRE(session.last().F_command.norm() > 0.2);  // N

  session.run_server_alone(0.25 + options.servo.limits.fade_time + 0.1);
  CHECK(session.last().server == ServerState::kFading);
  CHECK(session.last().F_command.norm() == 0);
  session.run_server_alone(1);
  CHECK(session.last().F_command.norm() == 0);

  session.run(1);
  CHECK(session.last().server == ServerState::kActive);
  CHECK(session.last().F_command.norm() > 0.2);
}

TEST_CASE("At 60 Hz force is gone 100 ms after the client's last word, whatever the limit takes") {
  VirtualSessionOptions options;
  options.rate_low = options.rate_high = 60;
  options.link = {};
  options.hand = constant_push(force(0, 14));
  double last_word = 0;
  double last_force = 0;
  VirtualSession session(options, [&](const TickRecord& record) {
    if (record.adopted != 0) last_word = record.time;
    if (record.F_command.head<3>().norm() >= 0.1) last_force = record.time;
  });
  session.run(3);
  REQUIRE(session.last().F_command.head<3>().norm() == Approx(12).epsilon(1e-6));  // N
  session.run_server_alone(0.4);
  CHECK(last_force > last_word + 0.06);
  CHECK(last_force < last_word + 0.1);  // s
}

TEST_CASE("At 60 Hz a loss of 5 % is no silence: in two minutes force never fades") {
  VirtualSessionOptions options;
  options.rate_low = options.rate_high = 60;
  options.link = {.delay = 0.01, .jitter = 0.005, .loss = 0.05};
  options.hand = constant_push(force(0, 2));
  int fading = 0;
  std::uint64_t adopted = 0;
  VirtualSession session(options, [&](const TickRecord& record) {
    if (record.time > 1 && record.server != ServerState::kActive) ++fading;
    if (record.adopted != 0) ++adopted;
  });
  session.run(120);
  CHECK(adopted == Approx(120 * 60 * 0.95).epsilon(0.02));
  CHECK(fading == 0);
}

TEST_CASE("Goodbye ends the session: force fades, then the device is off") {
  VirtualSessionOptions options;
  options.hand = constant_push(force(0, 0.5));
  VirtualSession session(options);
  session.run(4);
  session.client().close(session.now());
  session.run_server_alone(options.servo.limits.fade_time + 0.1);
  CHECK(session.last().server == ServerState::kOff);
  CHECK_FALSE(session.servo().local_model());
}

TEST_CASE("A gap in the loop beyond --max-gap is a fault: no force until a new session") {
  VirtualSessionOptions options;
  options.hand = constant_push(force(0, 0.5));
  VirtualSession session(options);
  session.run(4);
  server::Timing timing;
  timing.begin = timing.scheduled = session.now() + 0.4;
  timing.missed = 400;
  const TickRecord record = session.servo().tick(timing);
  CHECK(record.fault == Fault::kOverrun);
  CHECK(record.F_command.norm() == 0);
  session.run(0.5);
  CHECK(session.last().fault == Fault::kOverrun);
  CHECK(session.last().F_command.norm() == 0);
}

TEST_CASE("A tick allocates nothing: in free motion, in contact, adopting and answering") {
  VirtualSessionOptions options;
  options.hand = constant_push(force(0.2, 0.6));
  options.servo.local_model.max_hand_stiffness = 6000;
  VirtualSession session(options);
  session.run(0.5);
  session.client().control({.telemetry = true, .holds = false, .X_WTarget = {}, .tuned = true});
  session.run(0.2);
  server::Timing timing;
  std::size_t allocations = 0;
  for (int i = 0; i < 3000; ++i) {
    if (i % 20 == 0) session.run(0.02);
    timing.begin = timing.scheduled = session.now();
    const NoMalloc guard;
    session.servo().tick(timing);
    allocations += guard.allocations();
  }
  CHECK(session.last().active_contacts > 0);
  CHECK(allocations == 0);
}

TEST_CASE(
    "A tick allocates nothing that refuses a hello, in a fault or for its tool, or grants it") {
  QueueLink link;
  protocol::ServerSession session(link, {});
  server::SimulatedDevice device({}, {}, 1e-3);
  server::ServoOptions options;
  options.controller = ControllerKind::kDirect;
  const auto servo = std::make_unique<server::Servo>(options, 0, session, device);
  std::size_t allocations = 0;
  server::Timing timing;
  const auto tick_with = [&](protocol::Hello hello) {
    hello.nonce = ++timing.tick;
    timing.begin = timing.scheduled = static_cast<double>(timing.tick);  // s
    link.deliver(MemoryNetwork::kClient, {.sequence = hello.nonce}, hello);
    const NoMalloc guard;
    servo->tick(timing);
    allocations += guard.allocations();
  };
  protocol::Hello linkage = planar_hello();
  linkage.tool.links.push_back(linkage.tool.links[0]);
  linkage.tool.links[1].parent = 0;
  linkage.tool.links[1].joint = JointType::kRevolute;
  linkage.q = Eigen::Vector4d::Zero();
  tick_with(linkage);
  CHECK(link.last_sent<protocol::Reject>().reason == protocol::RejectReason::kTool);
  protocol::Hello heavy = planar_hello();
  heavy.tool.links[0].mass = 1e9;
  tick_with(heavy);
  CHECK(link.last_sent<protocol::Reject>().reason == protocol::RejectReason::kTool);
  servo->obey(Intervention::kStop);
  tick_with(planar_hello());
  CHECK(link.last_sent<protocol::Reject>().reason == protocol::RejectReason::kFault);
  protocol::Hello of_a_person = planar_hello();
  of_a_person.clears_fault = true;
  servo->obey(Intervention::kClear);
  tick_with(of_a_person);
  CHECK(session.active());
  CHECK(allocations == 0);
}

TEST_CASE("A recorded session comes back bit for bit on the local model") {
  VirtualSessionOptions options = demo();
  options.frame.shapes = GENERATE(false, true);
  options.link = {.delay = 0.01, .jitter = 0.01, .loss = 0.1};
  const std::filesystem::path capture =
      std::filesystem::temp_directory_path() / ("replay_test_" + std::to_string(::getpid()));
  {
    VirtualSession session(options);
    protocol::CaptureWriter writer(capture);
    for (int i = 0; i < 9; ++i) {
      // A person at the environment takes the hand and changes the physics meanwhile.
      protocol::Control control{
          .telemetry = i > 3, .holds = i == 5, .X_WTarget = {}, .tuned = i > 6};
      control.tuning.stiffness = 3000 + 100 * i;
      session.client().control(control);
      session.run(1);
      session.server_link().drain(writer);
    }
    REQUIRE(session.server_link().lost() == 0);
  }
  const std::vector<server::RecordedSession> recorded = server::read_sessions(capture);
  std::filesystem::remove(capture);
  REQUIRE(recorded.size() == 1);

  const auto replay = [&](const server::ServoOptions& servo) {
    server::SimulatedDevice device(options.device, options.hand, 1 / servo.rate);
    return server::replay_offline(recorded[0], servo, 0, device,
                                  [](const TickRecord&, const server::Servo&) {});
  };
  const server::OfflineResult same = replay(options.servo);
  CHECK(same.compared > 300);
  CHECK(same.equal == same.compared);

  server::ServoOptions softer = options.servo;
  softer.local_model.stiffness = 3999;
  CHECK(replay(softer).first_difference);
}

}  // namespace
}  // namespace hlm::test
