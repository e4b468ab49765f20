// The client's frame, on a virtual clock and a network in memory.
#include "hlm/ve_client/run/frame.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <fstream>
#include <memory>
#include <numbers>

#include "hlm/protocol/server_session.h"
#include "hlm/protocol/transport/memory_network.h"
#include "tests/protocol/transport/capture_files.h"
#include "tests/support/catch.h"
#include "tests/support/virtual_clock.h"
#include "tests/support/worlds.h"

namespace hlm::ve {
namespace {

/// A server without a local model: its proxy moves at a constant velocity from where hello put it.
class ScriptedServer {
 public:
  ScriptedServer(protocol::DatagramLink& link, Velocity velocity, std::uint64_t session_id = 1)
      : session_(link, {.first_session_id = session_id}), velocity_(velocity) {}

  void tick(double now) {
    const protocol::ServerSession::Inbox inbox = session_.poll(now);
    if (inbox.hello) {
      hellos.push_back(*inbox.hello);
      session_.accept(now, {.servo_rate = 1000,
                            .fingerprint = 0,
                            .capabilities = {.movable_bodies = movable_bodies}});
      began_ = now;
      impulses = {};
    }
    if (push) {
      if (impulses.bodies.empty()) impulses.bodies.push_back({pushed_body, Vector6::Zero()});
      impulses.bodies[0].P_W += *push * 0.001;
    }
    if (inbox.update) {
      updates.push_back(*inbox.update);
      session_.acknowledge(now, state(now));
      impulses.step = state(now).step;
      if (!impulses.bodies.empty()) session_.inform(now, impulses);
    }
    if (inbox.goodbye) goodbye = true;
  }

  std::vector<protocol::Hello> hellos;
  std::vector<protocol::ContactUpdate> updates;
  std::optional<Configuration> forced_q;  ///< Sent instead of the proxy's configuration.
  bool goodbye = false;
  bool movable_bodies = false;
  std::optional<Wrench> push;  ///< On a body.
  std::uint32_t pushed_body = 0;
  protocol::Impulses impulses;  ///< Of the session.

 private:
  protocol::ProxyState state(double now) const {
    protocol::ProxyState state;
    state.server = ServerState::kActive;
    state.step = static_cast<std::uint64_t>(1 + 1000 * (now - began_));
    const ToolModel model(hellos.back().tool);
    state.q = forced_q.value_or(model.integrate(hellos.back().q, velocity_, now - began_));
    state.v = velocity_;
    return state;
  }

  protocol::ServerSession session_;
  Velocity velocity_;
  double began_ = 0;
};

/// Client and server on one network, on the testbed.
struct Setup {
  explicit Setup(protocol::LinkConditions conditions = {}, std::uint64_t seed = 1,
                 Velocity velocity = Vector3(0, 0.1, 0),
                 const WorldDescription& world = test::repository_world("testbed.sdf"))
      : network(conditions, seed),
        server(std::make_unique<ScriptedServer>(network.server(), velocity)),
        environment(world, {"peg"}, {}),
        client(network.client(), {.server = protocol::MemoryNetwork::kServer,
                                  .tool = environment.tools.front().assembly.description,
                                  .q = environment.tools.front().assembly.q}),
        periods(30, 60, seed),
        clock([this](double now) {
          network.set_time(now);
          if (server) server->tick(now);
        }) {}

  FrameResult frame(const FrameOptions& options = {}) {
    const double period = periods.next();
    const double next = clock.now() + period;
    HapticClient* const of_tool = &client;
    const FrameResult result =
        run_frame(environment, {&of_tool, 1}, clock, period, options).front();
    clock.sleep_until(next);
    return result;
  }
  void run(double duration, const FrameOptions& options = {}) {
    const double end = clock.now() + duration;
    while (clock.now() < end) frame(options);
  }

