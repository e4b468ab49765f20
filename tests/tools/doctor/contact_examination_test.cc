#include "hlm/tools/doctor/contact_examination.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>

#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;
using protocol::ContactUpdate;

constexpr double kEpsilon = 0.005;  // m
constexpr double kPeriod = 1.0 / 60;
constexpr double kHalf = 0.02;  // m, of the tool's edges

ToolDescription box() {
  ToolDescription tool;
  tool.links.emplace_back();
  tool.length = 2 * kHalf;
  return tool;
}

/// A box that touches and leaves a floor at z = 0 while it slides and turns: what a good client
/// sends of it at `time`.
ContactUpdate good_update(double time) {
  const auto pose = [](double t) {
    const double turn = 0.5 * std::sin(0.7 * t);
    Configuration q(7);
    q << 0.1 * std::sin(2 * t), 0.05 * std::sin(3 * t), kHalf + 0.006 - 0.0065 * std::cos(4 * t),
        std::cos(turn / 2), 0, 0, std::sin(turn / 2);
    return q;
  };
  constexpr double kStep = 1e-6;
  ContactUpdate update;
  update.ve_time = time;
  update.q_VE = pose(time);
  update.v_VE = Velocity::Zero(6);
  update.v_VE.head<3>() = (pose(time + kStep) - pose(time - kStep)).head<3>() / (2 * kStep);
  update.v_VE[5] = 0.35 * std::cos(0.7 * time);
  ToolModel tool(box());
  tool.set_configuration(update.q_VE);
  for (std::uint64_t i = 0; i < 4; ++i) {
    const Vector3 corner(i % 2 ? kHalf : -kHalf, i / 2 ? kHalf : -kHalf, -kHalf);
    const Vector3 p_W = tool.X_WL(0) * corner;
    ReportedContact contact;
    contact.identity = 100 + i;
    contact.p_WC = {p_W.x(), p_W.y(), 0};
    contact.separation = p_W.z();
    if (contact.separation <= kEpsilon) update.contacts.push_back(contact);
  }
  return update;
}

/// The findings on ten seconds of a client that does something to each good update.
std::vector<Finding> findings_of(const std::function<void(ContactUpdate&)>& fault) {
  ContactAudit audit(box(), kEpsilon);
  for (int frame = 1; frame <= 600; ++frame) {
    ContactUpdate update = good_update(frame * kPeriod);
    fault(update);
    audit.add(update);
  }
  return findings_on(audit.counts(), kEpsilon);
}

/// The first thing to mend.
Finding first_of(const std::function<void(ContactUpdate&)>& fault) {
  const Finding first = findings_of(fault).front();
  CAPTURE(first.text);
  CHECK(first.verdict >= Verdict::kWarning);
  CHECK_FALSE(first.advice.empty());
  return first;
}

TEST_CASE("Contacts that change as the tool moves are found good") {
  const std::vector<Finding> findings = findings_of([](ContactUpdate&) {});
  REQUIRE(findings.size() == 1);
  CHECK(findings.front().verdict == Verdict::kGood);
  CHECK_THAT(findings.front().text, ContainsSubstring("change as the tool moves"));
}

TEST_CASE("A new identity in each update is named") {
  std::uint64_t next = 1;
  const Finding first = first_of([&](ContactUpdate& update) {
    for (ReportedContact& contact : update.contacts) contact.identity = next++;
  });
  CHECK_THAT(first.text, ContainsSubstring("go on under another identity"));
}

TEST_CASE("The index in a list as identity is named") {
  test::Random random;
  const Finding first = first_of([&](ContactUpdate& update) {
    std::shuffle(update.contacts.begin(), update.contacts.end(), random.engine());
    std::uint64_t index = 0;
    for (ReportedContact& contact : update.contacts) contact.identity = index++;
  });
  CHECK_THAT(first.text, ContainsSubstring("at another place an update before"));
}

TEST_CASE("The pair of geoms as identity is named") {
  const Finding first = first_of([](ContactUpdate& update) {
    for (ReportedContact& contact : update.contacts) contact.identity = 1;
  });
  CHECK_THAT(first.text, ContainsSubstring("share the identity of another one"));
}

TEST_CASE("Normals that point away from the tool are named") {
  const Finding first = first_of([](ContactUpdate& update) {
    for (ReportedContact& contact : update.contacts) contact.n_W *= -1;
  });
  CHECK(first.subject == "normal");
  CHECK_THAT(first.advice, ContainsSubstring("let normals point to the tool"));
}

TEST_CASE("Normals that turn round with the engine's order of bodies are named") {
  test::Random random;
  const Finding first = first_of([&](ContactUpdate& update) {
    for (ReportedContact& contact : update.contacts) {
      if (random.uniform(0, 1) < 0.5) contact.n_W *= -1;
    }
  });
  CHECK_THAT(first.text, ContainsSubstring("turned round"));
}

TEST_CASE("Millimetres are named") {
  const Finding first = first_of([](ContactUpdate& update) {
    for (ReportedContact& contact : update.contacts) {
      contact.p_WC += Vector3(0, 0, 0.1);
      contact.p_WC *= 1000;
      contact.separation *= 1000;
    }
  });
  CHECK(first.subject == "units");
}

