// Updates of the local contacts: the case table, and a random 3-D stress (docs/method.md 2).
#include "hlm/haptic_server/local_model/contact_update.h"

#include <algorithm>
#include <limits>

#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

using test::Random;

constexpr double kStiffness = 10'000;  // N/m

TEST_CASE("Rule P is the paper's case table, Eqs. 4 to 6") {
  const auto s_plus = [](double sigma, std::optional<double> s_p) {
    return updated_separation(UpdateRule::kPaper, sigma, s_p);
  };
  CHECK(s_plus(0.003, {}) == 0.003);        // new, predicted: Eq. 6
  CHECK(s_plus(-0.003, {}) == 0);           // new, penetrating: Eq. 4
  CHECK(s_plus(-0.003, -0.001) == -0.001);  // σ <= s_p <= 0: Eq. 5
  CHECK(s_plus(-0.003, 0.002) == 0);        // σ < 0 < s_p: Eq. 4
  CHECK(s_plus(-0.001, -0.003) == -0.001);  // s_p < σ < 0: Eq. 6
  CHECK(s_plus(0.002, -0.003) == 0.002);    // 0 < σ: Eq. 6
  CHECK(s_plus(0.002, 0.004) == 0.002);
}

TEST_CASE("The intermediate representation takes the reported separation") {
  CHECK(updated_separation(UpdateRule::kIntermediateRepresentation, -0.003, -0.001) == -0.003);
}

TEST_CASE("A rule that keeps the deformation never raises a force, the others report the depth") {
  Random random;
  for (const Word<UpdateRule>& word : kWords<UpdateRule>) {
    INFO(word.name);
    for (int i = 0; i < 100; ++i) {
      const double sigma = random.uniform(-0.01, 0.01);
      const double s_p = random.uniform(-0.01, 0.01);
      const double s_plus = updated_separation(word.value, sigma, s_p);
      if (traits(word.value).keeps_deformation) {
        CHECK(s_plus >= std::min(s_p, 0.0));
        CHECK(s_plus >= sigma);
      } else {
        CHECK(s_plus == sigma);
      }
    }
  }
}

constexpr double kReleaseForce = 0.5;  // N a step

UpdatePolicy policy(UpdateRule rule) {
  return {
      .rule = rule, .release_force = kReleaseForce, .stiffness = kStiffness, .recovery_steps = 10};
}

LocalContacts adopted(const LocalContacts& existing, const ReportedContacts& reported,
                      const ToolModel& ve_tool, const ToolModel& proxy, double age,
                      UpdateRule rule) {
  LocalContacts updated;
  const LocalBodies none;
  UpdateFrames frames{.tool = proxy,
                      .bodies = none,
                      .reported = poses_of(ve_tool, none),
                      .before = poses_of(proxy, none)};
  frames.set_now(poses_of(proxy, none));
  adopt_update(existing, reported, frames, age, policy(rule), updated);
  return updated;
}

double separation(const LocalContact& contact, const ToolModel& proxy) {
  return server::separation(contact, poses_of(proxy, {}));
}

void advance(LocalContacts& contacts, const ToolModel& proxy, UpdateRule rule) {
  double tank = 0;
  advance_contacts(contacts, poses_of(proxy, {}), policy(rule), 1e-3, tank);
}

