// The tick allocates nothing, with the most bodies and contacts too.
#include "tests/support/no_malloc.h"

#include <cmath>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "hlm/haptic_server/local_model/local_model.h"
#include "hlm/haptic_server/scene/scene.h"
#include "tests/support/catch.h"
#include "tests/support/placed_shape.h"
#include "tests/support/random.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

/// Bodies around a tool that touches all of them, each with as many contacts with a floor.
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
  const Velocity v = Velocity::Constant(6, 0.01);
  ExternalWrenches external(1);
  external[0].F_W[2] = -1;
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
                    .period = 0.017,
                    .time = 1e-3 * i,
                    .v_VE = &v,
                    .external = external});
    }
    model->step(hand);
  }
  CHECK(guard.allocations() == 0);
  CHECK(model->bodies().size() == kMaxBodiesAhead);
  CHECK(model->velocity().allFinite());
}

/// A box as tool between movable ones on a floor, and a wavy skin beside them. held: it says enough
/// of them to move them.
std::unique_ptr<Scene> crowded_scene(const ToolDescription& tool, bool held) {
  const geometry::AnyShape box = geometry::Shape(geometry::Box{Vector3::Constant(0.1)});
  geometry::Mesh skin;
  skin.points = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, -0.1}};
  skin.triangles = {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};
  std::vector<PlacedShape> shapes{
      test::placed(box, {SideKind::kToolLink, 0}, Pose{}),
      test::placed(geometry::Shape(geometry::HalfSpace{}), {}, {{0, 0, -0.05}, {}}),
      test::placed(skin, {}, {{-0.5, -0.5, -0.049}, {}})};
  std::vector<BodyInertia> inertias;
  for (std::uint32_t i = 0; i < kMaxMovedBodies; ++i) {
    shapes.push_back(test::placed(box, {SideKind::kMovableBody, i}, Pose{}));
    if (held) inertias.push_back({.body = i, .mass = 1, .I_BCom = Matrix3::Identity()});
  }
  return std::make_unique<Scene>(std::move(shapes),
                                 std::span<const std::pair<std::uint32_t, std::uint32_t>>{}, tool,
                                 inertias);
}

TEST_CASE("Ticks and updates with a scene, and its change, allocate nothing and stay finite") {
  const bool held = GENERATE(false, true);
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  const auto model =
      std::make_unique<LocalModel>(tool, ToolModel(tool).neutral(), LocalModelParameters{}, 1e-3);
  const auto scene = crowded_scene(tool, held);
  const auto next = crowded_scene(tool, held);
  MovableBodies bodies;
  BodyPoses poses;
  for (std::uint32_t i = 0; i < kMaxMovedBodies; ++i) {
    MovableBody& body = bodies.emplace_back();
    body.id = i;
    body.p_WCom = {0.0999 * std::cos(0.785 * i), 0.0999 * std::sin(0.785 * i), -1e-4};
    body.W = Matrix6::Identity();
    body.A_W[2] = -9.81;
    poses.push_back({.body = i, .X_WB = {body.p_WCom, Quaternion::Identity()}});
  }
  const Configuration q = model->proxy().configuration();
  HandInput hand;
  hand.F[0] = 2;
  hand.F[2] = -5;
  int most = 0;
  std::size_t most_bodies = 0;
  const test::NoMalloc guard;
  for (int i = 0; i < 120; ++i) {
    if (i % 40 == 10) model->set_scene(scene.get());
    if (i % 40 == 25) model->set_scene(next.get());
    if (i % 40 == 38) model->set_scene(nullptr);
    if (i % 17 == 0) {
      model->adopt({.contacts = {},
                    .q_VE = q,
                    .age = 0.02,
                    .bodies = bodies,
                    .impulse_step = std::max(0.0, i - 20.5),
                    .period = 0.017,
                    .poses = poses});
    }
    model->step(hand);
    most = std::max(most, static_cast<int>(model->contacts().size()));
    most_bodies = std::max(most_bodies, model->bodies().size());
  }
  CHECK(guard.allocations() == 0);
  CHECK(most > 8);
  CHECK(most_bodies == (held ? kMaxMovedBodies : kMaxBodiesAhead));
  CHECK(model->velocity().allFinite());
}

}  // namespace
}  // namespace hlm::server
