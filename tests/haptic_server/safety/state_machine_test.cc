// The server's safety: each transition of its table, and no other; what fades and what latches.
#include "hlm/haptic_server/safety/state_machine.h"

#include <iterator>
#include <utility>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using enum ServerState;

constexpr double kSilence = 0.1;  // s
constexpr double kStep = 1e-3;    // s
constexpr double kFresh = 0.02;   // s, age of contacts
constexpr auto kNone = ForceLevel::kNone;
constexpr auto kSome = ForceLevel::kSome;
constexpr auto kFull = ForceLevel::kFull;

void pass(SafetyStateMachine& machine, int ticks, ForceLevel level = kSome) {
  for (int i = 0; i < ticks; ++i) machine.tick(level);
}

/// Events that leave a fresh machine in this state; the client's goodbye apart.
SafetyStateMachine in(ServerState state) {
  SafetyStateMachine machine(kStep);
  if (state == kOff) return machine;
  machine.begin(kSilence);
  if (state == kArming) return machine;
  machine.update(kSilence, kFresh);
  if (state == kActive) machine.tick(kFull);
  if (state == kFading) pass(machine, 300);
  if (state == kFault) machine.fail(Fault::kOverrun);
  return machine;
}

struct Claim {
  const char* event;
  void (*happens)(SafetyStateMachine&);
  ServerState from_off;
  ServerState from_arming;
  ServerState from_ramping;
  ServerState from_active;
  ServerState from_fading;
  ServerState from_fault;
};

// clang-format off
const Claim kClaims[] = {
    //                                                  off      arming   ramping  active   fading   fault
    {"a session", [](SafetyStateMachine& m) { m.begin(kSilence); },
                                                        kArming, kArming, kArming, kArming, kArming, kArming},
    {"an update", [](SafetyStateMachine& m) { m.update(kSilence, kFresh); },
                                                        kOff,    kRamping, kRamping, kActive, kRamping, kFault},
    {"old contacts", [](SafetyStateMachine& m) { m.update(kSilence, 0.51); },
                                                        kOff,    kArming, kFading, kFading, kFading, kFault},
    {"full force", [](SafetyStateMachine& m) { m.tick(kFull); },
                                                        kOff,    kArming, kActive, kActive, kFading, kFault},
    {"no force", [](SafetyStateMachine& m) { m.tick(kNone); },
                                                        kOff,    kArming, kRamping, kActive, kFading, kFault},
    {"silence", [](SafetyStateMachine& m) { pass(m, 102); },
                                                        kOff,    kArming, kFading, kFading, kFading, kFault},
    {"a goodbye", [](SafetyStateMachine& m) { m.end(); },
                                                        kOff,    kFading, kFading, kFading, kFading, kFault},
    {"a goodbye, and no force left", [](SafetyStateMachine& m) { m.end(); m.tick(kNone); },
                                                        kOff,    kOff,    kOff,    kOff,    kOff,    kFault},
    {"a fault", [](SafetyStateMachine& m) { m.fail(Fault::kDevice); },
                                                        kFault,  kFault,  kFault,  kFault,  kFault,  kFault},
};
// clang-format on

TEST_CASE("Each state answers each event as the table says") {
  const Claim& t = GENERATE(from_range(std::begin(kClaims), std::end(kClaims)));
  INFO(t.event);
  for (const auto& [from, to] :
       {std::pair(kOff, t.from_off), std::pair(kArming, t.from_arming),
        std::pair(kRamping, t.from_ramping), std::pair(kActive, t.from_active),
        std::pair(kFading, t.from_fading), std::pair(kFault, t.from_fault)}) {
    INFO("from " << name_of(from));
    SafetyStateMachine machine = in(from);
    REQUIRE(name_of(machine.state()) == name_of(from));
    t.happens(machine);
    CHECK(name_of(machine.state()) == name_of(to));
    CHECK(renders_force(machine.state()) == (to == kRamping || to == kActive));
    CHECK(machine.simulates() == (to != kOff && to != kFault));
    CHECK((machine.fault() != Fault::kNone) == (to == kFault));
    if (to == kFading) CHECK(machine.fade() != Fade::kNone);
    if (renders_force(to) || to == kOff) CHECK(machine.fade() == Fade::kNone);
  }
}

TEST_CASE("Every fault and every fade says what a person can do") {
  for (const auto& word : kWords<Fault>) {
    CHECK(word.remedy.empty() == (word.value == Fault::kNone));
  }
  for (const auto& word : kWords<Fade>) CHECK(word.remedy.empty() == (word.value == Fade::kNone));
}

