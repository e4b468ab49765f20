// The ε-query between the tool and the world: on the paper's testbed, with moving bodies, and with
// tools of several links and shapes.
#include "hlm/ve_client/world/proximity.h"

#include <algorithm>
#include <map>
#include <numbers>
#include <set>

#include "hlm/geometry/select.h"
#include "tests/support/catch.h"
#include "tests/support/worlds.h"

namespace hlm::ve {
namespace {

using test::box;
using test::fixed_model;
using test::model;
using test::world_of;

/// A tool that can be put anywhere.
struct Scene {
  Scene(const WorldDescription& description, const std::string& name)
      : assembly(assemble_tool(description, name)),
        world(description, assembly.bodies),
        tool(world, assembly, {.mode = FollowMode::kKinematic}),
        proximity(world, assembly) {}

  std::vector<FoundContact> contacts_at(const Configuration& q, double epsilon) {
    constexpr double kStep = 1.0 / 60;
    tool.set_target(q, Velocity::Zero(tool.v().size()));
    const double reach = tool.follow(kStep);
    world.step(kStep, proximity.within_reach(tool, reach), [&](double h) { tool.pull(h); });
    tool.read_back();
    const auto contacts =
        selection.select(proximity.query(tool, epsilon), assembly.planar_normal_W);
    return {contacts.begin(), contacts.end()};
  }

