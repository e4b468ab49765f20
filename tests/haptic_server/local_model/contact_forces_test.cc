// Penalty and friction (docs/method.md 4), on the whole local model.
#include "hlm/haptic_server/local_model/contact_forces.h"

#include "hlm/haptic_server/local_model/local_model.h"
#include "tests/support/catch.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

constexpr double kStep = 1e-3;  // s

/// The plane z = 0 under a tool point at p_L, for a tool whose frame is the world's.
ReportedContact floor_contact(const Vector3& p_L, std::uint16_t index = 0) {
  ReportedContact contact;
  contact.identity = index;
  contact.p_WC = {p_L.x(), p_L.y(), 0};
  contact.separation = p_L.z();
  return contact;
}

LocalModel box_on_floor(const LocalModelParameters& parameters, double mass = 1) {
  const ToolDescription tool = test::rigid_tool(mass, Matrix3::Identity() * 1e-3 * mass);
  LocalModel model(tool, ToolModel(tool).neutral(), parameters, kStep);
  ReportedContacts contacts;
  for (std::uint16_t i = 0; i < 4; ++i) {
    contacts.push_back(floor_contact({i & 1 ? 0.05 : -0.05, i & 2 ? 0.05 : -0.05, 0}, i));
  }
  model.adopt({.contacts = contacts, .q_VE = model.proxy().configuration(), .age = 0});
  return model;
}

HandInput push(const Vector3& force) {
  HandInput hand;
  hand.F.head<3>() = force;
  return hand;
}

TEST_CASE("At rest four contacts share the push: s = -f/(4k), F_env = -f") {
  LocalModelParameters parameters;
  LocalModel model = box_on_floor(parameters);
  ContactWrench felt;
  for (int i = 0; i < 2000; ++i) felt = model.step(push({0, 0, -8}));
  CHECK(felt.F[2] == Approx(8).epsilon(1e-6));
  for (const LocalContact& contact : model.contacts()) {
    CHECK(contact.now.s == Approx(-8.0 / (4 * parameters.stiffness)).epsilon(1e-6));
  }
}

TEST_CASE("A contact never pulls") {
  LocalModel model = box_on_floor({});
  for (int i = 0; i < 500; ++i) model.step(push({0, 0, -20}));
  for (int i = 0; i < 200; ++i) {
    model.step(push({0, 0, 30}));
    for (const LocalContact& contact : model.contacts()) REQUIRE(contact.latest.f_W.z() >= 0);
  }
  CHECK(model.proxy().X_WH().p.z() > 0.01);  // m: it left
}

TEST_CASE("The implicit step holds 1 MN/m on a 0.1 kg tool") {
  LocalModelParameters parameters;
  parameters.stiffness = 1e6;
  LocalModel model = box_on_floor(parameters, 0.1);
  for (int i = 0; i < 3000; ++i) {
    model.step(push({0, 0, -10}));
    REQUIRE(std::abs(model.proxy().X_WH().p.z()) < 1e-3);  // m
  }
  CHECK(model.velocity().norm() < 1e-6);  // m/s, rad/s
}

TEST_CASE("The explicit step is stable up to its bound and not beyond") {
  // One contact of a 1 kg point along z: λ = 1/m, bound 2bΔt + kΔt² < 4.
  const double stiffness = GENERATE(0.9 * 3.9e6, 1.1 * 4e6);
  LocalModelParameters parameters;
  parameters.contact_step = ContactStep::kExplicit;
  parameters.stiffness = stiffness;
  parameters.damping = 0;
  parameters.static_friction = parameters.kinetic_friction = 0;
  ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3, JointType::kPrismatic);
  tool.links[0].axis = Vector3::UnitZ();
  LocalModel model(tool, Configuration::Zero(1), parameters, kStep);
  model.adopt({.contacts = {floor_contact(Vector3(0, 0, 0))},
               .q_VE = model.proxy().configuration(),
               .age = 0});
  // A steady push that keeps the contact closed, with a small disturbance at the start.
  double largest = 0;
  for (int i = 0; i < 2000; ++i) {
    model.step(push({0, 0, i == 0 ? -1001.0 : -1000.0}));
    if (i > 1000) largest = std::max(largest, std::abs(model.velocity()[0]));
  }
  const bool stable = largest < 1.5;  // m/s
  CHECK(stable == (stiffness < 4e6));
}

