// Contacts from shapes and poses alone, as the C interface, Python, MuJoCo and Bullet have them.
#include "hlm/client/shape_contacts.h"

#include <algorithm>
#include <limits>

#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm {
namespace {

using geometry::Box;
using geometry::HalfSpace;
using geometry::Mesh;
using geometry::Sphere;

constexpr double kEpsilon = 0.005;  // m
constexpr ContactSide kTool{SideKind::kToolLink, 0};
constexpr ContactSide kWorld{SideKind::kWorld, 0};

BodyShape box(const Vector3& size, const ContactSide& side) { return {Box{size}, side}; }
Pose at(double x, double y, double z) { return {Vector3(x, y, z), Quaternion::Identity()}; }

/// A closed box of triangles, centred.
Mesh box_mesh(const Vector3& size) {
  Mesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.points.push_back(
        Vector3(i & 1 ? 0.5 : -0.5, i & 2 ? 0.5 : -0.5, i & 4 ? 0.5 : -0.5).cwiseProduct(size));
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

/// The largest sideways part of a normal.
double sideways(std::span<const ShapeContacts::Found> found) {
  REQUIRE(!found.empty());
  double most = 0;
  for (const auto& one : found) most = std::max(most, one.contact.n_W.head<2>().norm());
  return most;
}

/// The largest sideways part of a normal while a cube that is pressed in by 1 mm slides over a
/// floor of slabs, each of which is 80 mm long and has its top at z = 0.
double sideways_on_slabs(const std::function<ContactSide(std::uint32_t)>& side) {
  std::vector<BodyShape> shapes{box(Vector3::Constant(0.04), kTool)};
  std::vector<Pose> X_WS{at(-0.1, 0, 0.019)};
  for (std::uint32_t i = 0; i < 5; ++i) {
    shapes.push_back(box({0.08, 0.3, 0.05}, side(i)));
    X_WS.push_back(at(-0.16 + 0.08 * i, 0, -0.025));
  }
  ShapeContacts contacts(shapes);
  double most = 0;
  for (; X_WS[0].p.x() < 0.1; X_WS[0].p.x() += 0.0007) {
    const auto found = contacts.find(X_WS, kEpsilon);
    const bool bears = std::ranges::count_if(found, [](const auto& one) {
                         return std::abs(one.contact.separation + 0.001) < 1e-6;
                       }) >= 4;
    CHECK(bears);
    most = std::max(most, sideways(found));
  }
  return most;
}

TEST_CASE("Slabs that stand still or are fixed to each other are one floor, whosever they are") {
  CHECK(sideways_on_slabs([](std::uint32_t) { return kWorld; }) < 1e-9);
  CHECK(sideways_on_slabs([](std::uint32_t i) { return ContactSide{SideKind::kWorld, i}; }) < 1e-9);
  const ContactSide body{SideKind::kMovableBody, 3};
  CHECK(sideways_on_slabs([&](std::uint32_t) { return body; }) < 1e-9);
}

TEST_CASE("A row of tiles behind another is felt nowhere, also far beside each of its tiles") {
  std::vector<BodyShape> shapes{box(Vector3::Constant(0.03), kTool)};
  std::vector<Pose> X_WS{at(0, 0, 0.01494)};
  for (int row = -3; row <= 3; ++row) {  // In bond, with gaps of 60 um.
    for (int i = -3; i <= 3; ++i) {
      shapes.push_back(box({0.03194, 0.02494, 0.02}, kWorld));
      X_WS.push_back(at(0.032 * (i + 0.07 * row), 0.025 * row, -0.01));
    }
  }
  ShapeContacts contacts(shapes);
  for (int step = 0; step < 500; ++step) {
    X_WS[0].p.head<2>() =
        Eigen::Vector2d(0.03 * std::sin(0.11 * step), 0.03 * std::sin(0.07 * step));
    for (const auto& one : contacts.find(X_WS, kEpsilon)) {
      if (one.contact.axis > 0) continue;
      CHECK(one.contact.n_W.z() > 0.999);
    }
  }
}

TEST_CASE("A slab of the world that moves is no longer part of the floor") {
  std::vector<BodyShape> shapes{box(Vector3::Constant(0.04), kTool),
                                box({0.2, 0.2, 0.1}, {SideKind::kWorld, 1}),
                                box({0.2, 0.2, 0.1}, {SideKind::kWorld, 2})};
  std::vector<Pose> X_WS{at(0, 0, 0.019), at(-0.1, 0, -0.05), at(0.1, 0, -0.05)};
  ShapeContacts contacts(shapes);
  CHECK(sideways(contacts.find(X_WS, kEpsilon)) < 1e-9);
  X_WS[2].p.z() += 0.03;  // A step, which the tool meets from the side.
  X_WS[0].p.x() = -0.0195;
  CHECK(sideways(contacts.find(X_WS, kEpsilon)) > 0.99);
  X_WS[2].p.z() -= 0.03;  // It came back, but may go again.
  X_WS[0].p.x() = -0.05;
  CHECK(sideways(contacts.find(X_WS, kEpsilon)) < 1e-9);
}

TEST_CASE("Shapes of one body that move against each other are found where they are") {
  const ContactSide body{SideKind::kMovableBody, 1};
  ShapeContacts contacts(
      std::vector<BodyShape>{{Sphere{0.02}, kTool}, {Sphere{0.02}, body}, {Sphere{0.02}, body}});
  std::vector<Pose> X_WS{at(0, 0, 0), at(0.042, 0, 0), at(0.5, 0, 0)};
  CHECK(contacts.find(X_WS, kEpsilon).size() == 1);
  X_WS[2] = at(0, 0.043, 0);
  const auto found = contacts.find(X_WS, kEpsilon);
  REQUIRE(found.size() == 2);
  const double both = found[0].contact.separation + found[1].contact.separation;
  CHECK(std::abs(both - 0.005) < 1e-6);
  CHECK(found[0].shape_b != found[1].shape_b);
}

TEST_CASE("Of 8 x 8 feet under a plate the outermost stay, and all corners of the plate") {
  std::vector<BodyShape> shapes{box({0.4, 0.4, 0.02}, kTool)};
  std::vector<Pose> X_WS{at(0, 0, 0.009)};
  for (int i = 0; i < 64; ++i) {
    shapes.push_back(box({0.01, 0.01, 0.05}, kWorld));
    X_WS.push_back(at((i % 8 - 3.5) * 0.39 / 7, (i / 8 - 3.5) * 0.39 / 7, -0.025));
  }
  ShapeContacts contacts(shapes);
  const auto found = contacts.find(X_WS, kEpsilon);
  CHECK(found.size() <= kMaxContacts);
  Eigen::AlignedBox3d loaded;
  for (const auto& one : found) {
    if (one.contact.separation < 0) loaded.extend(one.contact.p_WC);
  }
  CHECK(loaded.sizes().head<2>().minCoeff() > 0.399);
}

TEST_CASE("A mesh is a solid: a bar that reaches over its edge lies on it") {
  Mesh step = box_mesh({0.1, 0.1, 0.05});  // Not convex: with a dent in its lower side.
  step.points.emplace_back(0, 0, 0);
  step.triangles.erase(step.triangles.begin(), step.triangles.begin() + 2);
  for (const auto& [a, b] : {std::pair(0, 2), {2, 3}, {3, 1}, {1, 0}}) {
    step.triangles.push_back({a, b, 8});
  }
  for (const ContactSide& side : {kWorld, ContactSide{SideKind::kMovableBody, 1}}) {
    ShapeContacts contacts({box({0.3, 0.02, 0.02}, kTool), {step, side}});
    for (double x = -0.12; x < 0.12; x += 0.001) {
      const std::vector<Pose> X_WS{at(x, 0.003, 0.034), at(0, 0, 0)};
      const auto found = contacts.find(X_WS, kEpsilon);
      REQUIRE(sideways(found) < 1e-9);
      const auto deepest =
          std::ranges::min(found, {}, [](const auto& one) { return one.contact.separation; });
      CHECK(std::abs(deepest.contact.separation + 0.001) < 1e-6);
      CHECK(deepest.contact.n_W.z() > 0.999);
    }
  }
}

/// Two triangles in the plane z = 0, which look down.
Mesh sheet(double size) {
  Mesh mesh;
  for (int i = 0; i < 4; ++i) {
    mesh.points.emplace_back(i & 1 ? size / 2 : -size / 2, i & 2 ? size / 2 : -size / 2, 0);
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}};
  return mesh;
}

TEST_CASE("An open sheet is thin and felt from both sides, whichever way its triangles look") {
  constexpr double kRadius = 0.01;  // m
  ShapeContacts contacts({{Sphere{kRadius}, kTool}, {sheet(0.2), kWorld}});
  for (const double side : {1.0, -1.0}) {
    for (double height = 0.014; height > 0.006; height -= 0.0005) {  // m, of the centre.
      const std::vector<Pose> X_WS{at(0.013, -0.03, side * height), at(0, 0, 0)};
      const auto found = contacts.find(X_WS, kEpsilon);
      REQUIRE(found.size() == 1);
      CHECK(std::abs(found[0].contact.separation - (height - kRadius)) < 1e-6);
      CHECK(found[0].contact.n_W.z() == side);
    }
    const std::vector<Pose> deep{at(0.013, -0.03, -side * 0.001), at(0, 0, 0)};
    const auto pressed = contacts.find(deep, kEpsilon);  // By more than half of the ball.
    REQUIRE(pressed.size() == 1);
    CHECK(pressed[0].contact.n_W.z() == side);
    contacts.find({{at(0, 0, 1), at(0, 0, 0)}}, kEpsilon);  // It went away.
  }
}

TEST_CASE("A triangle that is too thin to be felt does not spoil its mesh") {
  Mesh mesh;
  for (const auto& [x, y] :
       {std::pair{-0.1, -0.1}, {0.1, -0.1}, {0.1, 0.1}, {-0.1, 0.1}, {0.0, -0.1 + 3e-7}}) {
    mesh.points.emplace_back(x, y, 0);
  }
  mesh.triangles = {{0, 1, 4}, {0, 4, 3}, {4, 1, 2}, {4, 2, 3}};
  ShapeContacts contacts({{Sphere{0.01}, kTool}, {mesh, kWorld}});
  for (const double x : {-0.05, 0.0, 0.05}) {
    const std::vector<Pose> X_WS{at(x, 0, 0.009), at(0, 0, 0)};
    const auto found = contacts.find(X_WS, kEpsilon);
    REQUIRE(!found.empty());
    CHECK(std::abs(found[0].contact.separation + 0.001) < 1e-6);
  }
}

TEST_CASE("The rim of a sheet is felt from beside it") {
  constexpr double kRadius = 0.01;  // m
  ShapeContacts contacts({{Sphere{kRadius}, kTool}, {sheet(0.2), kWorld}});
  for (const double height : {0.0, 0.002, -0.002, 0.005, -0.005}) {
    for (double apart = 0.0045; apart > -0.001; apart -= 0.0005) {  // m
      const double x = 0.1 + std::sqrt(std::pow(kRadius + apart, 2) - height * height);
      const std::vector<Pose> X_WS{at(x, 0.01, height), at(0, 0, 0)};
      const auto found = contacts.find(X_WS, kEpsilon);
      INFO(x << " m, " << height << " m");
      REQUIRE(found.size() == 1);
      const double distance = std::hypot(x - 0.1, height);
      CHECK(std::abs(found[0].contact.separation - (distance - kRadius)) < 2e-5);
      CHECK(std::abs(found[0].contact.n_W.x() - (x - 0.1) / distance) < 0.01);
    }
  }
}

TEST_CASE("A box without a lid is hollow") {
  Mesh box = box_mesh({0.1, 0.1, 0.1});
  box.triangles.erase(box.triangles.begin() + 2, box.triangles.begin() + 4);
  ShapeContacts contacts({{Sphere{0.01}, kTool}, {box, kWorld}});
  const auto normal_at = [&](const Vector3& p) -> Vector3 {
    const auto found = contacts.find({{at(p.x(), p.y(), p.z()), at(0, 0, 0)}}, kEpsilon);
    REQUIRE(found.size() == 1);
    CHECK(std::abs(found[0].contact.separation - 0.002) < 1e-6);
    return found[0].contact.n_W;
  };
  CHECK(normal_at({0, 0, -0.038}) == Vector3::UnitZ());   // The floor from inside,
  CHECK(normal_at({0, 0, -0.062}) == -Vector3::UnitZ());  // from outside,
  CHECK(normal_at({0.038, 0, 0}) == -Vector3::UnitX());   // and a wall.
  CHECK(normal_at({0.062, 0, 0}) == Vector3::UnitX());
  CHECK(contacts.find({{at(0, 0, 0.05), at(0, 0, 0)}}, kEpsilon).empty());
}

/// A closed prism of height 0.1 m over an L, about the origin.
Mesh l_prism() {
  const std::vector<Eigen::Vector2d> outline{{0, 0},     {0.2, 0},   {0.2, 0.1},
                                             {0.1, 0.1}, {0.1, 0.2}, {0, 0.2}};
  Mesh mesh;
  for (const double z : {-0.05, 0.05}) {
    for (const auto& p : outline) mesh.points.emplace_back(p.x() - 0.1, p.y() - 0.1, z);
  }
  for (const auto& [a, b, c] : {std::array{0, 1, 3}, {1, 2, 3}, {0, 3, 5}, {3, 4, 5}}) {
    mesh.triangles.push_back({a, c, b});
    mesh.triangles.push_back({a + 6, b + 6, c + 6});
  }
  for (int i = 0; i < 6; ++i) {
    const int next = (i + 1) % 6;
    mesh.triangles.push_back({i, next, next + 6});
    mesh.triangles.push_back({i, next + 6, i + 6});
  }
  return mesh;
}

TEST_CASE("A ball on a wall of a mesh near its edge does not touch what lies round the corner") {
  ShapeContacts contacts({{Sphere{0.006}, kTool}, {l_prism(), kWorld}});
  for (double depth = 0; depth < 0.001; depth += 0.00005) {
    for (double z = 0.0499; z > 0.04; z -= 0.0005) {
      for (const double side : {1.0, -1.0}) {
        const std::vector<Pose> X_WS{at(-0.106 + depth, 0, side * z), at(0, 0, 0)};
        const auto found = contacts.find(X_WS, kEpsilon);
        INFO(depth << " m deep, " << 0.05 - z << " m off the edge");
        REQUIRE(!found.empty());
        for (const auto& one : found) {
          if (one.contact.separation > 0.001) continue;
          CHECK(std::abs(one.contact.separation + depth) < 1e-5);
          CHECK(one.contact.n_W.x() < -0.999);
        }
      }
    }
  }
}

TEST_CASE("A cube on a box of sheets that reaches over its edge does not touch the inner wall") {
  Mesh lidded = box_mesh({0.3, 0.3, 0.1});
  lidded.triangles.erase(lidded.triangles.begin(), lidded.triangles.begin() + 2);
  ShapeContacts contacts({box(Vector3::Constant(0.02), kTool), {lidded, kWorld}});
  for (double x = 0.138; x < 0.158; x += 0.0005) {
    const std::vector<Pose> X_WS{at(x, 0, 0.0597), at(0, 0, 0)};
    const auto found = contacts.find(X_WS, kEpsilon);
    INFO(x << " m");
    REQUIRE(!found.empty());
    for (const auto& one : found) {
      if (one.contact.separation > 0) continue;
      CHECK(std::abs(one.contact.separation + 0.0003) < 1e-5);
      CHECK(one.contact.n_W.z() > 0.999);
    }
  }
}

TEST_CASE("A cube on its corner is felt all over a flat sheet of many triangles") {
  constexpr int kCells = 12;
  constexpr double kSide = 0.3;  // m
  Mesh grid;
  for (int i = 0; i <= kCells; ++i) {
    for (int j = 0; j <= kCells; ++j) {
      grid.points.emplace_back(kSide * i / kCells - kSide / 2, kSide * j / kCells - kSide / 2, 0);
    }
  }
  for (int i = 0; i < kCells; ++i) {
    for (int j = 0; j < kCells; ++j) {
      const int a = (kCells + 1) * i + j;
      const int b = a + kCells + 1;
      grid.triangles.push_back({a, b, b + 1});
      grid.triangles.push_back({a, b + 1, a + 1});
    }
  }
  ShapeContacts contacts({box(Vector3::Constant(0.02), kTool), {grid, kWorld}});
  test::Random random;
  for (int i = 0; i < 3000; ++i) {
    const Quaternion R = random.rotation();
    const double lowest = 0.01 * (R.conjugate() * Vector3::UnitZ()).cwiseAbs().sum();
    const double depth = random.uniform(0.0001, 0.002);
    const Pose X_WT{{random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), lowest - depth}, R};
    const auto found = contacts.find({{X_WT, at(0, 0, 0)}}, kEpsilon);
    double deepest = 0;
    for (const auto& one : found) deepest = std::max(deepest, -one.contact.separation);
    INFO(i << ": " << X_WT.p.transpose() << ", " << R.coeffs().transpose());
    CHECK(std::abs(deepest - depth) < 1e-5);
  }
}

