// Are the contacts of a pair complete, with the same identities from frame to frame?
#include <map>
#include <numbers>
#include <utility>

#include "tests/geometry/reference.h"
#include "tests/support/catch.h"

namespace hlm::geometry::test {
namespace {

constexpr double kEpsilon = 0.005;   // m.
constexpr double kRounding = 1e-12;  // m.
constexpr double kRightAngle = std::numbers::pi / 2;

const Box kCube{Vector3(0.04, 0.04, 0.04)};
const Box kSlab{Vector3(0.4, 0.4, 0.04)};
const Placed kSlabAtRest{kSlab, Pose{}};

using Key = std::pair<Feature, Feature>;
using Contacts = std::map<Key, ManifoldPoint>;

Contacts by_key(const Manifold& manifold) {
  Contacts contacts;
  for (const ManifoldPoint& point : manifold) {
    contacts[{point.tool_feature, point.body_feature}] = point;
  }
  return contacts;
}

std::vector<Key> keys_of(const Manifold& manifold) {
  std::vector<Key> keys;
  for (const auto& [key, point] : by_key(manifold)) keys.push_back(key);
  return keys;
}

std::size_t count(const Manifold& manifold, FeatureKind tool, FeatureKind body) {
  return static_cast<std::size_t>(
      std::count_if(manifold.begin(), manifold.end(), [&](const ManifoldPoint& point) {
        return point.tool_feature.kind == tool && point.body_feature.kind == body;
      }));
}

/// `shape` above the slab with the separation, its height along z being `height`.
Placed above_slab(const Shape& shape, double height, double separation,
                  const Quaternion& R = Quaternion::Identity()) {
  return {shape, {Vector3(0.01, -0.02, (kSlab.size.z() + height) / 2 + separation), R}};
}

}  // namespace

TEST_CASE("A box on a slab has 4 contacts, one at each of its corners, from overlap to epsilon") {
  for (const double separation : {-0.02, -1e-3, -1e-9, 0.0, 1e-9, 1e-3, 0.005}) {
    const Manifold manifold =
        contacts_of(above_slab(kCube, 0.04, separation), kSlabAtRest, kEpsilon + 1e-9);
    REQUIRE(manifold.size() == 4);
    CHECK(count(manifold, FeatureKind::kVertex, FeatureKind::kFace) == 4);
    for (const ManifoldPoint& point : manifold) {
      CHECK(point.separation == Approx(separation).margin(kRounding));
      CHECK(point.p_WC.z() == Approx(0.02).margin(kRounding));
      CHECK(point.n_W.isApprox(Vector3::UnitZ()));
    }
  }
  CHECK(contacts_of(above_slab(kCube, 0.04, kEpsilon + 1e-6), kSlabAtRest, kEpsilon).empty());
}

TEST_CASE("A slab as the tool on a box has 4 contacts of its face with the box's corners") {
  const Placed slab{kSlab, {Vector3(0.05, 0, 0.041), Quaternion::Identity()}};
  const Manifold manifold = contacts_of(slab, {kCube, Pose{}}, kEpsilon);
  REQUIRE(manifold.size() == 4);
  CHECK(count(manifold, FeatureKind::kFace, FeatureKind::kVertex) == 4);
  for (const ManifoldPoint& point : manifold) {
    CHECK(point.p_WC.z() == Approx(0.02).margin(kRounding));
    CHECK(point.separation == Approx(0.001).margin(kRounding));
  }
}

TEST_CASE("Crossed boards have 4 contacts of edge with edge") {
  const Placed body{Box{Vector3(0.3, 0.04, 0.02)}, Pose{}};
  const Placed tool{Box{Vector3(0.04, 0.3, 0.02)}, {Vector3(0, 0, 0.019), Quaternion::Identity()}};
  const Manifold manifold = contacts_of(tool, body, kEpsilon);
  CHECK(manifold.size() == 4);
  CHECK(count(manifold, FeatureKind::kEdge, FeatureKind::kEdge) == 4);
}

TEST_CASE("Equal cubes turned by 45 degrees on each other have 8 contacts of edge with edge") {
  const Quaternion turned = rotation_from_vector(kRightAngle / 2 * Vector3::UnitZ());
  const Manifold manifold =
      contacts_of({kCube, {Vector3(0, 0, 0.04), turned}}, {kCube, Pose{}}, kEpsilon);
  CHECK(manifold.size() == 8);
  CHECK(count(manifold, FeatureKind::kEdge, FeatureKind::kEdge) == 8);
  CHECK(has_unique_keys(manifold));
}

TEST_CASE("A box half over a slab's border has 2 corners on its face and 2 edges on its border") {
  Placed tool = above_slab(kCube, 0.04, -0.001);
  tool.X_WS.p.x() = 0.2;
  const Manifold manifold = contacts_of(tool, kSlabAtRest, kEpsilon);
  CHECK(manifold.size() == 4);
  CHECK(count(manifold, FeatureKind::kVertex, FeatureKind::kFace) == 2);
  CHECK(count(manifold, FeatureKind::kEdge, FeatureKind::kEdge) == 2);
  for (const ManifoldPoint& point : manifold) CHECK(point.p_WC.x() <= 0.2 + kRounding);
}

TEST_CASE(
    "Each corner of a tilted box has its own distance to the slab, and only near ones count") {
  const double tilt = 0.1;
  const double low = -0.001;
  const double height = 0.04 * (std::cos(tilt) + std::sin(tilt));
  const Placed tool = above_slab(kCube, height, low, rotation_from_vector({0, tilt, 0}));
  const Manifold all = contacts_of(tool, kSlabAtRest, kEpsilon);
  REQUIRE(all.size() == 4);
  CHECK(count(all, FeatureKind::kVertex, FeatureKind::kFace) == 4);
  for (const ManifoldPoint& point : all) {
    const bool is_low = std::abs(point.separation - low) < kRounding;
    const bool is_high = std::abs(point.separation - low - 0.04 * std::sin(tilt)) < kRounding;
    CHECK((is_low || is_high));
  }
  CHECK(contacts_of(tool, kSlabAtRest, 0.001).size() == 2);
}

TEST_CASE("Edges that cross have one contact, edge with edge") {
  const Quaternion on_edge = rotation_from_vector({kRightAngle / 2, 0, 0});
  const Quaternion across = rotation_from_vector({0, 0, 1}) * on_edge;
  for (const double separation : {-0.002, 0.002}) {
    const Placed tool{kCube, {Vector3(0, 0, 0.04 * std::sqrt(2) + separation), across}};
    const Manifold manifold = contacts_of(tool, {kCube, {Vector3::Zero(), on_edge}}, kEpsilon);
    REQUIRE(manifold.size() == 1);
    CHECK(count(manifold, FeatureKind::kEdge, FeatureKind::kEdge) == 1);
    CHECK(manifold[0].separation == Approx(separation).margin(kRounding));
    CHECK(manifold[0].n_W.isApprox(Vector3::UnitZ(), 1e-9));
    CHECK(manifold[0].p_WC.isApprox(Vector3(0, 0, 0.02 * std::sqrt(2)), 1e-9));
  }
}

TEST_CASE("Parallel edges, corner to corner, have a contact at either end of their overlap") {
  const Placed tool{kCube, {Vector3(0.042, 0.042, 0.01), Quaternion::Identity()}};
  const Manifold manifold = contacts_of(tool, {kCube, Pose{}}, kEpsilon);
  REQUIRE(manifold.size() == 2);
  CHECK(count(manifold, FeatureKind::kVertex, FeatureKind::kEdge) == 1);
  CHECK(count(manifold, FeatureKind::kEdge, FeatureKind::kVertex) == 1);
  for (const ManifoldPoint& point : manifold) {
    CHECK(point.separation == Approx(0.002 * std::sqrt(2)).margin(kRounding));
    CHECK((point.p_WC.head<2>() - Eigen::Vector2d(0.02, 0.02)).norm() < kRounding);
  }
}

TEST_CASE(
    "A cylinder has contacts all round a flat cap, at its lowest point when tilted, and at "
    "both ends of its line when it lies") {
  const Cylinder cylinder{0.02, 0.06};
  const Manifold standing = contacts_of(above_slab(cylinder, 0.06, -1e-4), kSlabAtRest, kEpsilon);
  CHECK(standing.size() == 8);
  CHECK(count(standing, FeatureKind::kVertex, FeatureKind::kFace) == 8);

  const double tilt = 0.02;
  const double height = 0.06 * std::cos(tilt) + 0.04 * std::sin(tilt);
  const Quaternion R = rotation_from_vector(tilt * Vector3(0.6, 0.8, 0));
  const Manifold tilted =
      contacts_of(above_slab(cylinder, height, -1e-4, R), kSlabAtRest, kEpsilon);
  CHECK(tilted.size() == 9);
  CHECK(smallest_separation(tilted) == Approx(-1e-4).margin(1e-6));
  CHECK(count(tilted, FeatureKind::kEdge, FeatureKind::kFace) == 1);

  std::vector<Key> before;
  for (const double roll : {0.0, 0.1, 1.0, 2.0}) {
    const Quaternion lying =
        rotation_from_vector({kRightAngle, 0, 0}) * rotation_from_vector({0, 0, roll});
    const Manifold manifold =
        contacts_of(above_slab(cylinder, 0.04, 1e-3, lying), kSlabAtRest, kEpsilon);
    REQUIRE(manifold.size() == 2);
    for (const ManifoldPoint& point : manifold) {
      CHECK(point.separation == Approx(1e-3).margin(1e-9));
    }
    if (!before.empty()) CHECK(keys_of(manifold) == before);
    before = keys_of(manifold);
  }
}

TEST_CASE("The lowest contact of a disc that leans keeps its identity while the disc rolls",
          "[optimised]") {
  const Convex disc(Cylinder{0.05, 0.01});
  const Convex slab(kSlab);
  const Key rim{{FeatureKind::kEdge, 0, 17}, {FeatureKind::kFace, 0, 5}};
  ProximityStatistics statistics;
  for (const double lean : {0.002, 0.01, 0.05, 0.2, 0.5}) {
    for (int i = 0; i < 2000; ++i) {
      const Pose X_WT{Vector3(0.01, -0.02, 0.02 + 0.05 * std::sin(lean) + 0.005 * std::cos(lean)),
                      rotation_from_vector({lean, 0, 0}) * rotation_from_vector({0, 0, 1e-3 * i})};
      const Contacts contacts = by_key(find_contacts(disc, X_WT, slab, {}, kEpsilon, statistics));
      CAPTURE(lean, i);
      REQUIRE(contacts.contains(rim));
      REQUIRE(std::abs(contacts.at(rim).separation) < 1e-9);
    }
  }
}

TEST_CASE("Two cylinders or capsules side by side have a contact at either end of their overlap") {
  const Pose beside{Vector3(0.0395, 0, 0.02), Quaternion::Identity()};
  for (const Shape& shape : {Shape(Cylinder{0.02, 0.06}), Shape(Capsule{0.02, 0.06})}) {
    const Manifold manifold = contacts_of({shape, beside}, {shape, Pose{}}, kEpsilon);
    REQUIRE(manifold.size() == 2);
    for (const ManifoldPoint& point : manifold) {
      CHECK(point.separation == Approx(-0.0005).margin(1e-6));
      CHECK(point.n_W.isApprox(Vector3::UnitX(), 1e-3));
      CHECK((std::abs(point.p_WC.z() + 0.01) < 1e-6 || std::abs(point.p_WC.z() - 0.03) < 1e-6));
    }
  }
}

TEST_CASE(
    "Capsules or cylinders that cross by 2 to 20 mrad have a contact at either end of their "
    "overlap") {
  const Shape shape = GENERATE(Shape(Capsule{0.02, 0.1}), Shape(Cylinder{0.02, 0.1}));
  for (const double angle : {0.002, 0.005, 0.01, 0.02}) {
    for (const Vector3& about : {Vector3(Vector3::UnitX()), Vector3(Vector3::UnitY())}) {
      const Placed tool{shape, {Vector3(0.0395, 0, 0), rotation_from_vector(angle * about)}};
      const Manifold manifold = contacts_of(tool, {shape, Pose{}}, kEpsilon);
      CAPTURE(angle, about.transpose(), shape.index());
      REQUIRE(manifold.size() == 2);
      CHECK(std::abs(manifold[0].p_WC.z() - manifold[1].p_WC.z()) > 0.09);
      // The overlap is shorter than the cylinder by what its tilted rim draws back.
      const double tilt = about.y() * angle * 0.1;
      CHECK(std::abs(manifold[0].separation - manifold[1].separation) == Approx(tilt).margin(1e-5));
    }
  }
}

TEST_CASE("A capsule that lies has 2 contacts, one that stands or a sphere has 1, tool or body") {
  const Quaternion lying = rotation_from_vector({kRightAngle, 0, 0});
  const Capsule capsule{0.02, 0.06};
  for (const double separation : {-0.03, -0.001, 0.0, 0.003}) {
    const Placed tools[] = {above_slab(capsule, 0.04, separation, lying),
                            above_slab(capsule, 0.1, separation),
                            above_slab(Sphere{0.02}, 0.04, separation)};
    const std::size_t expected[] = {2, 1, 1};
    for (std::size_t i = 0; i < 3; ++i) {
      const Manifold manifold = contacts_of(tools[i], kSlabAtRest, kEpsilon);
      CHECK(manifold.size() == expected[i]);
      CHECK(count(manifold, FeatureKind::kVertex, FeatureKind::kFace) == expected[i]);
      const Manifold exchanged = contacts_of(kSlabAtRest, tools[i], kEpsilon);
      CHECK(count(exchanged, FeatureKind::kFace, FeatureKind::kVertex) == expected[i]);
      for (const ManifoldPoint& point : manifold) {
        CHECK(point.separation == Approx(separation).margin(1e-9));
      }
    }
  }
}

TEST_CASE("Identities and separations stay when tool and body change places") {
  Random random;
  int compared = 0;
  int on_border = 0;
  for (int i = 0; i < 700; ++i) {
    const Placed body{random_shape(3, random), random.pose(0.2)};
    const Quaternion nearly_parallel = rotation_from_vector(0.02 * random.direction());
    const Quaternion turn = i % 2 == 0 ? random.rotation() : nearly_parallel;
    const Placed tool{
        random_shape(3, random),
        {body.X_WS.p + random.uniform(0.02, 0.1) * random.direction(), body.X_WS.R * turn}};
    const Contacts here = by_key(contacts_of(tool, body, kEpsilon));
    const Contacts exchanged = by_key(contacts_of(body, tool, kEpsilon));
    CHECK(here.empty() == exchanged.empty());
    for (const auto& [key, point] : here) {
      ++compared;
      const auto found = exchanged.find({key.second, key.first});
      if (found == exchanged.end()) {
        ++on_border;
        continue;
      }
      CHECK(std::abs(found->second.separation - point.separation) < 1e-6);
      CHECK((found->second.n_W + point.n_W).norm() < 1e-6);
    }
  }
  CHECK(compared > 800);
  // A corner within a micrometre of a border is a vertex of the one, or a crossing of two edges.
  CHECK(on_border <= compared / 100);
}

TEST_CASE("Small motions keep the identities, whichever body's face is the nearer to the normal") {
  Random random;
  Placed tool = above_slab(kCube, 0.04, -0.0005);
  const std::vector<Key> expected = keys_of(contacts_of(tool, kSlabAtRest, kEpsilon));
  for (int i = 0; i < 100; ++i) {
    Placed moved = tool;
    moved.X_WS.p += random.vector(0.001);
    moved.X_WS.R = rotation_from_vector(0.02 * random.direction());
    CHECK(keys_of(contacts_of(moved, kSlabAtRest, kEpsilon)) == expected);
  }
}

TEST_CASE("Faces with common borders keep their identities under rounding of the poses") {
  Random random;
  const Placed body{kCube, Pose{}};
  const Placed tool{kCube, {Vector3(0, 0, 0.0399), Quaternion::Identity()}};
  const Manifold exact = contacts_of(tool, body, kEpsilon);
  REQUIRE(exact.size() == 4);
  for (int i = 0; i < 100; ++i) {
    Placed moved = tool;
    moved.X_WS.p += random.vector(1e-8);
    moved.X_WS.R = rotation_from_vector(1e-7 * random.direction());
    CHECK(keys_of(contacts_of(moved, body, kEpsilon)) == keys_of(exact));
  }
}

TEST_CASE("The separation of every contact is the distance of the tool's point from its plane") {
  Random random;
  for (int i = 0; i < 150; ++i) {
    const Placed body{kSlab, random.pose(0.2)};
    const Vector3 up = body.X_WS.R * Vector3::UnitZ();
    Placed tool{kCube,
                {body.X_WS.p, rotation_from_vector(0.05 * random.direction()) * body.X_WS.R}};
    tool.X_WS.p += (extent_along(body, up) - body.X_WS.p.dot(up) + 0.02) * up;
    tool.X_WS.p += body.X_WS.R * Vector3(random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2), 0);
    for (const ManifoldPoint& point : contacts_of(tool, body, kEpsilon)) {
      if (point.tool_feature.kind != FeatureKind::kVertex) continue;
      const int bits = point.tool_feature.index;
      const Vector3 corner(bits & 1 ? 0.02 : -0.02, bits & 2 ? 0.02 : -0.02,
                           bits & 4 ? 0.02 : -0.02);
      const double distance = point.n_W.dot(tool.X_WS * corner - point.p_WC);
      CHECK(distance == Approx(point.separation).margin(1e-9));
    }
  }
}