  protocol::MemoryNetwork network;
  std::unique_ptr<ScriptedServer> server;
  VirtualEnvironment environment;
  HapticClient client;
  FramePeriods periods;
  test::VirtualClock clock;
};

TEST_CASE("The tool follows the proxy to the wall and stops there") {
  Setup setup;
  setup.run(1);
  CHECK(setup.client.connected());
  CHECK(setup.environment.tools.front().tool.q().y() > 0.05);
  setup.run(1);
  CHECK(setup.environment.tools.front().tool.q().y() == Approx(0.124).margin(2e-4));
}

TEST_CASE("A tool that an edge holds back goes where its proxy has pressed past the edge") {
  // The peg stands before the hole that fits it exactly, 2 mm beside it: a proxy may go in and
  // press on one wall, the engine's tool meets the edge.
  WorldDescription world = test::repository_world("testbed.sdf");
  const Quaternion upright(Eigen::AngleAxisd(std::numbers::pi / 2, Vector3::UnitZ()));
  world = with_model_at(world, "peg", {{0.102, 0.09, 0}, upright});
  Setup setup({}, 1, Vector3(0, 0.1, 0), world);
  setup.run(0.8);
  CHECK(setup.environment.tools.front().tool.q().y() > 0.16);  // m
}

TEST_CASE("It does not go through a wall after a proxy that has, however thin both are") {
  const std::string wall = GENERATE("0.0002", "0.001", "0.05");  // m
  const std::string tool = GENERATE("0.0002", "0.001", "0.01");
  const WorldDescription world =
      test::world_of(test::fixed_model("wall", "0 0 0 0 0 0", test::box("0.1 " + wall + " 0.1")) +
                     test::model("peg", "0 -0.08 0 0 0 0", test::box("0.1 " + tool + " 0.1"),
                                 "<haptic:tool_joint>planar</haptic:tool_joint>"));
  Setup setup({}, 1, Vector3(0, 0.1, 0), world);
  setup.run(2);
  CHECK(setup.environment.tools.front().tool.q().y() < 0);  // m
}

TEST_CASE("Nor through a plate that is turned in its mesh, be it a hull or a skin") {
  const bool is_hull = GENERATE(true, false);
  const test::TemporaryDirectory directory;
  const double turn = std::numbers::pi / 4;
  std::ofstream file(directory / "plate.obj");
  for (int i = 0; i < 8; ++i) {  // 0.6 m long, 10 mm thick
    const double x = i & 1 ? 0.3 : -0.3;
    const double y = i & 2 ? 0.005 : -0.005;
    file << "v " << std::cos(turn) * x - std::sin(turn) * y << ' '
         << std::sin(turn) * x + std::cos(turn) * y << ' ' << (i & 4 ? 0.05 : -0.05) << '\n';
  }
  file << "f 1 3 4 2\nf 5 6 8 7\nf 1 5 7 3\nf 2 4 8 6\nf 1 2 6 5\nf 3 7 8 4\n";
  if (!is_hull) file << "v 0 0 0\nv 0.001 0 0\nv 0 0.001 0\nf 9 10 11\n";
  file.close();
  const std::string mesh = "<collision name='plate'><geometry><mesh><uri>" +
                           (directory / "plate.obj").string() +
                           "</uri></mesh></geometry></collision>";
  const WorldDescription world =
      test::world_of(test::fixed_model("wall", "0 0 0 0 0 " + std::to_string(-turn), mesh) +
                     test::model("peg", "0 -0.08 0 0 0 0", test::box("0.04 0.04 0.04"),
                                 "<haptic:tool_joint>planar</haptic:tool_joint>"));
  Setup setup({}, 1, Vector3(0.05, 0.1, 0), world);
  setup.run(2);
  CHECK(setup.environment.tools.front().tool.q().y() < 0);  // m
}

TEST_CASE("Nor does a narrow one between two slabs that touch") {
  const WorldDescription world =
      test::world_of(test::fixed_model("left", "-0.05 0 0 0 0 0", test::box("0.1 0.05 0.1")) +
                     test::fixed_model("right", "0.05 0 0 0 0 0", test::box("0.1 0.05 0.1")) +
                     test::model("peg", "0 -0.08 0 0 0 0", test::box("0.004 0.02 0.1"),
                                 "<haptic:tool_joint>planar</haptic:tool_joint>"));
  Setup setup({}, 1, Vector3(0, 0.1, 0), world);
  setup.run(2);
  CHECK(setup.environment.tools.front().tool.q().y() < 0);  // m
}

TEST_CASE("Each update has the contacts of the very configuration that it carries") {
  Setup setup;
  setup.run(2);
  int with_contacts = 0;
  for (const protocol::ContactUpdate& update : setup.server->updates) {
    const double separation = 0.124 - update.q_VE.y();
    CHECK(update.contacts.size() == (separation <= 0.005 ? 2 : 0));
    for (const ReportedContact& contact : update.contacts) {
      CHECK(contact.separation == Approx(separation).margin(1e-6));
      ++with_contacts;
    }
  }
  CHECK(with_contacts > 10);
}

TEST_CASE("Without shapes a tool that approaches gets a wall from epsilon on") {
  const auto farthest = [](double epsilon) {
    Setup setup({.delay = 0.02}, 1, Vector3(0, 0.3, 0));
    setup.run(1, {.epsilon = epsilon});
    double separation = 0;
    for (const protocol::ContactUpdate& update : setup.server->updates) {
      for (const ReportedContact& contact : update.contacts) {
        separation = std::max(separation, contact.separation);
      }
    }
    return separation;
  };
  CHECK(farthest(0) <= 0);
  CHECK(farthest(0.005) <= 0.005);  // m
  CHECK(farthest(0.02) > 0.01);
}

TEST_CASE("An update tells simulated time, the step's length and the time since sampling") {
  Setup setup;
  setup.run(1, {.delay = 0.012});
  const auto& updates = setup.server->updates;
  REQUIRE(updates.size() > 20);
  double time = updates[0].ve_time;
  for (std::size_t i = 1; i < updates.size(); ++i) {
    CHECK(updates[i].ve_time - time == Approx(updates[i].ve_period).margin(1e-12));
    CHECK(updates[i].ve_period >= 1.0 / 60);
    CHECK(updates[i].ve_period <= 1.0 / 30);
    CHECK(updates[i].compute_time == Approx(0.012).margin(1e-9));
    time = updates[i].ve_time;
  }
}

/// All that the server received, bit for bit.
std::vector<std::uint64_t> trace(const ScriptedServer& server) {
  std::vector<std::uint64_t> bits;
  for (const protocol::ContactUpdate& update : server.updates) {
    for (const double q : update.q_VE) bits.push_back(std::bit_cast<std::uint64_t>(q));
    for (const double v : update.v_VE) bits.push_back(std::bit_cast<std::uint64_t>(v));
    for (const ReportedContact& contact : update.contacts) {
      bits.push_back(std::bit_cast<std::uint64_t>(contact.separation));
    }
  }
  return bits;
}

TEST_CASE(
    "Two runs with one seed are equal bit for bit, on a bad network too, other seeds differ") {
  const protocol::LinkConditions bad{
      .delay = 0.02, .jitter = 0.03, .loss = 0.1, .duplication = 0.05};
  const auto run = [&](std::uint64_t seed) {
    Setup setup(bad, seed);
    setup.run(3);
    return trace(*setup.server);
  };
  const std::vector<std::uint64_t> first = run(7);
  CHECK(first.size() > 300);
  CHECK(run(7) == first);
  CHECK(run(8) != first);
}

TEST_CASE("When the server falls silent the client goes on simulating and finds its successor") {
  Setup setup;
  setup.run(0.8);
  REQUIRE(setup.client.connected());
  setup.server.reset();
  const double before = setup.client.ve_time();
  setup.run(2);
  CHECK_FALSE(setup.client.connected());
  CHECK(setup.client.ve_time() > before + 1.9);

  const Configuration present = setup.environment.tools.front().tool.q();
  CHECK(present.y() > 0.05);
  setup.server = std::make_unique<ScriptedServer>(setup.network.server(), Vector3(0, 0, 0), 99);
  setup.run(0.5);
  CHECK(setup.client.connected());
  REQUIRE_FALSE(setup.server->hellos.empty());
  CHECK((setup.server->hellos.back().q - present).norm() < 1e-9);
  CHECK((setup.environment.tools.front().tool.q() - present).norm() < 1e-9);
}

TEST_CASE("A proxy state that cannot be followed is refused and the tool stays") {
  Setup setup({}, 1, Vector3(0, 0, 0));
  setup.run(0.5);
  setup.server->forced_q = Vector3(1e12, 0, 0);
  bool refused = false;
  for (int i = 0; i < 10; ++i) refused |= setup.frame().state_refused;
  CHECK(refused);
  CHECK(setup.environment.tools.front().tool.q().norm() < 1e-9);
}

/// A planar peg, and a brick of 1 kg and 1e-3 kg·m² whose near face is at y = 0.04; no weight.
const WorldDescription& peg_and_brick() {
  static const WorldDescription kWorld =
      test::world_of(test::model("peg", "0 0 0 0 0 0", test::box("0.04 0.04 0.04"),
                                 "<haptic:tool_joint>planar</haptic:tool_joint>") +
                     test::model("brick", "0 0.06 0 0 0 0", test::box("0.04 0.04 0.04")));
  return kWorld;
}
constexpr int kBrick = 1;

TEST_CASE("A body gains the impulses that the hand felt, exactly, whatever is lost on the way") {
  Setup setup({.delay = 0.01, .jitter = 0.02, .loss = 0.3, .duplication = 0.1}, 3, Vector3(0, 0, 0),
              peg_and_brick());
  setup.server->movable_bodies = true;
  setup.server->pushed_body = kBrick;
  for (const Wrench& F : {Wrench(0.3, -1, 0.2, 0, 0, 0.01), Wrench(2, 1, 0, 0, 0, -0.02),
                          Wrench(-0.1, 0, 5, 0, 0, 0.005)}) {
    setup.server->push = F;
    setup.run(0.3);
  }
  setup.server->push.reset();
  setup.network.set_conditions({});
  setup.run(0.3);
  REQUIRE(setup.client.connected());
  const Vector6& given = setup.server->impulses.bodies.at(0).P_W;
  CHECK(given.norm() > 1);  // N·s
  Vector6 gained = setup.environment.world.V_WB(kBrick);
  gained.tail<3>() *= 1e-3;
  CHECK((gained - given).norm() < 1e-9);
}

TEST_CASE("An update says which impulses its bodies contain") {
  Setup setup({.delay = 0.01, .loss = 0.2}, 1, Vector3(0, 0.01, 0), peg_and_brick());
  setup.server->movable_bodies = true;
  setup.server->pushed_body = kBrick;
  setup.server->push = Wrench(0, 0, 0, 0, 0, 0.02);  // Turns the brick.
  setup.run(3);
  double before = 0;
  int with_body = 0;
  for (const protocol::ContactUpdate& update : setup.server->updates) {
    CHECK(update.impulse_step >= before);
    before = update.impulse_step;
    if (update.bodies.empty()) continue;
    ++with_body;
    CHECK(update.bodies[0].id == kBrick);
    // 1e-3 kg·m².
    CHECK(1e-3 * update.bodies[0].V_W[5] == Approx(update.bodies[0].P_W[5]).margin(1e-9));
    // 0.02 N·m since step 1; where totals were lost they follow with the next.
    CHECK(update.bodies[0].P_W[5] <= 0.02e-3 * (update.impulse_step + 1));
    CHECK(update.bodies[0].P_W[5] >= 0.02e-3 * (update.impulse_step - 150));
  }
  CHECK(with_body > 10);
}

TEST_CASE("Totals begin anew with a session") {
  Setup setup({}, 1, Vector3(0, 0, 0), peg_and_brick());
  const auto push_for = [&](double duration) {
    setup.server->movable_bodies = true;
    setup.server->pushed_body = kBrick;
    setup.server->push = Wrench(1, 0, 0, 0, 0, 0);
    setup.run(duration);
    setup.server->push.reset();
    setup.run(0.2);
  };
  push_for(0.5);
  const double first = setup.server->impulses.bodies.at(0).P_W[0];
  setup.server = std::make_unique<ScriptedServer>(setup.network.server(), Vector3(0, 0, 0), 99);
  push_for(1.5);
  const double second = setup.server->impulses.bodies.at(0).P_W[0];
  CHECK(second > 0.3);
  CHECK(setup.environment.world.V_WB(kBrick)[0] == Approx(first + second).margin(1e-9));
}

TEST_CASE("The tool pushes a body by impulses alone where the server has them, else by following") {
  const bool movable = GENERATE(true, false);
  const bool by_following = GENERATE(true, false);
  CAPTURE(movable, by_following);
  Setup setup({}, 1, Vector3(0, 0.05, 0), peg_and_brick());
  setup.server->movable_bodies = movable;
  setup.run(1.5, {.push_by_following = by_following});
  CHECK(setup.environment.tools.front().tool.q().y() > 0.06);
  const auto& updates = setup.server->updates;
  const auto touched = std::find_if(updates.rbegin(), updates.rend(),
                                    [](const auto& each) { return !each.contacts.empty(); });
  REQUIRE(touched != updates.rend());
  const protocol::ContactUpdate& update = *touched;
  if (movable && !by_following) {
    CHECK(setup.environment.world.V_WB(kBrick).isZero(0));
    CHECK(update.bodies.size() == 1);
    CHECK(update.contacts[0].b == ContactSide{SideKind::kMovableBody, kBrick});
  } else {
    CHECK(setup.environment.world.X_WB(kBrick).p.y() > 0.07);
    CHECK(update.bodies.empty());
    CHECK(update.contacts[0].b == ContactSide{SideKind::kWorld, kBrick});
  }
}

TEST_CASE("Contacts carry the friction of the materials unless the server's is to hold") {
  const auto friction = [](bool report) {
    Setup setup;
    setup.run(2, {.report_friction = {report}});
    return setup.server->updates.back().contacts.at(0).friction;
  };
  CHECK(friction(true) == Approx(0.3));
  CHECK(friction(false) < 0);
}

TEST_CASE("A world that went wrong stands still, says why, and sends nothing any more") {
  Setup setup({}, 1, Vector3(0, 0, 0), peg_and_brick());
  setup.server->movable_bodies = true;
  setup.server->pushed_body = kBrick;
  setup.run(0.5);
  setup.server->push = Wrench(1e6, 0, 0, 0, 0, 0);
  const std::string* fault = nullptr;
  for (int i = 0; i < 10; ++i) fault = setup.frame().fault;
  REQUIRE(fault != nullptr);
  CHECK(fault->find("'brick::body'") != std::string::npos);
  const std::size_t updates = setup.server->updates.size();
  const Pose X_WB = setup.environment.world.X_WB(kBrick);
  for (int i = 0; i < 10; ++i) setup.frame();
  CHECK(setup.server->updates.size() == updates);
  CHECK(setup.environment.world.X_WB(kBrick) == X_WB);
}

TEST_CASE("Closing tells the server") {
  Setup setup;
  setup.run(0.5);
  setup.client.close(setup.clock.now());
  setup.clock.sleep_until(setup.clock.now() + 0.01);
  CHECK(setup.server->goodbye);
}

TEST_CASE("Drawn rates stay in their range, cover it, and a single rate is exact") {
  FramePeriods drawn(30, 60, 5);
  double low = 60;
  double high = 30;
  for (int i = 0; i < 1000; ++i) {
    const double rate = 1 / drawn.next();
    low = std::min(low, rate);
    high = std::max(high, rate);
  }
  CHECK(low >= 30);
  CHECK(low < 30.5);
  CHECK(high <= 60 + 1e-9);
  CHECK(high > 59.5);
  CHECK(FramePeriods(50, 50, 5).next() == 1.0 / 50);
}

}  // namespace
}  // namespace hlm::ve
