// The client's frame, on a virtual clock and a network in memory.
#include "ve_client/frame.h"

#include <algorithm>
#include <bit>
#include <memory>

#include "protocol/server_session.h"
#include "tests/support/catch.h"
#include "tests/support/memory_link.h"
#include "tests/support/virtual_clock.h"
#include "tests/support/worlds.h"

namespace hlm::ve {
namespace {

TEST_CASE("Ε grows with speed and delay between its bounds") {
  FrameOptions options{.epsilon = 0.005};
  CHECK(adapted_epsilon(options, 10, 1, 1) == 0.005);  // fixed unless a largest one is given
  options.largest_epsilon = 0.08;
  CHECK(adapted_epsilon(options, 0.01, 0.04, 0.03) == 0.005);
  CHECK(adapted_epsilon(options, 0.2, 0.04, 0.03) > 0.2 * 0.07);  // m: what the tool travels
  CHECK(adapted_epsilon(options, 0.2, 0.04, 0.03) < 2 * 0.2 * 0.07);
  CHECK(adapted_epsilon(options, 10, 1, 1) == 0.08);
}

/// A server without a local model: its proxy moves at a constant velocity from where hello put it.
class ScriptedServer {
 public:
  ScriptedServer(protocol::DatagramLink& link, Velocity velocity, std::uint64_t session_id = 1)
      : session_(link, {.first_session_id = session_id}), velocity_(velocity) {}

  void tick(double now) {
    const protocol::ServerSession::Inbox inbox = session_.poll(now);
    if (inbox.hello) {
      hellos.push_back(*inbox.hello);
      session_.accept(now, {.servo_rate = 1000, .fingerprint = 0});
      began_ = now;
    }
    if (inbox.update) {
      updates.push_back(*inbox.update);
      session_.acknowledge(now, state(now));
    }
    if (inbox.goodbye) goodbye = true;
  }

  std::vector<protocol::Hello> hellos;
  std::vector<protocol::ContactUpdate> updates;
  std::optional<Configuration> forced_q;  ///< Sent instead of the proxy's configuration.
  bool goodbye = false;

 private:
  protocol::ProxyState state(double now) const {
    protocol::ProxyState state;
    state.server = ServerState::kRunning;
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
  explicit Setup(test::LinkConditions conditions = {}, std::uint64_t seed = 1,
                 Velocity velocity = Vector3(0, 0.1, 0))
      : network(conditions, seed),
        server(std::make_unique<ScriptedServer>(network.server(), velocity)),
        environment(test::repository_world("testbed.sdf"), "peg", {}),
        client(network.client(), {.server = test::MemoryNetwork::kServer,
                                  .tool = environment.assembly.description,
                                  .q = environment.assembly.q}),
        periods(30, 60, seed),
        clock([this](double now) {
          network.set_time(now);
          if (server) server->tick(now);
        }) {}

  FrameResult frame(const FrameOptions& options = {}) {
    const double period = periods.next();
    const double next = clock.now() + period;
    const FrameResult result = run_frame(environment, client, clock, period, options);
    clock.sleep_until(next);
    return result;
  }
  void run(double duration, const FrameOptions& options = {}) {
    const double end = clock.now() + duration;
    while (clock.now() < end) frame(options);
  }

  test::MemoryNetwork network;
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
  CHECK(setup.environment.tool.q().y() > 0.05);
  setup.run(1);
  CHECK(setup.environment.tool.q().y() == Approx(0.124).margin(2e-4));
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

TEST_CASE("A tool that approaches fast gets a wall from farther away") {
  const auto farthest = [](const FrameOptions& options) {
    Setup setup({.delay = 0.02}, 1, Vector3(0, 0.3, 0));
    setup.run(1, options);
    double separation = 0;
    for (const protocol::ContactUpdate& update : setup.server->updates) {
      for (const ReportedContact& contact : update.contacts) {
        separation = std::max(separation, contact.separation);
      }
    }
    return separation;
  };
  CHECK(farthest({.epsilon = 0.005}) <= 0.005);  // m
  // 0.3 m/s over 40 ms of round trip and a frame of 17 to 33 ms.
  CHECK(farthest({.epsilon = 0.005, .largest_epsilon = 0.08}) > 0.3 * (0.04 + 0.017));
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
    "Two runs with one seed are equal bit for bit, on a bad network too; other seeds differ") {
  const test::LinkConditions bad{.delay = 0.02, .jitter = 0.03, .loss = 0.1, .duplication = 0.05};
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

  const Configuration present = setup.environment.tool.q();
  CHECK(present.y() > 0.05);
  setup.server = std::make_unique<ScriptedServer>(setup.network.server(), Vector3(0, 0, 0), 99);
  setup.run(0.5);
  CHECK(setup.client.connected());
  REQUIRE_FALSE(setup.server->hellos.empty());
  CHECK((setup.server->hellos.back().q - present).norm() < 1e-9);
  CHECK((setup.environment.tool.q() - present).norm() < 1e-9);
}

TEST_CASE("A proxy state that cannot be followed is refused and the tool stays") {
  Setup setup({}, 1, Vector3(0, 0, 0));
  setup.run(0.5);
  setup.server->forced_q = Vector3(1e12, 0, 0);
  bool refused = false;
  for (int i = 0; i < 10; ++i) refused |= setup.frame().state_refused;
  CHECK(refused);
  CHECK(setup.environment.tool.q().norm() < 1e-9);
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