TEST_CASE(
    "A contact's plane turns with the side whose face it is, and the force is where the corner "
    "is") {
  const PlaneOwner plane = GENERATE(PlaneOwner::kB, PlaneOwner::kA);
  LocalBodies bodies(1);
  bodies[0].id = 7;
  bodies[0].X_WB.p = {0, 0, -0.02};
  ToolModel tool(test::rigid_tool(1, Matrix3::Identity() * 1e-3));
  ReportedContacts reported(1);
  reported[0].b = {SideKind::kMovableBody, 7};
  reported[0].p_WC = {0.01, 0, 0};
  reported[0].separation = 0.001;  // m
  reported[0].plane = plane;
  UpdateFrames frames{.tool = tool,
                      .bodies = bodies,
                      .reported = poses_of(tool, bodies),
                      .before = poses_of(tool, bodies)};
  frames.set_now(frames.reported);
  LocalContacts updated;
  adopt_update({}, reported, frames, 0, policy(UpdateRule::kRetain), updated);
  REQUIRE(updated.size() == 1);
  LocalContact& contact = updated[0];

  // The body rolls by 0.1 rad about its centre, the tool turns by 0.02 rad the other way.
  bodies[0].X_WB.R = rotation_from_vector({0, 0.1, 0});
  Configuration q = tool.configuration();
  const Quaternion R_WT = rotation_from_vector({0, -0.02, 0});
  q.segment<4>(3) << R_WT.w(), R_WT.x(), R_WT.y(), R_WT.z();
  tool.set_configuration(q);
  const FramePoses poses = poses_of(tool, bodies);
  locate(contact, poses[contact.frame_a], poses[contact.frame_b]);
  CHECK(server::separation(contact, poses) == contact.now.s);

  const Vector3 corner = bodies[0].X_WB.p + bodies[0].X_WB.R * Vector3(0.01, 0, 0.02);
  const Vector3 under = tool.X_WL(0).R * Vector3(0.01, 0, 0.001);  // a's point, in its turned face
  const Quaternion turned = plane == PlaneOwner::kA ? R_WT : bodies[0].X_WB.R;
  const Vector3 n = turned * Vector3::UnitZ();
  CHECK((contact.now.n_W - n).norm() < 1e-12);
  CHECK(contact.now.s == Approx(n.dot(under - corner)).margin(1e-12));
  const Vector3 where = plane == PlaneOwner::kA ? Vector3(corner + contact.now.s * n) : under;
  CHECK((contact.now.p_W - where).norm() < 1e-12);
}

/// A tool on its way through random contacts that come and go, seen late.
class Stress {
 public:
  explicit Stress(Random& random)
      : random_(random),
        tool_(test::rigid_tool(1, Matrix3::Identity() * 1e-3)),
        proxy_(tool_),
        ve_tool_(tool_) {
    Configuration q = test::random_configuration(random_, proxy_);
    ve_tool_.set_configuration(q);
    proxy_.set_configuration(moved(q));
  }

  const ToolModel& proxy() const { return proxy_; }
  const ToolModel& ve_tool() const { return ve_tool_; }
  double age() const { return age_; }

  /// Up to eight contacts of few identities, so that most updates meet known ones.
  ReportedContacts report() {
    ReportedContacts contacts;
    for (std::uint32_t body = 0; body < 8; ++body) {
      if (random_.uniform(0, 1) < 0.3) continue;
      ReportedContact contact;
      contact.identity = body;
      contact.n_W = random_.direction();
      contact.separation = random_.uniform(-0.02, 0.005);
      contact.p_WC = ve_tool_.X_WL(0) * random_.vector(0.05) - contact.separation * contact.n_W;
      contact.v_WC = random_.vector(0.2);
      contacts.push_back(contact);
    }
    return contacts;
  }

  /// Both tools go on for one period of the environment; constraints move.
  void go_on(LocalContacts& contacts) {
    age_ = random_.uniform(0, 0.04);
    ve_tool_.set_configuration(moved(ve_tool_.configuration()));
    proxy_.set_configuration(moved(proxy_.configuration()));
    advance(contacts, proxy_, UpdateRule::kRetain);
  }

 private:
  Configuration moved(const Configuration& q) {
    Velocity step = test::random_velocity(random_, 6, 0.01);
    step.tail<3>() *= 10;
    return proxy_.integrate(q, step, 1);
  }

  Random& random_;
  ToolDescription tool_;
  ToolModel proxy_;
  ToolModel ve_tool_;
  double age_ = 0;
};

double spring_force(double s) { return kStiffness * std::max(0.0, -s); }
double energy(double s) { return s < 0 ? 0.5 * kStiffness * s * s : 0; }

/// Change of each contact's spring force at an update, over the union of both sets.
struct Change {
  double largest_rise = 0;  // N
  double largest_fall = 0;  // N
  double energy = 0;        // J
};
Change change(const LocalContacts& before, const LocalContacts& after, const ToolModel& proxy) {
  Change result;
  const auto s_of = [&](const LocalContacts& contacts, std::uint32_t body) {
    for (const LocalContact& c : contacts) {
      // A contact that is being released bears no more than its cap.
      if (c.identity == body) {
        return std::max(separation(c, proxy), -std::max(0.0, c.deformation.cap) / kStiffness);
      }
    }
    return std::numeric_limits<double>::infinity();
  };
  for (std::uint32_t body = 0; body < 8; ++body) {
    const double s = s_of(before, body);
    const double s_plus = s_of(after, body);
    const double rise = spring_force(s_plus) - spring_force(s);
    result.largest_rise = std::max(result.largest_rise, rise);
    result.largest_fall = std::max(result.largest_fall, -rise);
    result.energy += energy(s_plus) - energy(s);
  }
  return result;
}