  ToolAssembly assembly;
  World world;
  VirtualTool tool;
  Proximity proximity;
  ContactSelection selection;
};

struct Testbed : Scene {
  Testbed() : Scene(test::repository_world("testbed.sdf"), "peg") {}
};

constexpr std::uint8_t kBottomLeft = 3;
constexpr std::uint8_t kBottomRight = 4;
constexpr std::uint8_t kHoleFloor = 5;
constexpr double kRightAngle = std::numbers::pi / 2;

/// Contacts with one shape of the enclosure.
std::vector<FoundContact> with_shape(const std::vector<FoundContact>& contacts,
                                     std::uint8_t shape) {
  std::vector<FoundContact> found;
  for (const FoundContact& contact : contacts) {
    if (contact.key.b_feature.shape == shape) found.push_back(contact);
  }
  return found;
}

/// Two contacts, `length` apart, with this normal, at separation 0.
void check_side(const std::vector<FoundContact>& contacts, const Vector3& normal, double length) {
  REQUIRE(contacts.size() == 2);
  for (const FoundContact& contact : contacts) {
    CHECK((contact.n_W - normal).norm() < 1e-9);
    CHECK(contact.separation == Approx(0).margin(1e-6));
  }
  const Vector3 span = contacts[0].p_WC - contacts[1].p_WC;
  CHECK(std::hypot(span.x(), span.y()) == Approx(length).margin(1e-6));
  CHECK(contacts[0].key != contacts[1].key);
}

TEST_CASE("The lying peg at y = 124 mm touches the bottom wall at its two lower corners") {
  Testbed testbed;
  const std::vector<FoundContact> contacts = testbed.contacts_at(Vector3(0, 0.124, 0), 0.005);
  CHECK(contacts.size() == 2);
  check_side(with_shape(contacts, kBottomLeft), -Vector3::UnitY(), 0.08);
}

TEST_CASE("The standing peg fills the hole: two contacts on each of its three walls") {
  Testbed testbed;
  const std::vector<FoundContact> contacts =
      testbed.contacts_at(Vector3(0.1, 0.184, kRightAngle), 0.005);
  CHECK(contacts.size() == 6);
  check_side(with_shape(contacts, kBottomLeft), Vector3::UnitX(), 0.08);
  check_side(with_shape(contacts, kBottomRight), -Vector3::UnitX(), 0.08);
  check_side(with_shape(contacts, kHoleFloor), -Vector3::UnitY(), 0.04);
}

TEST_CASE("A contact appears where its separation falls to ε, and then has the true separation") {
  Testbed testbed;
  CHECK(testbed.contacts_at(Vector3(0, 0.124 - 0.00501, 0), 0.005).empty());
  const std::vector<FoundContact> near = testbed.contacts_at(Vector3(0, 0.124 - 0.00499, 0), 0.005);
  REQUIRE(near.size() == 2);
  CHECK(near[0].separation == Approx(0.00499).margin(1e-6));
}

TEST_CASE("With ε = 0 there are contacts only where shapes touch") {
  Testbed testbed;
  CHECK(testbed.contacts_at(Vector3(0, 0.124 - 1e-5, 0), 0).empty());
  CHECK(testbed.contacts_at(Vector3(0, 0.124 + 1e-5, 0), 0).size() == 2);
}

TEST_CASE("A separation is exact for every depth up to 20 mm") {
  Testbed testbed;
  for (double depth = -0.005; depth <= 0.02; depth += 0.0025) {
    const std::vector<FoundContact> contacts =
        testbed.contacts_at(Vector3(0, 0.124 + depth, 0), 0.0051);
    REQUIRE(contacts.size() == 2);
    CHECK(contacts[0].separation == Approx(-depth).margin(1e-6));
    CHECK(contacts[1].separation == Approx(-depth).margin(1e-6));
  }
}

TEST_CASE("Contacts keep their identities while the peg slides, sinks and tilts a little") {
  Testbed testbed;
  const auto keys = [&](double x, double y, double heading) {
    std::vector<ContactKey> result;
    for (const auto& contact : testbed.contacts_at(Vector3(x, y, heading), 0.005)) {
      result.push_back(contact.key);
    }
    std::ranges::sort(result);
    return result;
  };
  const std::vector<ContactKey> first = keys(0, 0.123, 0);
  REQUIRE(first.size() == 2);
  CHECK(keys(-0.05, 0.123, 0) == first);
  CHECK(keys(0, 0.126, 0) == first);
  CHECK(keys(0, 0.123, 0.02) == first);
  CHECK(keys(0, 0.123, -0.02) == first);
}

TEST_CASE("The velocity of a contact is that of the environment's material there") {
  const WorldDescription description =
      world_of(model("tool", "0 0 0 0 0 0", box("0.1 0.1 0.1")) +
               model("disc", "0 0 -0.1 0 0 0", box("0.4 0.4 0.1")));
  Scene scene(description, "tool");
  Twist V;
  V << 0.01, 0.02, 0.03, 0, 0, 2;
  scene.world.set_velocity(1, V);
  const auto contacts = scene.proximity.query(scene.tool, 0.005);
  REQUIRE(contacts.size() == 4);
  for (const FoundContact& contact : contacts) {
    const Vector3 arm = contact.p_WC - Vector3(0, 0, -0.1);
    const Vector3 expected = V.head<3>() + Vector3(0, 0, 2).cross(arm);
    CHECK((contact.v_WC - expected).norm() < 1e-12);
  }
}

TEST_CASE("A contact names link, shapes and body, fixed bodies stand still") {
  const WorldDescription description = test::repository_world("linkage.sdf");
  Scene scene(description, "arm");
  // The forearm, a capsule of radius 10 mm, folded back to lie 2 mm from the post's mantle.
  const double bend = std::atan2(-0.1, -0.1) + std::asin(0.042 / std::hypot(0.1, 0.1));
  const std::vector<FoundContact> contacts = scene.contacts_at(Eigen::Vector2d(0, bend), 0.005);
  const auto forearm = std::ranges::find_if(
      contacts, [](const FoundContact& contact) { return contact.key.a.index == 1; });
  REQUIRE(forearm != contacts.end());
  CHECK(description.bodies[forearm->key.b.index].name == "post::body");
  CHECK(forearm->v_WC.isZero(0));
  CHECK(forearm->separation == Approx(0.002).margin(1e-6));
}

TEST_CASE("Shapes of one link are distinguished") {
  const std::string second =
      "<collision name='second'><pose>0.3 0 0 0 0 0</pose><geometry><box><size>0.1 0.1 0.1</size>"
      "</box></geometry></collision>";
  Scene scene(world_of(model("tool", "0 0 0 0 0 0", box("0.1 0.1 0.1") + second) +
                       fixed_model("floor", "0 0 -0.051 0 0 0",
                                   "<collision name='c'><geometry><plane><normal>0 0 1</normal>"
                                   "</plane></geometry></collision>")),
              "tool");
  const auto contacts = scene.proximity.query(scene.tool, 0.005);
  REQUIRE(contacts.size() == 8);
  CHECK(std::ranges::count_if(contacts, [](const FoundContact& contact) {
          return contact.key.a_feature.shape == 1;
        }) == 4);
}

TEST_CASE("The world's step gets all basic contacts within reach, with the smaller friction") {
  const std::string slippery =
      "<collision name='c'><geometry><box><size>0.1 0.1 0.1</size></box></geometry><surface>"
      "<friction><ode><mu>0.2</mu></ode></friction></surface></collision>";
  const std::string rough = box("0.3 0.3 0.1");  // μ = 1.
  const bool tool_is_slippery = GENERATE(true, false);
  Scene scene(world_of(model("tool", "0 0 0.101 0 0 0", tool_is_slippery ? slippery : rough) +
                       fixed_model("floor", "0 0 0 0 0 0", tool_is_slippery ? rough : slippery)),
              "tool");
  CHECK(scene.proximity.within_reach(scene.tool, 0.0009).empty());
  const auto contacts = scene.proximity.within_reach(scene.tool, 0.0011);
  REQUIRE(contacts.size() == 4);
  for (const ToolContact& contact : contacts) {
    CHECK(contact.separation == Approx(0.001).margin(1e-6));
    CHECK(contact.friction == 0.2);
    CHECK(contact.tool_body == 0);
    CHECK(contact.body == 1);
  }
}

/// Three bars of 0.2 m in a row, hinged about z.
WorldDescription chain_world() {
  const auto bar = [](const std::string& name, double x) {
    return "<link name='" + name + "'><pose>" + std::to_string(x) +
           " 0 0 0 0 0</pose><collision name='bar'><pose>0.1 0 0 0 0 0</pose><geometry><box><size>"
           "0.18 0.02 0.02</size></box></geometry></collision></link>";
  };
  const auto hinge = [](const std::string& parent, const std::string& child) {
    return "<joint name='" + child + "_hinge' type='continuous'><parent>" + parent +
           "</parent><child>" + child + "</child><axis><xyz>0 0 1</xyz></axis></joint>";
  };
  return world_of("<model name='chain'>" + bar("one", 0) + bar("two", 0.2) + bar("three", 0.4) +
                  hinge("world", "one") + hinge("one", "two") + hinge("two", "three") + "</model>");
}

TEST_CASE("Links of the tool touch each other, except those that a joint connects") {
  Scene scene(chain_world(), "chain");
  CHECK(scene.contacts_at(Eigen::Vector3d::Zero(), 0.005).empty());
  // Folded to a flat triangle: the third link comes back to the first.
  const auto contacts = scene.contacts_at(Eigen::Vector3d(0.3, 2.0, 2.15), 0.05);
  REQUIRE_FALSE(contacts.empty());
  for (const FoundContact& contact : contacts) {
    CHECK(contact.key.a == ContactSide{SideKind::kToolLink, 2});
    CHECK(contact.key.b == ContactSide{SideKind::kToolLink, 0});
    CHECK(contact.v_WC.isZero(0));
  }
  // What stops the world's tool is not among them.
  CHECK(scene.proximity.within_reach(scene.tool, 0.05).empty());
}

TEST_CASE("Contacts between links keep their identities when the tool moves as a whole") {
  Scene scene(chain_world(), "chain");
  const auto identities = [&](double shoulder) {
    std::vector<std::uint64_t> found;
    for (const auto& contact : scene.contacts_at(Eigen::Vector3d(shoulder, 2.0, 2.15), 0.05)) {
      found.push_back(identity_of(contact.key));
    }
    return found;
  };
  CHECK(identities(0.3) == identities(-1.1));
}

TEST_CASE("The tool stays on its side of a movable body however far it is pressed in") {
  Scene scene(world_of(model("tool", "0 0 0 0 0 0", box("0.02 0.02 0.02")) +
                       model("leaf", "0.016 0 0 0 0 0", box("0.01 0.2 0.2"))),
              "tool");
  for (int i = 0; i < 10; ++i) {
    scene.world.set_pose(
        1, {Vector3(0.016 - 0.002 * i, 0, 0), rotation_from_vector({0, 0, 0.01 * i})});
    const auto contacts = scene.proximity.query(scene.tool, 0.005);
    REQUIRE(contacts.size() == 4);
    for (const FoundContact& contact : contacts) {
      CHECK(contact.n_W.x() < -0.99);
      CHECK(contact.separation == Approx(0.001 - 0.002 * i).margin(2e-3));
    }
  }
}

TEST_CASE("Beside an ellipsoid on it a floor is still there") {
  const std::string ball =
      "<collision name='ball'><geometry><sphere><radius>0.01</radius></sphere></geometry>"
      "</collision>";
  const std::string floor =
      "<collision name='floor'><pose>0 0 -0.05 0 0 0</pose><geometry><box><size>0.4 0.4 0.1</size>"
      "</box></geometry></collision>";
  const std::string dome =
      "<collision name='dome'><geometry><ellipsoid><radii>0.1 0.1 0.03</radii></ellipsoid>"
      "</geometry></collision>";
  Scene scene(world_of(model("tool", "0.09 0.09 0.012 0 0 0", ball) +
                       fixed_model("ground", "0 0 0 0 0 0", floor + dome)),
              "tool");
  const auto contacts = scene.proximity.query(scene.tool, 0.005);
  REQUIRE(contacts.size() == 1);
  CHECK((contacts[0].n_W - Vector3::UnitZ()).norm() < 1e-9);
  CHECK(contacts[0].separation == Approx(0.002).margin(1e-9));  // m
}

/// Four bars that touch, with tops at z = 0, about a hole of 42 mm along x and y, and a peg of
/// 40 mm.
WorldDescription level_bars(const std::string& peg = "") {
  const auto bar = [](const std::string& name, const std::string& at, const std::string& size) {
    return fixed_model(name, at, box(size));
  };
  return world_of(bar("left", "-0.0605 0 -0.05 0 0 0", "0.079 0.2 0.1") +
                  bar("right", "0.0605 0 -0.05 0 0 0", "0.079 0.2 0.1") +
                  bar("near", "0 -0.0605 -0.05 0 0 0", "0.042 0.079 0.1") +
                  bar("far", "0 0.0605 -0.05 0 0 0", "0.042 0.079 0.1") +
                  model("peg", "0 0 0.05 0 0 0", box("0.04 0.04 0.04"), peg));
}

/// Normals of the contacts of each pair, by the axis of the pair.
using PairNormals = std::map<std::uint32_t, std::map<int, Vector3>>;

PairNormals normals_at(Scene& scene, const Configuration& q, double epsilon) {
  scene.tool.place(q);
  PairNormals normals;
  for (const FoundContact& contact : scene.proximity.query(scene.tool, epsilon)) {
    normals[contact.pair][contact.axis] = contact.n_W;
  }
  return normals;
}

Configuration at(double x, double y, double z) {
  Configuration q(7);
  q << x, y, z, 1, 0, 0, 0;
  return q;
}

TEST_CASE(
    "In a hole of level pieces the tool has contacts with walls alone, each on the side of its own "
    "piece") {
  Scene scene(level_bars(), "peg");
  const PairNormals normals = normals_at(scene, at(0, 0, -0.03), 0.005);
  CHECK(normals.size() == 4);
  for (const auto& [pair, of_pair] : normals) CHECK(of_pair.at(0).z() == 0);
}

TEST_CASE("All corners of a tool are borne, also one pressed in deeper than it is beyond a seam") {
  Scene scene(level_bars(), "peg");
  for (const double x : {-0.04, -0.0205}) {  // Over one side bar, or over it and near.
    CAPTURE(x);
    scene.tool.place(at(x, -0.06, 0.0196));
    std::set<Feature> corners;
    for (const FoundContact& contact : scene.proximity.query(scene.tool, 0.005)) {
      CHECK(contact.n_W == Vector3::UnitZ());
      CHECK(contact.separation == Approx(-4e-4).margin(1e-9));
      corners.insert(contact.key.a_feature);
    }
    CHECK(corners.size() == 4);
  }
}

TEST_CASE("A planar tool has no contact with what it passes beside, whatever is under it") {
  Scene scene(world_of(fixed_model("wall", "0 0 -0.05 0 0 0", box("0.1 0.1 0.1")) +
                       model("peg", "0 0.06 0.021 0 0 0", box("0.04 0.04 0.04"),
                             "<haptic:tool_joint>planar</haptic:tool_joint>")),
              "peg");
  Configuration q(3);
  q << 0, 0.06, 0;
  CHECK(normals_at(scene, q, 0.005).empty());
}

}  // namespace
}  // namespace hlm::ve