TEST_CASE("Friction sticks without drift below μ_s f_n and slips with μ_k f_n above",
          "[optimised]") {
  LocalModelParameters parameters;
  parameters.static_friction = 0.5;
  parameters.kinetic_friction = 0.3;
  LocalModel model = box_on_floor(parameters);
  for (int i = 0; i < 1000; ++i) model.step(push({0, 0, -10}));

  // Slowly: a step of force would overshoot in the elastic stick.
  for (int i = 0; i < 4000; ++i) model.step(push({std::min(4.9, 0.002 * i), 0, -10}));
  const double stuck = model.proxy().X_WH().p.x();
  CHECK(stuck == Approx(4.9 / (4 * parameters.stiffness)).epsilon(1e-3));
  for (int i = 0; i < 20'000; ++i) model.step(push({4.9, 0, -10}));
  CHECK(std::abs(model.proxy().X_WH().p.x() - stuck) < 1e-9);  // m in 20 s

  ContactWrench felt;
  for (int i = 0; i < 200; ++i) felt = model.step(push({6, 0, -10}));
  CHECK(felt.F[0] == Approx(-3).epsilon(0.01));                 // N
  CHECK(model.velocity()[0] == Approx(3 * 0.2).epsilon(0.05));  // m/s: 3 N on 1 kg for 0.2 s
}

TEST_CASE("The friction anchor survives an update of the same contact") {
  LocalModel model = box_on_floor({});
  for (int i = 0; i < 1000; ++i) model.step(push({2, 0, -10}));
  const double before = model.proxy().X_WH().p.x();
  const Configuration q = model.proxy().configuration();
  ReportedContacts again;
  for (const LocalContact& contact : model.contacts()) {
    ReportedContact reported;
    reported.identity = contact.identity;
    const Vector3 x_W = model.proxy().X_WL(0) * contact.deformation.p_A;
    reported.p_WC = {x_W.x(), x_W.y(), 0};
    reported.separation = x_W.z();
    again.push_back(reported);
  }
  model.adopt({.contacts = again, .q_VE = q, .age = 0});
  const ContactWrench felt = model.step(push({2, 0, -10}));
  CHECK(felt.F[0] == Approx(-2).margin(1e-6));  // N: no jump
  CHECK(std::abs(model.proxy().X_WH().p.x() - before) < 1e-9);
}

TEST_CASE("A moving constraint carries the tool along") {
  // A conveyor at 0.1 m/s: friction takes the tool to its speed.
  LocalModel model = box_on_floor({});
  ReportedContacts contacts;
  for (std::uint16_t i = 0; i < 4; ++i) {
    contacts.push_back(floor_contact({i & 1 ? 0.05 : -0.05, i & 2 ? 0.05 : -0.05, 0}, i));
    contacts.back().v_WC = {0.1, 0, 0};
  }
  model.adopt({.contacts = contacts, .q_VE = model.proxy().configuration(), .age = 0});
  for (int i = 0; i < 500; ++i) model.step(push({0, 0, -10}));
  CHECK(model.velocity()[0] == Approx(0.1).epsilon(1e-3));  // m/s
}

TEST_CASE("A floor that carries the tool takes its weight off the hand") {
  ToolDescription tool = test::rigid_tool(0.5, Matrix3::Identity() * 1e-3);
  tool.gravity_W = {0, 0, -9.81};
  LocalModel model(tool, ToolModel(tool).neutral(), {}, kStep);
  ContactWrench felt = model.step({});
  CHECK(felt.F[2] == Approx(-0.5 * 9.81).epsilon(1e-9));  // in the air: all of it

  ReportedContacts contacts;
  for (std::uint16_t i = 0; i < 4; ++i) {
    contacts.push_back(floor_contact({i & 1 ? 0.05 : -0.05, i & 2 ? 0.05 : -0.05, 0}, i));
  }
  model.adopt({.contacts = contacts, .q_VE = model.proxy().configuration(), .age = 0});
  for (int i = 0; i < 2000; ++i) felt = model.step({});
  CHECK(std::abs(felt.F[2]) < 1e-6);  // N
  for (const LocalContact& contact : model.contacts()) {
    CHECK(contact.latest.f_W.z() == Approx(0.5 * 9.81 / 4).epsilon(1e-6));
  }
}

}  // namespace
}  // namespace hlm::server
