#include "hlm/doctor/body_examination.h"

#include "hlm/protocol/codec.h"
#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;

/// With one body in its update, and so many states that doubt it.
RecordedSession session_with(BodyDoubt doubt, std::size_t doubting) {
  RecordedSession session;
  session.hello.tool.links.emplace_back();
  protocol::ContactUpdate update;
  update.q_VE = Configuration::Zero(7);
  update.q_VE[3] = 1;
  update.v_VE = Velocity::Zero(6);
  update.bodies.emplace_back().id = 5;
  RecordedUpdate& recorded = session.updates.emplace_back();
  recorded.sequence = 1;
  recorded.parts.push_back(protocol::encode({.session = 1, .sequence = 1}, update, 0));
  session.acknowledgements.resize(10);
  for (std::size_t i = 0; i < doubting; ++i) {
    session.acknowledgements[i].doubt = doubt;
    session.acknowledgements[i].doubted = 5;
  }
  return session;
}

}  // namespace

TEST_CASE("The doctor says what bodies did otherwise than their reports") {
  const Examination twice = examine_bodies(session_with(BodyDoubt::kTwice, 4));
  REQUIRE(twice.findings.size() == 1);
  CHECK(twice.findings[0].verdict == Verdict::kProblem);
  CHECK_THAT(twice.findings[0].text, ContainsSubstring("body 5: it gains twice"));
  CHECK_THAT(twice.findings[0].text, ContainsSubstring("4 of 10 states"));
  CHECK_THAT(twice.findings[0].advice, ContainsSubstring("apply the impulses once"));

  const Examination good = examine_bodies(session_with(BodyDoubt::kNone, 0));
  REQUIRE(good.findings.size() == 1);
  CHECK(good.findings[0].verdict == Verdict::kGood);

  RecordedSession without = session_with(BodyDoubt::kNone, 0);
  without.updates.clear();
  CHECK(examine_bodies(without).findings.at(0).verdict == Verdict::kNote);
}

}  // namespace hlm::server
