// What the audit says of a body, of reports that differ from what was expected in one way.
#include "hlm/local_model/body_audit.h"

#include <functional>

#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::server {
namespace {

constexpr double kFrame = 1.0 / 60;  // s
const Vector3 kGravity(0, 0, -9.81);

/// A body in the air that the tool pushes about, so long, s.
BodyAudit play(double time, const std::function<void(BodyEvidence&)>& change,
               std::uint32_t body = 7) {
  test::Random random;
  BodyAudit audit;
  for (double t = 0; t < time; t += kFrame) {
    BodyEvidence e;
    e.id = body;
    e.time = kFrame;
    e.A_W = e.gravity_W = kGravity;
    e.given_W = kFrame * random.vector(20);
    e.V_W = random.vector(0.3);
    e.change_W = e.given_W + kFrame * e.A_W;
    e.moved_W = kFrame * e.V_W;
    e.error_W = random.vector(0.1 * e.given_W.norm());
    change(e);
    audit.add(e);
  }
  return audit;
}

}  // namespace

TEST_CASE("Nothing is said of a body that does what its reports say, nor of a few blows") {
  CHECK(play(20, [](BodyEvidence&) {}).doubt(7) == BodyDoubt::kNone);
  int report = 0;
  const BodyAudit hit = play(20, [&](BodyEvidence& e) {
    if (++report % 40 == 0) e.error_W = Vector3(3, 0, 0);
  });
  CHECK(hit.doubt(7) == BodyDoubt::kNone);
  CHECK(hit.finding().doubt == BodyDoubt::kNone);
}

TEST_CASE("What a body does otherwise than its reports say is named") {
  const auto said = [](const std::function<void(BodyEvidence&)>& change) {
    return play(2, change).doubt(7);
  };
  const auto by_factor = [&](double factor) {
    return said([factor](BodyEvidence& e) {
      e.error_W += (factor - 1) * e.given_W;
      e.change_W += (factor - 1) * e.given_W;
    });
  };
  CHECK(by_factor(0) == BodyDoubt::kIgnored);
  CHECK(by_factor(-1) == BodyDoubt::kReversed);
  CHECK(by_factor(2) == BodyDoubt::kTwice);
  CHECK(by_factor(11) == BodyDoubt::kMass);
  CHECK(by_factor(0.5) == BodyDoubt::kMass);
  CHECK(said([](BodyEvidence& e) {
          e.V_W.setZero();
          e.change_W.setZero();
        }) == BodyDoubt::kVelocity);
  CHECK(said([](BodyEvidence& e) {
          e.A_W.setZero();
          e.error_W += kFrame * kGravity;
        }) == BodyDoubt::kGravity);
  CHECK(said([](BodyEvidence& e) {
          e.given_W.setZero();
          e.error_W = -kFrame * e.A_W;
          e.change_W.setZero();
        }) == BodyDoubt::kSupport);
}

TEST_CASE("What was wrong is forgotten, and the body that is wrong is the one that is named") {
  int report = 0;
  const auto twice_at_first = [&](BodyEvidence& e) {
    if (++report < 120) e.error_W += e.given_W;
  };
  CHECK(play(2, twice_at_first).doubt(7) == BodyDoubt::kTwice);
  report = 0;
  CHECK(play(20, twice_at_first).doubt(7) == BodyDoubt::kNone);

  BodyAudit audit;
  for (int i = 0; i < 100; ++i) {
    for (const std::uint32_t body : {3u, 4u}) {
      BodyEvidence e{.id = body, .time = kFrame};
      e.given_W = Vector3(0.2, 0, 0);
      if (body == 4) e.error_W = -e.given_W;
      audit.add(e);
    }
  }
  CHECK(audit.finding().body == 4);
  CHECK(audit.finding().doubt == BodyDoubt::kIgnored);
  CHECK(audit.doubt(3) == BodyDoubt::kNone);
}

TEST_CASE("A body that was away is another one, and one that is put elsewhere has one vote") {
  BodyAudit audit = play(2, [](BodyEvidence& e) { e.error_W += e.given_W; });
  REQUIRE(audit.doubt(7) == BodyDoubt::kTwice);
  audit.begin(0.3);
  CHECK(audit.doubt(7) == BodyDoubt::kTwice);
  audit.begin(0.3);
  CHECK(audit.doubt(7) == BodyDoubt::kNone);
  CHECK(audit.finding().doubt == BodyDoubt::kNone);

  int report = 0;
  const auto put_elsewhere = [&](BodyEvidence& e) {
    if (++report == 30) e.moved_W += Vector3(1, 0, 0);
  };
  CHECK(play(2, put_elsewhere).doubt(7) == BodyDoubt::kNone);
}

TEST_CASE("More bodies than there is room for, and reports without time, do no harm") {
  BodyAudit audit;
  for (std::uint32_t i = 0; i < 200; ++i) {
    audit.add({.id = i % 40, .time = i % 3 == 0 ? 0 : kFrame, .given_W = Vector3(1, 0, 0)});
  }
  CHECK(audit.finding().doubt == BodyDoubt::kNone);
}

}  // namespace hlm::server