TEST_CASE("Bodies near the tool come with their own contacts, those on them too, but no farther") {
  const auto body = [](std::uint32_t i) { return ContactSide{SideKind::kMovableBody, i}; };
  std::vector<BodyShape> shapes{box(Vector3::Constant(0.04), kTool)};
  std::vector<Pose> X_WS{at(0, 0, 0)};
  for (std::uint32_t i = 0; i < 4; ++i) {
    shapes.push_back(box(Vector3::Constant(0.04), body(i)));
    X_WS.push_back(at(0, 0, -0.04 * (i + 1)));
  }
  ShapeContacts contacts(shapes);
  std::vector<std::pair<ContactSide, ContactSide>> pairs;
  for (const auto& one : contacts.find(X_WS, kEpsilon)) {
    if (one.contact.axis == 0) pairs.emplace_back(one.contact.a, one.contact.b);
  }
  std::ranges::sort(pairs);
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  CHECK(pairs == std::vector<std::pair<ContactSide, ContactSide>>{
                     {kTool, body(0)}, {body(0), body(1)}, {body(1), body(2)}});
}

TEST_CASE("Of more contacts of bodies than there is room for the outermost stay") {
  const ContactSide body{SideKind::kMovableBody, 1};
  std::vector<BodyShape> shapes{box({0.4, 0.4, 0.02}, kTool), box({0.4, 0.4, 0.02}, body)};
  std::vector<Pose> X_WS{at(0, 0, 0.03), at(0, 0, 0.01)};
  for (int i = 0; i < 100; ++i) {
    shapes.push_back(box({0.01, 0.01, 0.05}, kWorld));
    X_WS.push_back(at((i % 10 - 4.5) * 0.39 / 9, (i / 10 - 4.5) * 0.39 / 9, -0.025));
  }
  ShapeContacts contacts(shapes);
  for (int call = 0; call < 2; ++call) {
    const auto found = contacts.find(X_WS, kEpsilon);
    CHECK(found.size() <= kMaxContacts);
    Eigen::AlignedBox3d of_body;
    for (const auto& one : found) {
      if (one.contact.a == body) of_body.extend(one.contact.p_WC);
    }
    CHECK(of_body.sizes().head<2>().minCoeff() > 0.399);
  }
}

