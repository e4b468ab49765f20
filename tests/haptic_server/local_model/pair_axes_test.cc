// Of the axes of a pair only the one with the greatest gap acts.
#include "hlm/local_model/pair_axes.h"

#include <memory>

#include "hlm/local_model/local_model.h"
#include "tests/support/catch.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

constexpr double kStep = 1e-3;  // s
constexpr std::uint64_t kSide = 1;
constexpr std::uint64_t kTop = 2;

/// A point of the tool at p_W (m) near the edge of a block that fills x < 0, z < 0.
ReportedContacts edge(const Vector3& p_W, bool one_axis = false) {
  ReportedContacts contacts;
  const auto add = [&](std::uint64_t identity, const Vector3& n) {
    ReportedContact& contact = contacts.emplace_back();
    contact.identity = identity;
    contact.pair = 7;
    contact.axis = one_axis ? 0 : static_cast<std::uint16_t>(identity);
    contact.n_W = n;
    contact.separation = n.dot(p_W);
    contact.p_WC = p_W - contact.separation * n;
    contact.friction = 0;
  };
  add(kSide, Vector3::UnitX());
  add(kTop, Vector3::UnitZ());
  return contacts;
}

/// A free tool of 1 kg, a point, at p_W.
std::unique_ptr<LocalModel> tool_at(const Vector3& p_W,
                                    const LocalModelParameters& parameters = {}) {
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  Configuration q = ToolModel(tool).neutral();
  q.head<3>() = p_W;
  return std::make_unique<LocalModel>(tool, q, parameters, kStep);
}

void adopt(LocalModel& model, const ReportedContacts& contacts) {
  model.adopt({.contacts = contacts, .q_VE = model.proxy().configuration(), .age = 0});
}

HandInput force(double x, double z) {
  HandInput hand;
  hand.F[0] = x;
  hand.F[2] = z;
  return hand;
}

Vector3 position(const LocalModel& model) { return model.proxy().X_WH().p; }

/// Largest force of the contacts while the tool is pushed down for 0.2 s.
double felt_on_the_way_down(LocalModel& model) {
  double largest = 0;
  for (int i = 0; i < 200; ++i) {
    const ContactWrench felt = model.step(force(0, -1));
    largest = std::max({largest, felt.F.norm(), felt.impulse.norm() / kStep});
  }
  return largest;
}

TEST_CASE("A tool that goes down beside a block does not feel its top") {
  const Vector3 beside(0.0005, 0, 0.002);
  const auto model = tool_at(beside);
  adopt(*model, edge(beside));
  CHECK(felt_on_the_way_down(*model) == 0);
  CHECK(position(*model).z() < -0.01);  // m
}

TEST_CASE("Contacts of one axis all act") {
  const Vector3 beside(0.0005, 0, 0.002);
  const auto model = tool_at(beside);
  adopt(*model, edge(beside, true));
  CHECK(felt_on_the_way_down(*model) > 1);  // N
  CHECK(position(*model).z() > -0.001);     // m
}

TEST_CASE("A tool that comes over the edge between two updates rests on the top") {
  const Vector3 beside(0.003, 0, 0.002);
  const auto model = tool_at(beside);
  adopt(*model, edge(beside));
  for (int i = 0; i < 150; ++i) model->step(force(-1, 0));
  REQUIRE(position(*model).x() < -0.005);  // m
  ContactWrench felt;
  for (int i = 0; i < 1500; ++i) {
    felt = model->step(force(model->velocity()[0] < 0 ? 5 : 0, -2));
  }
  CHECK(felt.F[2] == Approx(2).margin(0.01));             // N
  CHECK(position(*model).z() == Approx(0).margin(1e-3));  // m
  REQUIRE(model->contacts().size() == 1);
  CHECK(model->contacts()[0].identity == kTop);
}

