// Contacts that the local model finds itself: s = σ + δ (docs/method.md 18).
#include "hlm/haptic_server/local_model/scene_contacts.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "hlm/haptic_server/local_model/local_model.h"
#include "tests/support/catch.h"
#include "tests/support/placed_shape.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

constexpr double kStep = 1e-3;  // s
constexpr std::uint32_t kBody = 7;

PlacedShape placed(const geometry::AnyShape& shape, ContactSide side,
                   const Vector3& p = Vector3::Zero()) {
  return test::placed(shape, side, {p, Quaternion::Identity()}, {0});
}

PlacedShape ball() {
  return placed(geometry::Shape(geometry::Sphere{0.01}), {SideKind::kToolLink, 0});
}

/// A free tool of 0.5 kg at p_W in a scene.
struct Model {
  Model(std::vector<PlacedShape> shapes, const Vector3& p_W, double stiffness = 4000)
      : tool(test::rigid_tool(0.5, Matrix3::Identity() * 1e-3)),
        scene(std::move(shapes), {}, tool) {
    Configuration q = ToolModel(tool).neutral();
    q.head<3>() = p_W;
    LocalModelParameters parameters;
    parameters.stiffness = stiffness;
    parameters.static_friction = parameters.kinetic_friction = 0;
    model = std::make_unique<LocalModel>(tool, q, parameters, kStep);
    model->set_scene(&scene);
  }

  /// A body that moves regardless of the tool, where an update says.
  void adopt(const Vector3& p_WB) {
    const BodyPoses poses{{.body = kBody, .X_WB = {p_WB, Quaternion::Identity()}}};
    model->adopt(
        {.contacts = ReportedContacts(), .q_VE = model->proxy().configuration(), .poses = poses});
  }

  double step(const Vector3& push) {
    HandInput hand;
    hand.F.head<3>() = push;
    return model->step(hand).F.head<3>().norm();
  }
  Vector3 position() const { return model->proxy().X_WH().p; }

  ToolDescription tool;
  Scene scene;
  std::unique_ptr<LocalModel> model;
};

TEST_CASE("A ball that slides over a dome under a push is as deep as its force, and not deformed") {
  Model m({ball(), placed(geometry::Shape(geometry::Sphere{0.1}), {})}, {0, 0, 0.1101});
  for (int i = 0; i < 300; ++i) m.step({0, 0, -2});
  // Down the dome's side.
  for (int i = 0; i < 250; ++i) {
    const double force = m.step(-2 * m.position().normalized() + Vector3(0.3, 0, 0));
    const double depth = 0.11 - m.position().norm();
    REQUIRE(m.model->contacts().size() == 1);
    CHECK(m.model->contacts()[0].deformation.delta == 0);
    CHECK(force > 1);
    // F = k d - b v_n; the velocity along the normal is below 2 mm/s.
    CHECK(depth == Approx(force / 4000).margin(2e-5));
  }
  CHECK(m.position().x() > 0.005);  // m: it slid
}

/// A trough along y: the lower part of a cylinder of 100 mm about the y axis, of facets of 0.01
/// rad.
geometry::Mesh trough() {
  geometry::Mesh mesh;
  constexpr int kFacets = 140;
  for (int i = 0; i <= kFacets; ++i) {
    const double angle = 0.01 * (i - kFacets / 2);
    for (const double y : {-0.05, 0.05}) {
      mesh.points.emplace_back(0.1 * std::sin(angle), y, -0.1 * std::cos(angle));
    }
  }
  for (int i = 0; i < kFacets; ++i) {
    mesh.triangles.push_back({2 * i, 2 * i + 2, 2 * i + 1});
    mesh.triangles.push_back({2 * i + 1, 2 * i + 2, 2 * i + 3});
  }
  return mesh;
}

TEST_CASE(
    "A ball that slides down a trough is not deformed: only the geometry's change does that") {
  const double start = 0.5;  // rad
  Model m({ball(), placed(trough(), {})}, {0.0899 * std::sin(start), 0, -0.0899 * std::cos(start)});
  for (int i = 0; i < 300; ++i) {
    m.step({0, 0, -2});
    for (const LocalContact& contact : m.model->contacts()) {
      CHECK(std::abs(contact.deformation.delta) < 1e-12);
    }
  }
  CHECK(m.position().x() < 0.02);  // m: it slid
}

/// An open sheet of triangles, level or wavy.
geometry::Mesh sheet(double height) {
  geometry::Mesh mesh;
  constexpr int kCells = 20;
  for (int i = 0; i <= kCells; ++i) {
    for (int j = 0; j <= kCells; ++j) {
      const double x = 0.01 * (i - kCells / 2);
      const double y = 0.01 * (j - kCells / 2);
      mesh.points.emplace_back(x, y, height * std::cos(60 * x) * std::cos(60 * y) - height);
    }
  }
  for (int i = 0; i < kCells; ++i) {
    for (int j = 0; j < kCells; ++j) {
      const int a = i * (kCells + 1) + j;
      mesh.triangles.push_back({a, a + kCells + 1, a + kCells + 2});
      mesh.triangles.push_back({a, a + kCells + 2, a + 1});
    }
  }
  return mesh;
}