TEST_CASE("A world shape that begins to move leaves other contacts their names and seams") {
  std::vector<BodyShape> shapes{box(Vector3::Constant(0.04), kWorld)};  // It moves.
  std::vector<Pose> X_WS{at(0, 0.5, 0)};
  for (int i = 0; i < 5; ++i) {
    shapes.push_back(box({0.08, 0.3, 0.05}, kWorld));
    X_WS.push_back(at(-0.16 + 0.08 * i, 0, -0.025));
  }
  shapes.push_back(box(Vector3::Constant(0.04), kTool));
  X_WS.push_back(at(0.04, 0, 0.019));
  ShapeContacts contacts(shapes);
  std::vector<std::uint64_t> names;
  for (int call = 0; call < 4; ++call) {
    X_WS[0].p.x() += call > 0 ? 0.01 : 0;
    std::vector<std::uint64_t> now;
    const auto found = contacts.find(X_WS, kEpsilon);
    CHECK(sideways(found) < 1e-9);
    for (const auto& one : found) now.push_back(one.contact.identity);
    if (call > 0) CHECK(now == names);
    names = now;
  }
}

TEST_CASE("Shapes that are excluded do not touch") {
  std::vector<BodyShape> shapes{
      {Sphere{0.02}, kTool}, {HalfSpace{}, kWorld}, {Sphere{0.02}, kWorld}};
  ShapeContacts contacts(shapes, [](std::size_t a, std::size_t b) { return a + b != 2; });
  const std::vector<Pose> X_WS{at(0, 0, 0.02), at(0, 0, 0), at(0.04, 0, 0.02)};
  const auto found = contacts.find(X_WS, kEpsilon);
  REQUIRE(found.size() == 1);
  CHECK(found[0].shape_b == 1);
}