TEST_CASE(
    "Where the acting axis changes under load, force falls by no more than the release step") {
  const Vector3 above(-0.002, 0, 0.0001);
  const auto model = tool_at(above);
  adopt(*model, edge(above));
  for (int i = 0; i < 300; ++i) model->step(force(0, -5));
  REQUIRE(model->contacts()[0].identity == kTop);
  Vector3 before = model->step(force(0.5, -5)).F.head<3>();
  REQUIRE(before.z() == Approx(5).margin(0.05));  // N
  double largest_change = 0;
  for (int i = 0; i < 400; ++i) {
    const Vector3 now = model->step(force(0.5, -5)).F.head<3>();
    largest_change = std::max(largest_change, (now - before).norm());
    before = now;
  }
  CHECK(position(*model).x() > 0);
  CHECK(position(*model).z() < -0.01);
  CHECK(before.norm() == 0);
  CHECK(largest_change < 0.5 + 0.01);  // N: and what 5 N do to the damper in a step.
}

TEST_CASE("What an update changes about the acting axis changes no force at once") {
  const Vector3 above(-0.002, 0, 0.0001);
  const auto model = tool_at(above);
  adopt(*model, edge(above));
  double before = 0;
  for (int i = 0; i < 300; ++i) before = model->step(force(0, -5)).F[2];
  // As found from where the environment has its tool: beside the block, by a little.
  const Vector3 beside = position(*model) + Vector3(0.0021, 0, 0);
  ReportedContacts contacts = edge(beside);
  for (ReportedContact& contact : contacts) contact.p_WC -= Vector3(0.0021, 0, 0);
  adopt(*model, contacts);
  CHECK(model->step(force(0, -5)).F[2] == Approx(before).margin(0.51));  // N
}

TEST_CASE("An axis nearly parallel to one of a lower number never bears, but tells them apart") {
  const auto report = [](double gap, double gap_of_second) {
    ReportedContacts contacts = edge({0, 0, gap});
    contacts[0].n_W = Vector3::UnitZ();
    contacts[0].p_WC = {0, 0, 0};
    contacts[0].separation = gap;
    contacts[1].n_W = Vector3(0.05, 0, 1).normalized();
    contacts[1].separation = gap_of_second;
    contacts[1].p_WC = Vector3(0, 0, gap) - gap_of_second * contacts[1].n_W;
    return contacts;
  };
  SECTION("closed, whichever gap is greater") {
    const auto model = tool_at({0, 0, -0.001});
    adopt(*model, report(-0.001, -0.0005));
    for (int i = 0; i < 100; ++i) model->step(force(0, -1));
    REQUIRE(model->contacts().size() == 1);
    CHECK(model->contacts()[0].identity == kSide);
  }
  SECTION("open") {
    const auto model = tool_at({0, 0, -0.001});
    adopt(*model, report(-0.001, 0.05));
    CHECK(felt_on_the_way_down(*model) == 0);
  }
}

TEST_CASE("Waiting contacts are told apart from those that act") {
  const Vector3 beside(0.003, 0, -0.02);
  const auto model = tool_at(beside);
  adopt(*model, edge(beside));
  model->step({});
  REQUIRE(model->contacts().size() == 1);
  CHECK(model->contacts()[0].identity == kSide);
  REQUIRE(model->waiting().size() == 1);
  CHECK(model->waiting()[0].now.s == Approx(-0.02));  // m
  CHECK(model->state() == ProxyContactState::kFreeMotion);
}

TEST_CASE("The intermediate representation has touching contacts of the best axis alone") {
  LocalModelParameters parameters;
  parameters.update_rule = UpdateRule::kIntermediateRepresentation;
  const Vector3 beside(0.003, 0, -0.02);
  const auto model = tool_at(beside, parameters);
  adopt(*model, edge(beside));
  CHECK(model->contacts().empty());
  adopt(*model, edge({-0.001, 0, -0.02}));
  REQUIRE(model->contacts().size() == 1);
  CHECK(model->contacts()[0].identity == kSide);
}

}  // namespace
}  // namespace hlm::server