TEST_CASE("A client that sends touching contacts alone is named") {
  const Finding first = first_of([](ContactUpdate& update) {
    erase_if(update.contacts, [](const ReportedContact& c) { return c.separation > 0; });
  });
  CHECK_THAT(first.text, ContainsSubstring("nothing is sent before it touches"));
}

TEST_CASE("A separation that the engine's margin is taken from is named") {
  const Finding first = first_of([](ContactUpdate& update) {
    for (ReportedContact& contact : update.contacts) contact.separation -= 0.003;
  });
  CHECK_THAT(first.text, ContainsSubstring("first seen later than epsilon"));
}

TEST_CASE("Corners that come and go are named") {
  test::Random random;
  const Finding first = first_of([&](ContactUpdate& update) {
    erase_if(update.contacts, [&](const ReportedContact&) { return random.uniform(0, 1) < 0.3; });
  });
  CHECK(first.subject == "missing");
}

TEST_CASE("Separations that are not those of the sampled pose are named") {
  test::Random random;
  const Finding first = first_of([&](ContactUpdate& update) {
    for (ReportedContact& contact : update.contacts)
      contact.separation += random.uniform(-1, 1) * 0.003;
  });
  CHECK(first.subject == "separation");
}

TEST_CASE("Contacts of some updates before, and contacts that stand still, are named") {
  const int late = GENERATE(1, 3, 5);
  std::vector<ReportedContacts> sent;
  const Finding stale = first_of([&](ContactUpdate& update) {
    sent.push_back(update.contacts);
    if (sent.size() > static_cast<std::size_t>(late)) {
      update.contacts = sent[sent.size() - 1 - static_cast<std::size_t>(late)];
    }
  });
  CHECK(stale.subject == "age");
  CHECK_THAT(stale.text, ContainsSubstring("moved " + std::to_string(late) + " updates before"));

  int frame = 0;
  ReportedContacts kept;
  const Finding frozen = first_of([&](ContactUpdate& update) {
    if (frame++ % 10 == 0) kept = update.contacts;
    update.contacts = kept;
  });
  CHECK(frozen.subject == "age");
  CHECK_THAT(frozen.text, ContainsSubstring("sent again as they were"));
}

TEST_CASE("Normals that are some degrees off are named") {
  for (const Vector3& axis : {Vector3(1, 0, 0), Vector3(0.6, -0.8, 0)}) {
    const Finding first = first_of([&](ContactUpdate& update) {
      const auto R = rotation_from_vector(6 * std::numbers::pi / 180 * axis);
      for (ReportedContact& contact : update.contacts) contact.n_W = R * contact.n_W;
    });
    CHECK(first.subject == "normal");
    CHECK_THAT(first.text, ContainsSubstring("6 degrees off"));
  }
}

TEST_CASE("A body that is hit between two updates moves as its velocities say") {
  const auto findings = findings_of([](ContactUpdate& update) {
    constexpr double kTurn = 0.027;  // s: between two blows
    constexpr double kSpeed = 0.3;   // m/s
    const double phase = std::fmod(update.ve_time, 2 * kTurn);
    const double height = kSpeed * (phase < kTurn ? phase : 2 * kTurn - phase);
    for (ReportedContact& contact : update.contacts) {
      contact.p_WC.z() += height;
      contact.separation -= height;
      contact.v_WC.z() = phase < kTurn ? kSpeed : -kSpeed;
    }
  });
  for (const Finding& finding : findings) {
    CAPTURE(finding.text);
    CHECK(finding.subject != std::string("separation"));
    CHECK(finding.subject != std::string("normal"));
  }
}

TEST_CASE("A body that is hit between two updates comes and goes as it may") {
  ContactAudit audit(box(), kEpsilon);
  for (int frame = 1; frame <= 600; ++frame) {
    // Below a tool that rests: up, a blow, down again, with each contact sent while it is near.
    constexpr double kTurn = 0.031;  // s: between two blows, and from a blow to the lowest place
    constexpr double kSpeed = 0.6;   // m/s
    const double time = frame * kPeriod;
    const double phase = std::fmod(time, 2 * kTurn);
    ContactUpdate update = good_update(std::numbers::pi / 4);
    update.ve_time = time;
    update.v_VE.setZero();
    const double distance = kSpeed * std::min(phase, 2 * kTurn - phase);
    const Vector3 v_WC(0, 0, phase < kTurn ? -kSpeed : kSpeed);
    MovableBody& body = update.bodies.emplace_back();
    body.id = 7;
    body.V_W.head<3>() = v_WC;
    const double height = update.q_VE[2] - kHalf;
    update.contacts = good_update(1e-9).contacts;
    for (ReportedContact& contact : update.contacts) {
      contact.b = {SideKind::kMovableBody, 7};
      contact.p_WC.z() = height - distance;
      contact.separation = distance;
      contact.v_WC = v_WC;
    }
    if (distance > kEpsilon) {
      update.contacts.clear();
      update.bodies.clear();
    }
    audit.add(update);
  }
  CHECK(audit.counts().appeared > 100);
  CHECK(audit.counts().late == 0);
  CHECK(audit.counts().vanished == 0);
}

TEST_CASE("A session without contacts is too short to tell") {
  const std::vector<Finding> findings =
      findings_of([](ContactUpdate& update) { update.contacts.clear(); });
  REQUIRE(findings.size() == 1);
  CHECK(findings.front().verdict == Verdict::kNote);
}

}  // namespace
}  // namespace hlm::server