TEST_CASE("A shape without a pose has no contacts until it has one") {
  ShapeContacts contacts(
      std::vector<BodyShape>{{Sphere{0.02}, kTool}, {HalfSpace{}, kWorld}, {Sphere{0.02}, kWorld}});
  std::vector<Pose> X_WS{at(0, 0, 0.02), at(0, 0, 0),
                         at(std::numeric_limits<double>::quiet_NaN(), 0, 0)};
  CHECK(contacts.find(X_WS, kEpsilon).size() == 1);
  X_WS[2] = at(0.04, 0, 0.02);
  CHECK(contacts.find(X_WS, kEpsilon).size() == 2);
  X_WS[0].R.coeffs().setZero();
  CHECK(contacts.find(X_WS, kEpsilon).empty());
}

TEST_CASE("Shapes that cannot be used are named") {
  using Catch::Matchers::ContainsSubstring;
  const auto refuses = [](BodyShape shape, const char* what) {
    CHECK_THROWS_WITH(
        ShapeContacts(std::vector<BodyShape>{{Sphere{0.02}, kTool}, std::move(shape)}),
        ContainsSubstring("shape 1") && ContainsSubstring(what));
  };
  refuses({Sphere{-1}, kWorld}, "radius");
  refuses({HalfSpace{}, {SideKind::kMovableBody, 0}}, "half-space must be the world's");
  refuses({Mesh{}, kWorld}, "triangles");
  Mesh broken = box_mesh({1, 1, 1});
  broken.points[3].x() = std::numeric_limits<double>::infinity();
  refuses({broken, kWorld}, "coordinate inf m");
}

}  // namespace
}  // namespace hlm