TEST_CASE("A tool that is pressed into a thin body stays on the side from which it came") {
  const Convex leaf(Box{Vector3(0.2, 0.012, 0.1)});
  const bool is_sphere = GENERATE(true, false);
  const Convex tool = is_sphere ? Convex(Sphere{0.012}) : Convex(Box{Vector3(0.024, 0.024, 0.024)});
  ProximityStatistics statistics;
  std::optional<Vector3> before;
  for (double y = 0.019; y > -0.015; y -= 0.002) {
    CAPTURE(is_sphere, y);
    const Pose X_WT{Vector3(0.03, y, 0.01), Quaternion::Identity()};
    const Manifold manifold = find_contacts(tool, X_WT, leaf, {}, 0.005, statistics, before);
    REQUIRE(manifold.size() == (is_sphere ? 1 : 4));
    for (const ManifoldPoint& point : manifold) {
      CHECK((point.n_W - Vector3::UnitY()).norm() < 1e-9);
      CHECK(point.separation == Approx(y - 0.012 - 0.006).margin(1e-9));
    }
    before = manifold.front().n_W;
  }
  // Without knowing, it would leave on the far side.
  const Pose X_WT{Vector3(0.03, -0.004, 0.01), Quaternion::Identity()};
  CHECK(find_contacts(tool, X_WT, leaf, {}, 0.005, statistics).front().n_W.y() < 0);
}

}  // namespace hlm::geometry::test
