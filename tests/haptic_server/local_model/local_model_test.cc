// The local model's states, collisions and determinism.
#include "hlm/haptic_server/local_model/local_model.h"

#include "tests/support/catch.h"
#include "tests/support/contacts.h"
#include "tests/support/random.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

constexpr double kStep = 1.0 / 512;  // s

LocalModel falling_tool(const LocalModelParameters& parameters, double height) {
  const ToolDescription tool = test::rigid_tool(0.3, Matrix3::Identity() * 1e-4);
  LocalModel model(tool, ToolModel(tool).neutral(), parameters, kStep);
  ReportedContact floor;
  floor.p_WC = {0, 0, -height};
  floor.separation = height;
  model.adopt({.contacts = {floor}, .q_VE = model.proxy().configuration(), .age = 0});
  return model;
}

HandInput push_down(double force) {
  HandInput hand;
  hand.F[2] = -force;
  return hand;
}

TEST_CASE("The proxy moves freely, collides once and rests") {
  LocalModel model = falling_tool({}, 0.01);
  int collisions = 0;
  while (model.state() == ProxyContactState::kFreeMotion) model.step(push_down(1));
  for (int i = 0; i < 500; ++i) {
    collisions += model.state() == ProxyContactState::kColliding;
    model.step(push_down(1));
  }
  CHECK(collisions == 1);
  CHECK(model.state() == ProxyContactState::kResting);
}

TEST_CASE("The collision impulse is the momentum that the proxy loses") {
  LocalModelParameters parameters;
  parameters.restitution = GENERATE(0.0, 0.6, 1.0);
  LocalModel model = falling_tool(parameters, 0.005);
  Velocity before = model.velocity();
  ContactWrench felt;
  while (felt.impulse.isZero(0)) {
    before = model.velocity();
    felt = model.step(push_down(2));
  }
  // 0.3 kg at the approach speed, times 1 + e.
  CHECK(felt.impulse[2] == Approx(-(1 + parameters.restitution) * 0.3 * before[2]).epsilon(1e-9));
}

TEST_CASE("A contact that arrives penetrating stops the proxy without a spring force") {
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  LocalModel model(tool, ToolModel(tool).neutral(), {}, kStep);
  for (int i = 0; i < 50; ++i) model.step(push_down(1));
  REQUIRE(model.velocity()[2] < -0.05);  // m/s
  ReportedContact wall;
  wall.separation = -0.004;  // 4 mm deep already
  wall.p_WC = model.proxy().X_WH().p + Vector3(0, 0, 0.004);
  model.adopt({.contacts = {wall}, .q_VE = model.proxy().configuration(), .age = 0});

  const ContactWrench felt = model.step(push_down(1));
  CHECK(felt.impulse[2] > 0.05);                // N·s
  CHECK(felt.F.head<3>().norm() < 1.1);         // N: what the hand pushes, not k·4 mm = 16 N
  CHECK(std::abs(model.velocity()[2]) < 1e-2);  // m/s
}

TEST_CASE("The intermediate representation answers the same contact with its full depth") {
  LocalModelParameters parameters;
  parameters.update_rule = UpdateRule::kIntermediateRepresentation;
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  LocalModel model(tool, ToolModel(tool).neutral(), parameters, kStep);
  ReportedContact wall;
  wall.separation = -0.004;
  wall.p_WC = Vector3(0, 0, 0.004);
  model.adopt({.contacts = {wall}, .q_VE = model.proxy().configuration(), .age = 0});
  const ContactWrench felt = model.follow(model.proxy().configuration(), Velocity::Zero(6));
  CHECK(felt.F[2] == Approx(parameters.stiffness * 0.004).epsilon(1e-9));
}

TEST_CASE("Between updates a constraint goes on at its speed: 0.1 m/s are 10 mm in 100 ms") {
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  LocalModel model(tool, ToolModel(tool).neutral(), {}, 1e-3);
  ReportedContact wall;
  wall.p_WC = {0, 0, -0.02};
  wall.separation = 0.02;
  wall.v_WC = {0.3, 0, 0.1};  // m/s; what it moves along itself does not matter
  model.adopt({.contacts = {wall}, .q_VE = model.proxy().configuration(), .age = 0});
  for (int i = 0; i < 100; ++i) model.step({});
  CHECK(separation(model.contacts()[0], poses_of(model.proxy(), {})) == Approx(0.01).margin(1e-9));
}