TEST_CASE("Under rule P no update raises a spring force or stores energy") {
  Random random;
  Stress stress(random);
  LocalContacts contacts;
  double largest_fall = 0;
  for (int update = 0; update < 5000; ++update) {
    const LocalContacts before = contacts;
    contacts = adopted(before, stress.report(), stress.ve_tool(), stress.proxy(), stress.age(),
                       UpdateRule::kPaper);
    const Change at_update = change(before, contacts, stress.proxy());
    REQUIRE(at_update.largest_rise <= 1e-6);  // N
    REQUIRE(at_update.energy <= 1e-9);        // J
    largest_fall = std::max(largest_fall, at_update.largest_fall);
    stress.go_on(contacts);
  }
  CHECK(largest_fall > 10);  // N: why `retain` is the default.
}

TEST_CASE("Under rule R no update changes a spring force in either direction") {
  Random random;
  Stress stress(random);
  LocalContacts contacts;
  for (int update = 0; update < 5000; ++update) {
    const LocalContacts before = contacts;
    contacts = adopted(before, stress.report(), stress.ve_tool(), stress.proxy(), stress.age(),
                       UpdateRule::kRetain);
    const Change at_update = change(before, contacts, stress.proxy());
    REQUIRE(at_update.largest_rise <= 1e-6);  // N
    REQUIRE(at_update.largest_fall <= 1e-6);  // N
    stress.go_on(contacts);
  }
}

TEST_CASE("Rule R releases retained load by at most 0.5 N a step, then forgets the contact") {
  ToolModel proxy(test::rigid_tool(1, Matrix3::Identity() * 1e-3));
  LocalContacts contacts(1);
  contacts[0].deformation.p_A = Vector3(0, 0, -0.002);  // 2 mm below the constraint z = 0
  contacts = adopted(contacts, {}, proxy, proxy, 0, UpdateRule::kRetain);
  REQUIRE(contacts.size() == 1);

  const auto force_of = [&](const LocalContact& contact) {
    return std::min(contact.deformation.cap, spring_force(separation(contact, proxy)));
  };
  double force = force_of(contacts[0]);
  int steps = 0;
  while (!contacts.empty()) {
    REQUIRE(++steps < 100);
    advance(contacts, proxy, UpdateRule::kRetain);
    const double now = contacts.empty() ? 0 : force_of(contacts[0]);
    CHECK(force - now <= kReleaseForce + 1e-6);  // N
    force = now;
  }
  CHECK(steps >= 40);  // 20 N at 0.5 N a step, the last one perhaps a rounding error
  CHECK(steps <= 41);
}

TEST_CASE("A contact that was being released and is reported again bears no more than before") {
  ToolModel proxy(test::rigid_tool(1, Matrix3::Identity() * 1e-3));
  LocalContacts contacts(1);
  contacts[0].deformation.p_A = Vector3(0, 0, -0.002);  // 2 mm below the constraint z = 0: 20 N
  contacts = adopted(contacts, {}, proxy, proxy, 0, UpdateRule::kRetain);
  for (int i = 0; i < 30; ++i) advance(contacts, proxy, UpdateRule::kRetain);
  REQUIRE(contacts.size() == 1);
  REQUIRE(contacts[0].deformation.cap == Approx(5));  // N: 0.5 N a step
  ReportedContacts again(1);
  again[0].separation = -0.002;
  again[0].p_WC = {0, 0, 0};
  contacts = adopted(contacts, again, proxy, proxy, 0, UpdateRule::kRetain);
  REQUIRE(contacts.size() == 1);
  CHECK_FALSE(contacts[0].orphaned());
  CHECK(spring_force(separation(contacts[0], proxy)) <= 5 + 1e-6);  // N
}

