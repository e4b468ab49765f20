// Does the chain of force name the link that stops it?
#include "hlm/common/force_chain.h"

#include "tests/support/catch.h"

namespace hlm::protocol {
namespace {

using Catch::Matchers::ContainsSubstring;

/// A hand that presses on a wall with 2 N.
ForceFacts pressed() {
  ForceFacts facts;
  facts.session = true;
  facts.server = ServerState::kActive;
  facts.silence = 0.01;
  facts.update_rate = 60;
  facts.least_update_rate = 4;
  facts.age = 0.004;
  facts.F_hand = Vector3(0, 2, 0);
  facts.reported = 3;
  facts.epsilon = 0.005;
  facts.active = 2;
  facts.smallest_separation = -0.25e-3;
  facts.stiffness = 4000;
  facts.penalty = 2;
  facts.F_env = facts.F_command = Vector3(0, -2, 0);
  return facts;
}

void stops_at(const ForceFacts& facts, const std::string& link, const std::string& reason) {
  const ForceChain chain = force_chain(facts);
  const ChainLink* const stop = first_stop(chain);
  REQUIRE(stop != nullptr);
  CHECK(stop->name == link);
  CHECK_THAT(stop->reason, ContainsSubstring(reason));
}

TEST_CASE("A force that reaches the hand has no link that stops it") {
  const ForceChain chain = force_chain(pressed());
  CHECK(first_stop(chain) == nullptr);
  CHECK(chain[1].value == "60.0 Hz\nage 4 ms");
  CHECK(chain[5].value == "-0.25 mm");
}

TEST_CASE("Each break of the chain is named at its link") {
  ForceFacts f = pressed();
  SECTION("no session") {
    f = ForceFacts{};
    stops_at(f, "session", "no client has a session");
    f.refused = "haptic_server is busy";
    stops_at(f, "session", "haptic_server is busy");
  }
  SECTION("fault") {
    f.fault = Fault::kOverrun;
    stops_at(f, "session", "fault overrun: the loop stood still");
  }
  SECTION("dead client") {
    f.server = ServerState::kFading;
    f.silence = 3.2;
    stops_at(f, "updates", "for 3.20 s: it is dead");
  }
  SECTION("slow client") {
    f.update_rate = 2;
    stops_at(f, "updates", "only 2.00 updates a second");
  }
  SECTION("silent client, seen from the client") {
    f.server = ServerState::kFading;
    f.silence.reset();
    f.update_rate.reset();
    stops_at(f, "updates", "lets the force fade");
  }
  SECTION("old contacts") {
    f.age = 0.6;
    stops_at(f, "updates", "contacts are old");
  }
  SECTION("disabled device") {
    f.motors_off = true;
    stops_at(f, "device", "disabled");
  }
  SECTION("no hand") {
    f.F_hand = Vector3::Zero();
    f.F_env.setZero();
    stops_at(f, "hand", "no hand");
  }
  SECTION("far contacts") {
    f.smallest_separation = 3.2e-3;
    f.active = 0;
    stops_at(f, "separation", "nearest contact is 3.20 mm away");
    f.reported = 0;
    stops_at(f, "contacts", "farther than epsilon (5.00 mm)");
    f.epsilon = 0;
    stops_at(f, "contacts", "only touching contacts");
  }
  SECTION("no stiffness") {
    f.stiffness = 1;
    stops_at(f, "penalty", "only 1.00 N/m");
  }
  SECTION("forces that cancel") {
    f.F_env.setZero();
    stops_at(f, "F_env", "cancel out");
  }
  SECTION("fade") {
    f.limit = ForceLimit::kFade;
    stops_at(f, "limiter", "fades");
  }
  SECTION("limit") {
    f.limit = ForceLimit::kForce;
    stops_at(f, "limiter", "at its limit");
    f.F_command = Vector3(0, -0.01, 0);
    stops_at(f, "limiter", "lets nothing through");
  }
  SECTION("command") {
    f.F_command.setZero();
    stops_at(f, "command", "commands nothing");
  }
}

TEST_CASE("Where the engine alone makes the force, contacts have no part in it") {
  ForceFacts f = pressed();
  f.uses_contacts = false;
  f.reported = f.active = 0;
  const ForceChain chain = force_chain(f);
  CHECK(first_stop(chain) == nullptr);
  CHECK(chain[4].value == "–");
  f.F_env.setZero();
  stops_at(f, "F_env", "engine's tool");
}

TEST_CASE("A device that does not measure the hand does not miss it") {
  ForceFacts f = pressed();
  f.F_hand.reset();
  CHECK(first_stop(force_chain(f)) == nullptr);
}

}  // namespace
}  // namespace hlm::protocol