TEST_CASE("A wall that changes its speed changes the damper's force by 0.5 N a step at most") {
  LocalModelParameters parameters;
  parameters.damping = 100;  // N·s/m
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  LocalModel model(tool, ToolModel(tool).neutral(), parameters, 1e-3);
  ReportedContact wall;
  model.adopt({.contacts = {wall}, .q_VE = model.proxy().configuration()});
  double before = 0;
  for (int i = 0; i < 2000; ++i) before = model.step(push_down(5)).F[2];
  REQUIRE(before == Approx(5).epsilon(1e-3));  // N
  wall.v_WC = {0, 0, GENERATE(0.07, -0.07)};   // m/s: 7 N of the damper
  wall.separation = model.contacts()[0].now.s;
  model.adopt({.contacts = {wall}, .q_VE = model.proxy().configuration()});
  for (int i = 0; i < 100; ++i) {
    const double f = model.step(push_down(5)).F[2];
    CHECK(std::abs(f - before) < 0.5 + 0.07e-3 * parameters.stiffness);  // N: and the spring
    before = f;
  }
}

TEST_CASE("Directly coupled, the tank gains what the device paid and the spring does not keep") {
  const double rendered = GENERATE(1.0, 0.9);
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  LocalModelParameters parameters;
  LocalModel model(tool, ToolModel(tool).neutral(), parameters, 1e-3);
  const ReportedContacts floor(1);
  model.adopt({.contacts = floor, .q_VE = model.proxy().configuration(), .age = 0});
  // In, and slowly out again under load.
  double paid = 0;  // J
  double z = 0;     // m
  for (int i = 0; i < 40; ++i) {
    Configuration q = model.proxy().configuration();
    q[2] = z;
    const double v = i < 20 ? -0.1 : 0.02;  // m/s
    const ContactWrench felt = model.follow(q, v * Velocity::Unit(6, 2));
    model.set_rendered(rendered);
    if (i == 39) break;
    paid -= rendered * felt.F[2] * v * 1e-3;
    z += v * 1e-3;
  }
  CHECK(paid > 1e-3);
  CHECK(model.healing_tank() == Approx(paid - parameters.stiffness * z * z / 2).margin(1e-9));
}

TEST_CASE(
    "Pressed in and out at its limit of force, a device leaves no more in the tank than it paid") {
  const double rendered = GENERATE(0.05, 0.2, 1.0);
  const double depth = GENERATE(0.005, 0.01);  // m
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  LocalModelParameters parameters;
  parameters.stiffness = 16000;
  LocalModel model(tool, ToolModel(tool).neutral(), parameters, 1e-3);
  const ReportedContacts floor(1);
  model.adopt({.contacts = floor, .q_VE = model.proxy().configuration(), .age = 0});
  const double begin = model.healing_tank();
  double paid = 0;   // J
  double z = 0.001;  // m
  const int steps = static_cast<int>((depth + 0.001) / 1e-4);
  for (int i = 0; i < 2 * steps; ++i) {
    Configuration q = model.proxy().configuration();
    q[2] = z;
    const double v = i < steps ? -0.1 : 0.1;  // m/s
    const ContactWrench felt = model.follow(q, v * Velocity::Unit(6, 2));
    model.set_rendered(rendered);
    paid -= rendered * felt.F[2] * v * 1e-3;
    z += v * 1e-3;
  }
  CAPTURE(rendered, depth, paid);
  CHECK(model.healing_tank() <= begin + std::max(0.0, paid) + 1e-9);  // J
}

TEST_CASE("A contact that closes begins without energy, at 1 MN/m too", "[optimised]") {
  test::Random random;
  LocalModelParameters parameters;
  parameters.stiffness = 1e6;
  const Matrix3 inertia = Matrix3::Identity() * 1e-3;
  const ToolDescription tool = test::rigid_tool(1, inertia);
  for (int trial = 0; trial < 100; ++trial) {
    LocalModel model(tool, ToolModel(tool).neutral(), parameters, 1e-3);
    Velocity v(6);
    v << random.vector(0.5), random.vector(5);
    model.follow(model.proxy().configuration(), v);
    ReportedContacts contacts;
    for (std::uint64_t i = 0; i < 3; ++i) {
      ReportedContact& contact = contacts.emplace_back();
      contact.identity = i;
      contact.n_W = random.direction();
      contact.separation = random.uniform(0, 0.01);
      contact.p_WC = random.vector(0.05) - contact.separation * contact.n_W;
    }
    model.adopt({.contacts = contacts, .q_VE = model.proxy().configuration()});
    const auto energy = [&] {
      double sum = 0.5 * model.velocity().dot(model.proxy().mass_matrix() * model.velocity());
      for (const LocalContact& contact : model.contacts()) {
        const double s = std::min(0.0, separation(contact, poses_of(model.proxy(), {})));
        sum += 0.5 * parameters.stiffness * s * s;
      }
      return sum;
    };
    const double begin = energy();
    for (int i = 0; i < 200; ++i) {
      model.step({});
      REQUIRE(energy() <= begin * 1.01);
    }
  }
}

