// The server's state machine: each transition that its comment names, and no other.
#include "haptic_server/loop/server_state.h"

#include <iterator>
#include <utility>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

constexpr double kSilence = 0.1;  // s
constexpr double kStep = 1e-3;    // s

void pass(ServerStateMachine& machine, int ticks, bool faded = false) {
  for (int i = 0; i < ticks; ++i) machine.tick(faded);
}

/// Events that leave a fresh machine in this state; the client's goodbye apart.
ServerStateMachine in(ServerState state) {
  ServerStateMachine machine(kStep);
  if (state == ServerState::kIdle) return machine;
  machine.begin(kSilence);
  if (state == ServerState::kSilent) pass(machine, 300);
  if (state == ServerState::kFault) machine.fail(Fault::kOverrun);
  return machine;
}

struct Transition {
  const char* event;
  void (*happens)(ServerStateMachine&);
  ServerState from_idle;
  ServerState from_running;
  ServerState from_silent;
  ServerState from_fault;
};

constexpr auto kIdle = ServerState::kIdle;
constexpr auto kRunning = ServerState::kRunning;
constexpr auto kSilent = ServerState::kSilent;
constexpr auto kFault = ServerState::kFault;

const Transition kTransitions[] = {
    {"begin", [](ServerStateMachine& m) { m.begin(kSilence); }, kRunning, kRunning, kRunning,
     kRunning},
    {"update", [](ServerStateMachine& m) { m.update(kSilence); }, kIdle, kRunning, kRunning,
     kFault},
    {"end", [](ServerStateMachine& m) { m.end(); }, kIdle, kSilent, kSilent, kFault},
    {"end, faded",
     [](ServerStateMachine& m) {
       m.end();
       m.tick(true);
     },
     kIdle, kIdle, kIdle, kFault},
    {"fail", [](ServerStateMachine& m) { m.fail(Fault::kDevice); }, kFault, kFault, kFault, kFault},
    {"a tick", [](ServerStateMachine& m) { m.tick(false); }, kIdle, kRunning, kSilent, kFault},
    {"a tick, faded", [](ServerStateMachine& m) { m.tick(true); }, kIdle, kRunning, kSilent,
     kFault},
    {"silence", [](ServerStateMachine& m) { pass(m, 102, true); }, kIdle, kSilent, kSilent, kFault},
};

TEST_CASE("Each state answers each event as its comment says") {
  const Transition& t = GENERATE(from_range(std::begin(kTransitions), std::end(kTransitions)));
  INFO(t.event);
  for (const auto& [from, to] :
       {std::pair(kIdle, t.from_idle), std::pair(kRunning, t.from_running),
        std::pair(kSilent, t.from_silent), std::pair(kFault, t.from_fault)}) {
    INFO("from " << name_of(from));
    ServerStateMachine machine = in(from);
    REQUIRE(machine.state() == from);
    t.happens(machine);
    CHECK(name_of(machine.state()) == name_of(to));
    CHECK(machine.wants_force() == (to == kRunning));
    CHECK(machine.simulates() == (to == kRunning || to == kSilent));
    CHECK((machine.fault() == Fault::kNone) == (to != kFault));
  }
}

TEST_CASE("The first fault is the one that is kept, and a new session forgets it") {
  ServerStateMachine machine = in(kRunning);
  machine.fail(Fault::kNonFinite);
  machine.fail(Fault::kDevice);
  CHECK(machine.fault() == Fault::kNonFinite);
  machine.begin(kSilence);
  CHECK(machine.fault() == Fault::kNone);
}

TEST_CASE("Silence counts from the latest word: 0.1 s are endured, 0.11 s are silence") {
  ServerStateMachine machine = in(kRunning);
  pass(machine, 99);
  machine.update(kSilence);
  pass(machine, 99);
  machine.hear();
  pass(machine, 99);
  CHECK(machine.state() == kRunning);
  pass(machine, 11);
  CHECK(machine.state() == kSilent);
  machine.hear();
  CHECK(machine.state() == kSilent);  // force comes back with an update
}

TEST_CASE("A client that is heard but sends no whole update counts as silent after 0.25 s") {
  ServerStateMachine machine = in(kRunning);
  for (int i = 0; i < 249; ++i) {
    machine.hear();
    machine.tick(false);
  }
  CHECK(machine.state() == kRunning);
  machine.hear();
  pass(machine, 11);
  CHECK(machine.state() == kSilent);
}

TEST_CASE("Each update sets the silence that is endured from then on") {
  ServerStateMachine machine = in(kRunning);
  machine.update(0.2);
  pass(machine, 199);
  CHECK(machine.state() == kRunning);
  machine.update(0.05);
  pass(machine, 60);
  CHECK(machine.state() == kSilent);
}

TEST_CASE("After goodbye no update brings force back, and a new session does") {
  ServerStateMachine machine = in(kRunning);
  machine.end();
  machine.update(kSilence);
  CHECK(machine.state() == kSilent);
  machine.begin(kSilence);
  CHECK(machine.state() == kRunning);
  // The goodbye was of the session before: this one survives silence.
  pass(machine, 300, true);
  CHECK(machine.state() == kSilent);
  machine.update(kSilence);
  CHECK(machine.state() == kRunning);
}

TEST_CASE("A session that ends stays silent until its force has faded") {
  ServerStateMachine machine = in(kRunning);
  machine.end();
  pass(machine, 1000, false);
  CHECK(machine.state() == kSilent);
  machine.tick(true);
  CHECK(machine.state() == kIdle);
}

}  // namespace
}  // namespace hlm::server