TEST_CASE(
    "Plane recovery keeps the depth at an update and ramps to the reported place in N steps") {
  const auto [depth, reported_depth] = GENERATE(table<double, double>({{0.002, 0.005},  // deeper
                                                                       {0.002, 0.0005},
                                                                       {0.0, 0.003}}));  // new
  ToolModel proxy(test::rigid_tool(1, Matrix3::Identity() * 1e-3));
  LocalContacts contacts(depth > 0 ? 1 : 0);
  if (depth > 0) contacts[0].deformation.p_A = Vector3(0, 0, -depth);
  ReportedContacts reported(1);
  reported[0].p_WC = {0, 0, 0};
  reported[0].separation = -reported_depth;

  contacts = adopted(contacts, reported, proxy, proxy, 0, UpdateRule::kPlaneRecovery);
  REQUIRE(contacts.size() == 1);
  for (int step = 0; step <= 10; ++step) {
    const double expected = depth + (reported_depth - depth) * step / 10;
    CHECK(std::abs(separation(contacts[0], proxy) + expected) < 1e-12);  // m
    advance(contacts, proxy, UpdateRule::kPlaneRecovery);
  }
  CHECK(std::abs(separation(contacts[0], proxy) + reported_depth) < 1e-12);
}

TEST_CASE("An update may come in any order, and name a contact twice") {
  ToolModel proxy(test::rigid_tool(1, Matrix3::Identity() * 1e-3));
  ReportedContacts reported(3);
  reported[0].identity = 7;
  reported[1].identity = 3;
  reported[2].identity = 7;
  reported[2].separation = 0.001;
  const LocalContacts contacts = adopted({}, reported, proxy, proxy, 0, UpdateRule::kRetain);
  REQUIRE(contacts.size() == 2);
  CHECK(contacts[0].identity == 3);
  CHECK(contacts[1].identity == 7);
  CHECK(std::abs(separation(contacts[1], proxy)) < 1e-12);  // m: the first of the two
}

TEST_CASE("Released contacts leave room for all that are reported") {
  ToolModel proxy(test::rigid_tool(1, Matrix3::Identity() * 1e-3));
  LocalContacts existing(kMaxLocalContacts);
  for (std::uint32_t i = 0; i < existing.size(); ++i) {
    existing[i].identity = i;
    existing[i].deformation.p_A = Vector3(0, 0, -0.001);
  }
  ReportedContacts reported(kMaxContacts);
  for (std::uint32_t i = 0; i < reported.size(); ++i) reported[i].identity = 1000 + i;
  const LocalContacts contacts = adopted(existing, reported, proxy, proxy, 0, UpdateRule::kRetain);
  REQUIRE(contacts.size() == kMaxLocalContacts);
  CHECK(contacts.back().identity == 1000 + kMaxContacts - 1);
}

TEST_CASE("Predicted contacts keep their true separation, however late they arrive") {
  Random random;
  Stress stress(random);
  for (int update = 0; update < 1000; ++update) {
    const ReportedContacts reported = stress.report();
    const LocalContacts contacts =
        adopted({}, reported, stress.ve_tool(), stress.proxy(), stress.age(), UpdateRule::kRetain);
    for (const LocalContact& contact : contacts) {
      const auto& source = *std::find_if(reported.begin(), reported.end(), [&](const auto& r) {
        return r.identity == contact.identity;
      });
      const Vector3 tool_point =
          stress.proxy().X_WL(0) *
          (stress.ve_tool().X_WL(0).inverse() * (source.p_WC + source.separation * source.n_W));
      const Vector3 constraint = source.p_WC + stress.age() * source.v_WC;
      const double sigma = source.n_W.dot(tool_point - constraint);
      if (sigma > 0) CHECK(std::abs(separation(contact, stress.proxy()) - sigma) < 1e-9);  // m
    }
    LocalContacts none;
    stress.go_on(none);
  }
}

TEST_CASE("Without the echo of the tool's configuration predicted walls land elsewhere") {
  // 1 mm from a wall 20 ms ago; since then the proxy has come 4 mm nearer.
  ToolModel ve_tool(test::rigid_tool(1, Matrix3::Identity() * 1e-3));
  ToolModel proxy = ve_tool;
  Configuration q = proxy.neutral();
  q[2] = -0.004;
  proxy.set_configuration(q);
  ReportedContacts reported(1);
  reported[0].separation = 0.005;
  reported[0].p_WC = {0, 0, -0.005};

  const LocalContacts with_echo = adopted({}, reported, ve_tool, proxy, 0.02, UpdateRule::kRetain);
  CHECK(std::abs(separation(with_echo[0], proxy) - 0.001) < 1e-12);  // m
  const LocalContacts without_echo = adopted({}, reported, proxy, proxy, 0.02, UpdateRule::kRetain);
  CHECK(std::abs(separation(without_echo[0], proxy) - 0.005) < 1e-12);  // m: 4 mm wrong
}

}  // namespace
}  // namespace hlm::server