TEST_CASE("A tool that slides on a floor under an overhang is stopped by both, not driven in") {
  LocalModelParameters frictionless;
  frictionless.static_friction = frictionless.kinetic_friction = 0;
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  LocalModel model(tool, ToolModel(tool).neutral(), frictionless, 1e-3);
  ReportedContacts contacts = test::distinct_contacts(2);
  contacts[1].n_W = Vector3(-1, 0, -1).normalized();
  contacts[1].separation = 0.014;
  contacts[1].p_WC = -0.014 * contacts[1].n_W;
  model.adopt({.contacts = contacts, .q_VE = model.proxy().configuration(), .age = 0});
  // A press that grows keeps the floor's contact penetrating.
  HandInput hand = push_down(1);
  hand.F[0] = 1;
  Velocity before = model.velocity();
  ContactWrench felt;
  for (int i = 0; i < 1000 && felt.impulse[0] == 0; ++i) {
    hand.F[2] -= 0.01;
    before = model.velocity();
    felt = model.step(hand);
  }
  REQUIRE(before[0] == Approx(0.2).epsilon(0.02));  // m/s: 1 N on 1 kg over 20 mm
  // Only the overhang would stop half of the speed and turn the other half into the floor.
  CHECK(felt.impulse[0] == Approx(-before[0]).epsilon(1e-6));  // N·s
  CHECK(felt.impulse[2] == Approx(-before[2]).epsilon(1e-6));  // N·s
}

TEST_CASE("A door's contact is felt at the handle as force and torque that its length weighs") {
  const double length = GENERATE(0.05, 0.1, 0.2);  // m
  const double handle = 0.1;                       // m from the hinge
  ToolDescription door = test::rigid_tool(1, Matrix3::Identity() * 1e-3, JointType::kRevolute);
  door.length = length;
  door.X_LH.p = {handle, 0, 0};
  LocalModel model(door, ToolModel(door).neutral(), {}, 1e-3);
  ReportedContact stop;
  stop.n_W = {0, -1, 0};
  stop.p_WC = {0.2, 0, 0};
  model.adopt({.contacts = {stop}, .q_VE = model.proxy().configuration(), .age = 0});
  HandInput hand;
  hand.F[1] = 2;  // N at the handle: 0.2 N·m about the hinge
  ContactWrench felt;
  for (int i = 0; i < 2000; ++i) felt = model.step(hand);
  const double moment = -2 * handle;  // N·m
  // The least f² + (t/length)² with f handle + t = moment.
  const double weight = handle * handle + length * length;
  CHECK(felt.F[1] == Approx(moment * handle / weight).epsilon(1e-3));           // N
  CHECK(felt.F[5] == Approx(moment * length * length / weight).epsilon(1e-3));  // N·m
}

TEST_CASE("A wall that arrived late is felt where it is a second later") {
  // 5 mm beyond the wall when it is reported, on the way with what the push has done until then.
  const double push = GENERATE(0.5, 2.0, 5.0);  // N
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  LocalModel model(tool, ToolModel(tool).neutral(), {}, 1e-3);
  while (model.proxy().X_WH().p.z() > -0.005) model.step(push_down(push));
  ReportedContact wall;
  wall.p_WC = {0, 0, 0};
  wall.separation = model.proxy().X_WH().p.z();
  model.adopt({.contacts = {wall}, .q_VE = model.proxy().configuration()});
  double largest_step = 0;
  double before = 0;
  for (int i = 0; i < 1200; ++i) {
    const double f = model.step(push_down(push)).F[2];
    if (i > 50) largest_step = std::max(largest_step, f - before);  // N: after it has stopped
    before = f;
    REQUIRE(model.healing_tank() >= 0);
  }
  CHECK(model.proxy().X_WH().p.z() == Approx(-push / 4000).margin(1e-4));  // m
  CHECK(largest_step <= 0.6);  // N: half a newton of healing, and the proxy's own motion
}

TEST_CASE("Through a hundred thousand random updates the healing tank is never below zero",
          "[optimised]") {
  test::Random random;
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  LocalModel model(tool, ToolModel(tool).neutral(), {}, 1e-3);
  HandInput hand;
  double most = 0;
  for (int update = 0; update < 100'000; ++update) {
    ReportedContacts contacts;
    for (std::uint64_t i = 0; i < 3; ++i) {
      if (random.uniform(0, 1) < 0.3) continue;
      ReportedContact& contact = contacts.emplace_back();
      contact.identity = i;
      contact.n_W = random.direction();
      contact.separation = random.uniform(-0.01, 0.003);
      contact.p_WC = model.proxy().X_WH().p - contact.separation * contact.n_W;
      contact.v_WC = random.vector(0.1);
    }
    model.adopt({.contacts = contacts, .q_VE = model.proxy().configuration(), .age = 0.01});
    hand.F.head<3>() = random.vector(3) - model.proxy().X_WH().p - model.hand_twist().head<3>();
    model.step(hand);
    most = std::max(most, model.healing_tank());
    REQUIRE(model.healing_tank() >= 0);
  }
  CHECK(most > 1e-3);  // J: it was used
}

