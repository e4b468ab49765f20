#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "hlm/client/contact_check.h"
#include "hlm/client/identity_tracker.h"
#include "hlm/protocol/codec.h"
#include "hlm/protocol/tool_fit.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm {
namespace {

ToolModel box_tool() {
  ToolDescription tool;
  tool.links.emplace_back();
  return ToolModel(tool);
}

ReportedContact contact_at(const Vector3& p_W, double separation = 0) {
  ReportedContact contact;
  contact.p_WC = p_W;
  contact.separation = separation;
  return contact;
}

/// The lower corners of a box of 40 mm at `pose`, over a floor at z = 0.
ReportedContacts corners(const ToolModel& tool) {
  ReportedContacts contacts;
  for (const double x : {-0.02, 0.02}) {
    for (const double y : {-0.02, 0.02}) {
      const Vector3 p_W = tool.X_WL(0) * Vector3(x, y, -0.02);
      contacts.push_back(contact_at({p_W.x(), p_W.y(), 0}, p_W.z()));
    }
  }
  return contacts;
}

TEST_CASE("Corners keep their identities while the box moves, turns and is listed in any order") {
  ToolModel tool = box_tool();
  IdentityTracker tracker;
  test::Random random;
  std::array<std::uint64_t, 4> first{};
  for (int frame = 0; frame < 300; ++frame) {
    Configuration q = tool.neutral();
    const double turn = 0.01 * frame;
    q << 0.005 * frame, 0.003 * frame, 0.02, std::cos(turn / 2), 0, 0, std::sin(turn / 2);
    tool.set_configuration(q);
    ReportedContacts contacts = corners(tool);
    std::array<std::size_t, 4> order{0, 1, 2, 3};
    std::shuffle(order.begin(), order.end(), random.engine());
    ReportedContacts listed;
    for (const std::size_t i : order) listed.push_back(contacts[i]);
    tracker.assign(tool, {}, listed);
    for (std::size_t i = 0; i < 4; ++i) {
      if (frame == 0) first[order[i]] = listed[i].identity;
      REQUIRE(listed[i].identity == first[order[i]]);
    }
  }
  CHECK(tracker.given() == 4);
}

TEST_CASE("A contact whose place is no number takes nobody's identity") {
  const ToolModel tool = box_tool();
  IdentityTracker tracker;
  ReportedContacts contacts{contact_at({0, 0, 0}), contact_at({0.001, 0, 0})};
  tracker.assign(tool, {}, contacts);
  const std::uint64_t second = contacts[1].identity;
  contacts[0].p_WC.x() = std::numeric_limits<double>::quiet_NaN();
  tracker.assign(tool, {}, contacts);
  CHECK(contacts[1].identity == second);
  CHECK(contacts[0].identity != second);
  CHECK(tracker.given() == 3);
}

TEST_CASE("A contact that is left out for three frames keeps its identity, for four it does not") {
  const int missing = GENERATE(3, 4);
  const ToolModel tool = box_tool();
  IdentityTracker tracker;
  ReportedContacts contacts{contact_at({0, 0, 0})};
  tracker.assign(tool, {}, contacts);
  const std::uint64_t before = contacts[0].identity;
  ReportedContacts none;
  for (int frame = 0; frame < missing; ++frame) tracker.assign(tool, {}, none);
  tracker.assign(tool, {}, contacts);
  CHECK((contacts[0].identity == before) == (missing == 3));
}

TEST_CASE("Contacts of other sides, of another pair, farther away or turned are others") {
  const ToolModel tool = box_tool();
  IdentityTracker tracker;
  ReportedContacts contacts{contact_at({0, 0, 0})};
  tracker.assign(tool, {}, contacts);
  const std::uint64_t before = contacts[0].identity;
  SECTION("another body") { contacts[0].b = {SideKind::kMovableBody, 3}; }
  SECTION("another pair") { contacts[0].pair = 1; }
  SECTION("11 mm away") { contacts[0].p_WC.x() = 0.011; }
  SECTION("turned by 0.4 rad") { contacts[0].n_W = {std::sin(0.4), 0, std::cos(0.4)}; }
  tracker.assign(tool, {}, contacts);
  CHECK(contacts[0].identity != before);
}

TEST_CASE("Of two contacts the nearer goes on, and none shares an identity") {
  const ToolModel tool = box_tool();
  IdentityTracker tracker;
  ReportedContacts contacts{contact_at({0, 0, 0})};
  tracker.assign(tool, {}, contacts);
  const std::uint64_t before = contacts[0].identity;
  contacts = {contact_at({0.004, 0, 0}), contact_at({-0.001, 0, 0})};
  tracker.assign(tool, {}, contacts);
  CHECK(contacts[1].identity == before);
  CHECK(contacts[0].identity != before);
}

TEST_CASE("A body's own contacts are followed where the body goes") {
  const ToolModel tool = box_tool();
  IdentityTracker tracker;
  MovableBodies bodies(1);
  bodies[0].id = 5;
  std::uint64_t first = 0;
  for (int frame = 0; frame < 50; ++frame) {
    bodies[0].p_WCom.x() = 0.03 * frame;  // 30 mm a frame: more than the reach
    ReportedContacts contacts{contact_at({0.03 * frame, 0, 0})};
    contacts[0].a = {SideKind::kMovableBody, 5};
    tracker.assign(tool, bodies, contacts);
    if (frame == 0) first = contacts[0].identity;
    REQUIRE(contacts[0].identity == first);
  }
}

TEST_CASE("What cannot be meant so is named with its place and what is allowed") {
  const ToolModel tool = box_tool();
  protocol::ContactUpdate update;
  update.q_VE = tool.neutral();
  update.v_VE = Velocity::Zero(6);
  ReportedContacts& contacts = update.contacts;
  contacts = {contact_at({0, 0, 0}), contact_at({0.01, 0, 0})};
  contacts[1].identity = 1;
  MovableBodies& bodies = update.bodies;
  bodies.resize(1);
  const auto error = [&] { return find_error(update, tool).value_or(""); };
  REQUIRE(error().empty());
  SECTION("normal") {
    contacts[1].n_W = {0, 0, 0.9};
    CHECK(error() == "contact 1: normal (0, 0, 0.9) must be of length 1, not 0.9");
  }
  SECTION("not finite") {
    contacts[0].separation = NAN;
    CHECK(error() == "contact 0: separation nan m must be -10000 to 10000 m");
  }
  SECTION("identity") {
    contacts[1].identity = 0;
    CHECK_THAT(error(),
               Catch::Matchers::ContainsSubstring("contact 1: identity 0 is that of an earlier"));
  }
  SECTION("tool on the wrong side") {
    std::swap(contacts[0].a, contacts[0].b);
    CHECK(error() == "contact 0: the tool must be side a, to which the normal points");
  }
  SECTION("millimetres") {
    contacts[0].p_WC = {50, 0, 20};
    CHECK_THAT(error(), Catch::Matchers::ContainsSubstring("are lengths in metres"));
  }
  SECTION("inverse inertia") {
    bodies[0].W(0, 1) = 1;
    CHECK(error() == "body 0: its inverse inertia must be symmetric");
  }
  SECTION("friction") {
    contacts[1].friction = -11;
    CHECK(error() == "contact 1: friction -11 must be -10 to 10");
  }
  SECTION("velocity") {
    contacts[1].v_WC.y() = -1200;
    CHECK(error() == "contact 1: velocity has -1200 m/s, must be within ±1000 m/s");
  }
  SECTION("acceleration of a body") {
    bodies[0].id = 7;
    bodies[0].A_W[5] = 2e6;
    CHECK(error() ==
          "body 7: acceleration has 2e+06 m/s² or rad/s², must be within ±1e+06 m/s² or rad/s²");
  }
  SECTION("a configuration that is none") {
    update.q_VE[3] = 2;
    CHECK_THAT(error(), Catch::Matchers::ContainsSubstring("quaternion"));
  }
  SECTION("bodies of one number") {
    bodies.push_back(bodies[0]);
    CHECK(error() == "body 0: its id is that of an earlier body");
  }
}

/// Numbers of an update that a server has a range for.
std::vector<double*> numbers_of(protocol::ContactUpdate& update) {
  ReportedContact& contact = update.contacts[1];
  MovableBody& body = update.bodies[0];
  std::vector<double*> all{&contact.separation, &contact.friction, &contact.load};
  const auto add = [&](auto& values) {
    for (double& value : values) all.push_back(&value);
  };
  add(contact.p_WC);
  add(contact.n_W);
  add(contact.v_WC);
  add(body.p_WCom);
  add(body.V_W);
  add(body.A_W);
  add(body.axis_W);
  for (int i = 0; i < 6; ++i) all.push_back(&body.W(i, i));
  add(update.q_VE);
  add(update.v_VE);
  return all;
}

TEST_CASE("Whatever a server refuses is refused before it is sent") {
  test::Random random;
  const ToolModel tool = box_tool();
  for (int round = 0; round < 3000; ++round) {
    protocol::ContactUpdate update;
    update.q_VE = tool.neutral();
    update.v_VE = Velocity::Zero(6);
    update.contacts = {contact_at({0, 0, 0}), contact_at({0.01, 0, 0})};
    update.contacts[1].identity = 1;
    update.bodies.resize(1);
    update.bodies[0].W.setIdentity();
    const std::vector<double*> numbers = numbers_of(update);
    const double size = std::pow(10, random.uniform(-2, 14));
    const auto chosen = static_cast<std::size_t>(random.uniform(0, 1) * 0.999999 *
                                                 static_cast<double>(numbers.size()));
    *numbers[chosen] = random.uniform(0, 1) < 0.1 ? NAN : random.uniform(-1, 1) * size;
    protocol::ContactUpdate read;
    const protocol::DatagramBytes bytes = encode(protocol::Envelope{.session = 1}, update, 0);
    const bool refused = decode_part(protocol::view(bytes), read).has_value() ||
                         find_misfit(tool.description(), update).has_value();
    CAPTURE(chosen, *numbers[chosen]);
    if (refused) REQUIRE(find_error(update, tool).has_value());
  }
}

}  // namespace
}  // namespace hlm