TEST_CASE("The first fault is the one that is kept, and a new session forgets it") {
  SafetyStateMachine machine = in(kActive);
  machine.fail(Fault::kNonFinite);
  machine.fail(Fault::kImplausible);
  CHECK(machine.fault() == Fault::kNonFinite);
  machine.begin(kSilence);
  CHECK(machine.fault() == Fault::kNone);
}

TEST_CASE(
    "A fault that ends at the device needs its release, and a client's fault gives way to it") {
  SafetyStateMachine machine = in(kActive);
  machine.fail(Fault::kNonFinite);
  CHECK(machine.grants_session(true));
  CHECK_FALSE(machine.grants_session(false));
  machine.fail(Fault::kOperatorStop);
  CHECK(machine.fault() == Fault::kOperatorStop);
  CHECK_FALSE(machine.grants_session(true));
  machine.release();
  CHECK(machine.grants_session(true));
  CHECK_FALSE(machine.grants_session(false));
  machine.fail(Fault::kOperatorStop);
  CHECK_FALSE(machine.grants_session(true));
}

TEST_CASE("Silence counts from the latest word: 0.1 s are endured, 0.11 s are silence") {
  SafetyStateMachine machine = in(kActive);
  pass(machine, 98);
  machine.update(kSilence, kFresh);
  pass(machine, 99);
  machine.hear();
  pass(machine, 99);
  CHECK(machine.state() == kActive);
  pass(machine, 11);
  CHECK(machine.state() == kFading);
  CHECK(machine.fade() == Fade::kClientSilent);
  machine.hear();
  CHECK(machine.state() == kFading);  // force comes back with an update
}

TEST_CASE("Missed ticks count as silence too") {
  SafetyStateMachine machine = in(kActive);
  machine.tick(kFull, 98);
  CHECK(machine.state() == kActive);
  machine.tick(kFull, 10);
  CHECK(machine.state() == kFading);
}

TEST_CASE("A client that is heard but sends no whole update has old contacts after 0.25 s") {
  SafetyStateMachine machine = in(kActive);
  for (int i = 0; i < 248; ++i) {
    machine.hear();
    machine.tick(kSome);
  }
  CHECK(machine.state() == kActive);
  for (int i = 0; i < 4; ++i) {
    machine.hear();
    machine.tick(kSome);
  }
  CHECK(machine.state() == kFading);
  CHECK(machine.fade() == Fade::kContactsOld);
}

TEST_CASE("Contacts of 0.5 s are taken, older ones give no force until fresh ones come") {
  SafetyStateMachine machine = in(kActive);
  machine.update(kSilence, 0.5);
  CHECK(machine.state() == kActive);
  machine.update(kSilence, 0.51);
  CHECK(machine.state() == kFading);
  CHECK(machine.fade() == Fade::kContactsOld);
  machine.update(kSilence, kFresh);
  CHECK(machine.state() == kRamping);
}

TEST_CASE("Of a client whose updates are all refused force fades, and that is the reason") {
  SafetyStateMachine machine = in(kActive);
  for (int i = 0; i < 10; ++i) {
    machine.refuse();
    pass(machine, 17);
  }
  CHECK(machine.state() == kFading);
  CHECK(machine.fade() == Fade::kUpdatesInvalid);
}

TEST_CASE("Each update sets the silence that is endured from then on") {
  SafetyStateMachine machine = in(kActive);
  machine.update(0.2, kFresh);
  pass(machine, 199);
  CHECK(machine.state() == kActive);
  machine.update(0.05, kFresh);
  pass(machine, 60);
  CHECK(machine.state() == kFading);
}

TEST_CASE("After goodbye no update brings force back, and a new session does") {
  SafetyStateMachine machine = in(kActive);
  machine.end();
  machine.update(kSilence, kFresh);
  CHECK(machine.state() == kFading);
  CHECK(machine.fade() == Fade::kClientLeft);
  machine.begin(kSilence);
  machine.update(kSilence, kFresh);
  CHECK(machine.state() == kRamping);
  // The goodbye was of the session before: this one survives silence.
  pass(machine, 300, kNone);
  CHECK(machine.state() == kFading);
  machine.update(kSilence, kFresh);
  CHECK(machine.state() == kRamping);
}

TEST_CASE("A session that ends fades until no force is left") {
  SafetyStateMachine machine = in(kActive);
  machine.end();
  pass(machine, 1000, kSome);
  CHECK(machine.state() == kFading);
  machine.tick(kNone);
  CHECK(machine.state() == kOff);
}

}  // namespace
}  // namespace hlm::server