TEST_CASE("Without energy that contacts took out, a late wall stays where it was met") {
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  LocalModel model(tool, ToolModel(tool).neutral(), {}, 1e-3);
  ReportedContact wall;
  wall.p_WC = {0, 0, 0.005};
  wall.separation = -0.005;
  model.adopt({.contacts = {wall}, .q_VE = model.proxy().configuration()});
  for (int i = 0; i < 1200; ++i) model.step(push_down(2 * std::min(1.0, i / 1000.0)));
  CHECK(model.proxy().X_WH().p.z() < 0);  // m: the hand was not pushed out
}

TEST_CASE("The same inputs give the same bits") {
  const auto run = [] {
    LocalModel model = falling_tool({}, 0.002);
    for (int i = 0; i < 1000; ++i) model.step(push_down(1 + 0.5 * (i % 7)));
    return model.proxy().configuration();
  };
  CHECK(run() == run());
}

TEST_CASE("A push at a corner turns the tool about its contacts as rigid dynamics say") {
  // A bar hinged by nothing: two floor contacts at its ends, pushed above one of them.
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  LocalModel model(tool, ToolModel(tool).neutral(), {}, kStep);
  ReportedContacts contacts = test::distinct_contacts(2);
  contacts[0].p_WC = {-0.1, 0, 0};
  contacts[1].p_WC = {0.1, 0, 0};
  model.adopt({.contacts = contacts, .q_VE = model.proxy().configuration(), .age = 0});
  HandInput hand = push_down(4);
  hand.F[4] = 4 * 0.05;  // N·m about y: as if pushed at x = +0.05 m
  for (int i = 0; i < 3000; ++i) model.step(hand);
  CHECK(model.contacts()[0].latest.f_W.z() == Approx(1).epsilon(1e-5));  // lever arms 0.05 : 0.15
  CHECK(model.contacts()[1].latest.f_W.z() == Approx(3).epsilon(1e-5));
}

TEST_CASE("A linkage that folds onto itself: both links feel it, and momentum stays") {
  // Three bars of 0.2 m, free in the plane, bent to a U; the last one swings back to the first.
  ToolDescription chain;
  for (int i = 0; i < 3; ++i) {
    Link link;
    link.parent = i - 1;
    link.joint = i == 0 ? JointType::kPlanar : JointType::kRevolute;
    if (i > 0) link.X_PJ.p = {0.2, 0, 0};
    link.p_LCom = {0.1, 0, 0};
    link.mass = 0.3;
    link.I_LCom = test::box_inertia(link.mass, {0.1, 0.01, 0.01});
    chain.links.push_back(link);
  }
  chain.hand_link = 2;
  Configuration q = Configuration::Zero(5);
  q.tail<2>() << 1.6, 1.6;
  LocalModelParameters frictionless;
  frictionless.static_friction = frictionless.kinetic_friction = 0;
  LocalModel model(chain, q, frictionless, kStep);
  model.follow(q, Velocity::Unit(5, 4) * 2);  // rad/s in the last joint

  // The last bar's end meets the first bar's upper face.
  const ToolModel& tool = model.proxy();
  const Vector3 end = tool.X_WL(2) * Vector3(0.2, 0, 0);
  ReportedContact contact;
  contact.a = {SideKind::kToolLink, 2};
  contact.b = {SideKind::kToolLink, 0};
  contact.n_W = tool.X_WL(0).R * Vector3::UnitY();
  contact.separation = 0.02;
  contact.p_WC = end - contact.separation * contact.n_W;
  const ReportedContacts contacts{contact};
  model.adopt({.contacts = contacts, .q_VE = q});

  const auto momentum = [&] {
    return Eigen::Vector2d((tool.mass_matrix() * model.velocity()).head<2>());
  };
  const auto gap_speed = [&] {
    const Vector3 p_W = model.contacts()[0].now.p_W;
    return model.contacts()[0].now.n_W.dot(
        (tool.point_jacobian(2, p_W) - tool.point_jacobian(0, p_W)) * model.velocity());
  };
  const Eigen::Vector2d before = momentum();
  const double turning = model.velocity()[2];
  REQUIRE(gap_speed() < -0.1);  // m/s
  while (model.state() == ProxyContactState::kFreeMotion) model.step({});
  for (int i = 0; i < 3; ++i) model.step({});
  CHECK(gap_speed() > -0.02);                            // m/s
  CHECK(std::abs(model.velocity()[2] - turning) > 0.1);  // rad/s: the first bar was hit
  CHECK((momentum() - before).norm() < 1e-3 * before.norm());
}

}  // namespace
}  // namespace hlm::server
