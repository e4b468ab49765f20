// The tick allocates nothing, with the most bodies and contacts too.
#include "tests/support/no_malloc.h"

#include "hlm/local_model/local_model.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

/// Eight bodies around a tool that touches all of them, each with as many contacts with a floor.
void crowd(ReportedContacts& contacts, MovableBodies& bodies, double depth) {
  for (std::uint32_t i = 0; i < kMaxMovedBodies; ++i) {
    MovableBody& body = bodies.emplace_back();
    body.id = i;
    body.p_WCom = {0.1 * i, 0, 0};
    body.W = Matrix6::Identity();
    body.A_W[2] = -9.81;
  }
  for (std::uint64_t i = 0; contacts.size() + 2 <= contacts.capacity(); ++i) {
    const auto body = static_cast<std::uint32_t>(i % kMaxMovedBodies);
    const Vector3 p(0.1 * body + 0.01 * static_cast<double>(i / 16),
                    0.002 * static_cast<double>(i % 7), 0);
    ReportedContact contact;
    contact.identity = 2 * i;
    contact.pair = body;
    contact.axis = static_cast<std::uint16_t>(i % 3);
    contact.n_W = Vector3(i % 3 == 2 ? 1 : 0, 0, 1).normalized();
    contact.b = {SideKind::kMovableBody, body};
    contact.p_WC = p;
    contact.separation = -depth;
    contacts.push_back(contact);
    contact.identity = 2 * i + 1;
    contact.a = {SideKind::kMovableBody, body};
    contact.b = {};
    contact.n_W = Vector3::UnitZ();
    contact.load = 1;
    contacts.push_back(contact);
  }
}

TEST_CASE("Steps and updates with the most bodies and contacts allocate nothing and stay finite") {
  const auto rule = GENERATE(CollisionRule::kNonnegative, CollisionRule::kNewton);
  LocalModelParameters parameters;
  parameters.collision_rule = rule;
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  const auto model =
      std::make_unique<LocalModel>(tool, ToolModel(tool).neutral(), parameters, 1e-3);
  ReportedContacts contacts;
  MovableBodies bodies;
  crowd(contacts, bodies, 1e-4);
  const Configuration q = model->proxy().configuration();
  HandInput hand;
  hand.F[2] = -5;
  const test::NoMalloc guard;
  for (int i = 0; i < 60; ++i) {
    if (i % 17 == 0) {
      model->adopt({.contacts = contacts,
                    .q_VE = q,
                    .age = 0.02,
                    .bodies = bodies,
                    .impulse_step = std::max(0.0, i - 20.5),
                    .period = 0.017});
    }
    model->step(hand);
  }
  CHECK(guard.allocations() == 0);
  CHECK(model->bodies().size() == kMaxMovedBodies);
  CHECK(model->velocity().allFinite());
}

}  // namespace
}  // namespace hlm::server