TEST_CASE("A sheet holds a ball of 2 mm and a plate of 0.5 mm that are pressed in deeper than that",
          "[optimised]") {
  for (const double stiffness : {4000.0, 1000.0}) {
    const auto held = [&](const geometry::Shape& shape, double touching, const Vector3& at) {
      Model m({placed(shape, {SideKind::kToolLink, 0}), placed(sheet(0), {})},
              at + Vector3(0, 0, touching + 1e-4), stiffness);
      double force = 0;
      for (int i = 0; i < 1500; ++i) force = m.step({0, 0, -9});
      CHECK(force == Approx(9).margin(0.05));
      CHECK(m.position().z() > touching - 1.2 * 9 / stiffness);
      CHECK(m.position().z() < touching);
    };
    held(geometry::Sphere{0.001}, 0.001, {0.0013, 0.0007, 0});
    held(geometry::Box{{0.04, 0.04, 0.0005}}, 0.00025, {0.0013, 0.0007, 0});
  }
}

TEST_CASE("A tool that is inside as its scene comes feels no step, and is pushed out slowly") {
  Model m({ball(), placed(geometry::Shape(geometry::Box{{0.2, 0.2, 0.2}}), {}, {0, 0, -0.1})},
          {0, 0, 0.005});
  double before = 0;
  double largest = 0;
  for (int i = 0; i < 400; ++i) {
    const double force = m.step({0, 0, -1});
    largest = std::max(largest, force - before);
    before = force;
  }
  CHECK(largest < 0.5);
  CHECK(before == Approx(1).epsilon(0.05));
  REQUIRE(m.model->contacts().size() == 1);
  CHECK(m.model->contacts()[0].deformation.delta > 0.003);
}

TEST_CASE(
    "A body that an update takes away releases its load step by step, one that it brings adds "
    "none") {
  Model m({ball(), placed(geometry::Shape(geometry::Box{{0.2, 0.2, 0.2}}),
                          {SideKind::kMovableBody, kBody})},
          {0, 0, 0.1101});
  m.adopt({0, 0, 0});
  for (int i = 0; i < 300; ++i) m.step({0, 0, -3});
  REQUIRE(m.step({0, 0, -3}) == Approx(3).epsilon(0.02));
  // Nearer by 4 mm.
  m.adopt({0, 0, 0.004});
  CHECK(m.step({0, 0, -3}) == Approx(3).margin(0.05));
  // And gone.
  m.adopt({0, 0, -1});
  double before = 3;
  double fall = 0;
  for (int i = 0; i < 20; ++i) {
    const double force = m.step({0, 0, -3});
    fall = std::max(fall, before - force);
    before = force;
  }
  CHECK(fall <= 0.51);  // N: the release step
  CHECK(before < 0.01);
}

/// A ring of 16 boxes, 6 mm thick, at a mean radius of 22 mm. wide: their width, in parts of that
/// with which they meet at the mean radius; at 1.136 at the outer one, but for a notch of 0.01 mm.
std::vector<PlacedShape> ring(double wide) {
  constexpr int kBoxes = 16;
  constexpr double kRadius = 0.022;
  std::vector<PlacedShape> boxes;
  for (int i = 0; i < kBoxes; ++i) {
    const double angle = 2 * std::numbers::pi * i / kBoxes;
    const double width = 2 * kRadius * std::tan(std::numbers::pi / kBoxes) * wide;
    PlacedShape box =
        placed(geometry::Shape(geometry::Box{{0.006, width, 0.012}}), {SideKind::kToolLink, 0},
               {kRadius * std::cos(angle), kRadius * std::sin(angle), 0.006});
    box.X_BS.R = rotation_from_vector(Vector3(0, 0, angle));
    boxes.push_back(box);
  }
  return boxes;
}

TEST_CASE("A ring of boxes rests on a slab, however narrow the notches between them are",
          "[optimised]") {
  const double wide = GENERATE(0.9, 1.0, 1.1, 1.115, 1.125, 1.13, 1.135, 1.1364, 1.14, 1.2);
  std::vector<PlacedShape> shapes = ring(wide);
  shapes.push_back(placed(geometry::Shape(geometry::Box{{0.2, 0.2, 0.1}}), {}, {0, 0, -0.05}));
  Model m(shapes, {0, 0, 1e-4});
  double force = 0;
  for (int i = 0; i < 500; ++i) force = m.step({0, 0, -2});
  CAPTURE(wide, m.position().z());
  CHECK(force == Approx(2).epsilon(0.01));
  CHECK(m.position().z() > -2 / 4000.0);  // m: on more than one contact
  const Quaternion R = m.model->proxy().X_WH().R;
  CHECK(R.vec().norm() < 1e-4);
}

TEST_CASE("Over the seam of two tiles a contact goes on as the one that it was") {
  Model m({ball(), placed(geometry::Shape(geometry::Box{{0.1, 0.1, 0.1}}), {}, {-0.05, 0, -0.05}),
           placed(geometry::Shape(geometry::Box{{0.1, 0.1, 0.1}}), {}, {0.05, 0, -0.05})},
          {-0.02, 0, 0.005});
  // Deformed by 5 mm, which heals slowly.
  for (int i = 0; i < 50; ++i) m.step({0, 0, -1});
  double lowest = 1;
  double highest = 0;
  while (m.position().x() < 0.02) {
    const double force = m.step({1, 0, -1});
    lowest = std::min(lowest, force);
    highest = std::max(highest, force);
  }
  CHECK(lowest > 0.8);
  CHECK(highest < 1.3);
}

}  // namespace
}  // namespace hlm::server
