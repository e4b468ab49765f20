// Which bodies take part, what they rest on, and with how much.
#include "hlm/ve_client/world/surroundings.h"

#include <algorithm>
#include <set>

#include "hlm/geometry/select.h"
#include "tests/support/catch.h"
#include "tests/support/worlds.h"

namespace hlm::ve {
namespace {

using test::fixed_model;
using test::world_of;

constexpr double kStep = 1.0 / 60;  // s.
constexpr double kEpsilon = 0.005;  // m.
const std::string kEarth = "0 0 -9.81";

/// A box with a mass (kg) and friction.
std::string brick(const std::string& name, const std::string& pose, const std::string& size,
                  double mass, const std::string& mu = "0.4") {
  return "<model name='" + name + "'><pose>" + pose + "</pose><link name='body'><inertial><mass>" +
         std::to_string(mass) +
         "</mass><inertia><ixx>2e-4</ixx><iyy>2e-4</iyy><izz>2e-4</izz></inertia></inertial>"
         "<collision name='c'><geometry><box><size>" +
         size + "</size></box></geometry><surface><friction><ode><mu>" + mu +
         "</mu></ode></friction></surface></collision></link></model>";
}

const std::string kTable = fixed_model("table", "0 0 0 0 0 0",
                                       "<collision name='c'><geometry><plane><normal>0 0 1</normal>"
                                       "</plane></geometry></collision>");
/// The tool: a weightless cube of 20 mm, its centre at `pose`.
std::string tool_at(const std::string& pose) {
  return "<model name='tool'><pose>" + pose + "</pose><link name='body'><gravity>false</gravity>" +
         test::kInertial + test::box("0.02 0.02 0.02") + "</link></model>";
}

struct Scene {
  explicit Scene(const WorldDescription& description)
      : assembly(assemble_tool(description, "tool")),
        world(description, assembly.bodies),
        tool(world, assembly, {}),
        proximity(world, assembly),
        surroundings(world, proximity) {}

  /// The contacts of the tool; the rest is in `surroundings`.
  std::vector<FoundContact> find(double epsilon = kEpsilon) {
    const auto selected =
        selection.select(proximity.query(tool, epsilon), assembly.planar_normal_W);
    std::vector<FoundContact> contacts(selected.begin(), selected.end());
    surroundings.find(contacts, epsilon);
    return contacts;
  }
  void rest(double duration = 0.5) {
    for (int i = 0; i < duration / kStep; ++i) world.step(kStep, {});
  }
  std::uint32_t body(const std::string& name) const {
    const auto& bodies = world.description().bodies;
    const auto found = std::ranges::find(bodies, name + "::body", &BodyDescription::name);
    return static_cast<std::uint32_t>(found - bodies.begin());
  }
  std::vector<FoundContact> between(std::uint32_t a, std::uint32_t b) const {
    std::vector<FoundContact> found;
    for (const FoundContact& contact : surroundings.contacts()) {
      if (contact.key.a.index == a && contact.key.b.index == b) found.push_back(contact);
    }
    return found;
  }

  ToolAssembly assembly;
  World world;
  VirtualTool tool;
  Proximity proximity;
  Surroundings surroundings;
  ContactSelection selection;
};

double load(const std::vector<FoundContact>& contacts) {
  double sum = 0;
  for (const FoundContact& contact : contacts) sum += contact.load;
  return sum;
}

TEST_CASE("A brick on a table beside the tool: four contacts that bear its weight") {
  Scene scene(world_of(kTable + brick("brick", "0 0 0.02 0 0 0.3", "0.08 0.05 0.04", 0.3) +
                           brick("far", "0.5 0 0.02 0 0 0", "0.08 0.05 0.04", 0.3) +
                           tool_at("0 0 0.051 0 0 0"),
                       kEarth));
  scene.rest();
  const std::vector<FoundContact> tool_contacts = scene.find();
  const std::uint32_t id = scene.body("brick");

  REQUIRE(scene.surroundings.bodies().size() == 1);
  const MovableBody& body = scene.surroundings.bodies()[0];
  CHECK(body.id == id);
  CHECK((body.p_WCom - Vector3(0, 0, 0.02)).norm() < 1e-4);
  CHECK(body.W(2, 2) == Approx(1 / 0.3));
  CHECK((body.A_W.head<3>() - Vector3(0, 0, -9.81)).norm() < 1e-9);

  REQUIRE(tool_contacts.size() == 4);
  for (const FoundContact& contact : tool_contacts) {
    CHECK(contact.key.a == ContactSide{SideKind::kToolLink, 0});
    CHECK(contact.key.b == ContactSide{SideKind::kMovableBody, id});
    CHECK(contact.friction == 0.4);
    CHECK(contact.load == 0);
  }
  REQUIRE(scene.surroundings.contacts().size() == 4);
  for (const FoundContact& contact : scene.surroundings.contacts()) {
    CHECK(contact.key.a == ContactSide{SideKind::kMovableBody, id});
    CHECK(contact.key.b == ContactSide{SideKind::kWorld, scene.body("table")});
    CHECK((contact.n_W - Vector3::UnitZ()).norm() < 1e-6);
    CHECK(contact.friction == 0.4);
    CHECK(contact.load == Approx(0.3 * 9.81 / 4).epsilon(0.02));
  }
  CHECK(load(scene.between(id, scene.body("table"))) == Approx(0.3 * 9.81).epsilon(0.005));
}

TEST_CASE("Loads bear the body where its weight is: uneven on a beam that carries a cube") {
  Scene scene(world_of(kTable + brick("beam", "0 0 0.01 0 0 0", "0.2 0.04 0.02", 0.2) +
                           brick("cube", "0.08 0 0.04 0 0 0", "0.04 0.04 0.04", 0.5) +
                           tool_at("0 0 0.031 0 0 0"),
                       kEarth));
  scene.rest();
  scene.find();
  REQUIRE(scene.surroundings.bodies().size() == 2);
  const auto on_table = scene.between(scene.body("beam"), scene.body("table"));
  const auto on_beam = scene.between(scene.body("beam"), scene.body("cube"));
  CHECK(load(on_table) == Approx(0.7 * 9.81).epsilon(0.005));
  CHECK(load(on_beam) == Approx(0.5 * 9.81).epsilon(0.005));
  double moment = 0;
  for (const FoundContact& contact : on_table) moment += contact.p_WC.x() * contact.load;
  CHECK(moment == Approx(0.08 * 0.5 * 9.81).epsilon(0.01));
}

TEST_CASE("Identities of bodies' contacts last while a body is pushed about") {
  Scene scene(world_of(kTable + brick("lower", "0 0 0.02 0 0 0.3", "0.08 0.05 0.04", 0.3) +
                           brick("upper", "0 0 0.06 0 0 0.1", "0.04 0.04 0.04", 0.1) +
                           tool_at("0 0 0.092 0 0 0"),
                       kEarth));
  const auto identities = [&] {
    scene.find();
    std::set<std::uint64_t> result;
    for (const FoundContact& contact : scene.surroundings.contacts()) {
      result.insert(identity_of(contact.key));
    }
    CHECK(result.size() == scene.surroundings.contacts().size());
    return result;
  };
  scene.rest();
  const auto before = identities();
  CHECK(before.size() == 8);
  for (int i = 0; i < 16; ++i) {
    scene.world.add_wrench(static_cast<int>(scene.body("lower")), Wrench(1.8, 0.3, 0, 0, 0, 0));
    scene.world.step(kStep, {});
    CHECK(identities() == before);
  }
  CHECK(scene.world.X_WB(static_cast<int>(scene.body("lower"))).p.x() > 0.01);
}

/// A row of cubes, each touching the next, and the tool at the first.
std::string row(int count) {
  std::string models = kTable;
  for (int i = 0; i < count; ++i) {
    models += brick("cube" + std::to_string(i), std::to_string(0.04 * i) + " 0 0.02 0 0 0",
                    "0.04 0.04 0.04", 0.2);
  }
  return models + tool_at("-0.031 0 0.02 0 0 0");
}

TEST_CASE("Bodies behind the touched one take part, eight at most, the next is a constraint") {
  Scene scene(world_of(row(10), kEarth));
  scene.rest(0.1);
  scene.find();
  const MovableBodies& bodies = scene.surroundings.bodies();
  REQUIRE(bodies.size() == kMaxBodiesAhead);
  for (std::uint32_t i = 0; i < kMaxBodiesAhead; ++i)
    CHECK(bodies[i].id == scene.body("cube0") + i);
  const std::uint32_t last = scene.body("cube7");
  const auto at_border = scene.between(last, last + 1);
  CHECK_FALSE(at_border.empty());
  for (const FoundContact& contact : at_border) CHECK(contact.key.b.kind == SideKind::kWorld);
  CHECK(scene.surroundings.is_obstacle(static_cast<int>(last + 1)));
  CHECK_FALSE(scene.surroundings.is_obstacle(static_cast<int>(last)));
  for (const FoundContact& contact : scene.surroundings.contacts()) {
    CHECK((contact.key.b.kind == SideKind::kWorld || contact.key.a.index < contact.key.b.index));
  }
}

TEST_CASE("All contacts fit into an update, and those that bear stay") {
  Scene scene(world_of(row(8), kEarth));
  scene.rest(0.1);
  const double epsilon = 0.05;  // Nearly everything is near everything.
  const std::vector<FoundContact> tool_contacts = scene.find(epsilon);
  CHECK(tool_contacts.size() + scene.surroundings.contacts().size() <= kMaxContacts);
  double weight = 0;
  for (const FoundContact& contact : scene.surroundings.contacts()) {
    if (contact.key.b.index == scene.body("table")) weight += contact.load;
  }
  CHECK(weight == Approx(8 * 0.2 * 9.81).epsilon(0.01));
}

std::string door(const std::string& limits, const std::string& dynamics = "") {
  return "<model name='door'><link name='body'><pose>0.1 0 0 0 0 0</pose>" + test::kInertial +
         test::box("0.2 0.02 0.2") +
         "</link><joint name='hinge' type='revolute'><pose>-0.1 0 0 0 0 0</pose><parent>world"
         "</parent><child>body</child><axis><xyz>0 0 1</xyz>" +
         limits + dynamics + "</axis></joint></model>";
}

TEST_CASE("A door's stop is a contact that turns it back, and bears what its spring presses") {
  Scene scene(world_of(door("<limit><lower>0</lower><upper>1.5</upper></limit>",
                            "<dynamics><spring_stiffness>1</spring_stiffness><spring_reference>-0.5"
                            "</spring_reference><damping>0.05</damping></dynamics>") +
                       tool_at("0.15 -0.021 0 0 0 0")));
  scene.rest(1);
  scene.find();
  REQUIRE(scene.surroundings.bodies().size() == 1);
  REQUIRE(scene.surroundings.contacts().size() == 1);
  const FoundContact& stop = scene.surroundings.contacts()[0];
  CHECK(stop.key.a == ContactSide{SideKind::kMovableBody, scene.body("door")});
  CHECK(stop.key.b.kind == SideKind::kWorld);
  CHECK((stop.n_W - Vector3::UnitY()).norm() < 1e-2);
  CHECK(std::abs(stop.separation) < 1e-4);
  CHECK(stop.load * 0.1 == Approx(0.5).epsilon(0.02));  // N·m of the spring.
  CHECK(stop.friction == 0);
}

TEST_CASE("A welded body is an obstacle like the world") {
  Scene scene(world_of("<model name='post'><link name='body'>" + test::kInertial +
                       test::box("0.02 0.02 0.02") +
                       "</link><joint name='weld' type='fixed'><parent>world</parent>"
                       "<child>body</child></joint></model>" +
                       tool_at("0 0 0.021 0 0 0")));
  const auto contacts = scene.find();
  REQUIRE(contacts.size() == 4);
  CHECK(contacts[0].key.b.kind == SideKind::kWorld);
  CHECK(scene.surroundings.bodies().empty());
  CHECK(scene.surroundings.is_obstacle(0));
}

TEST_CASE("Bodies that a joint connects have no contacts with each other") {
  Scene scene(world_of("<model name='m'><link name='body'>" + test::kInertial +
                       test::box("0.04 0.04 0.04") +
                       "</link><link name='arm'><pose>0.041 0 0 0 0 0"
                       "</pose>" +
                       test::kInertial + test::box("0.04 0.04 0.04") +
                       "</link><joint name='j' type='revolute'><parent>body</parent><child>arm"
                       "</child><axis><xyz>0 0 1</xyz></axis></joint></model>" +
                       tool_at("0.02 0 0.032 0 0 0")));
  scene.find();
  CHECK(scene.surroundings.bodies().size() == 2);
  CHECK(scene.surroundings.contacts().empty());
}

TEST_CASE(
    "Bodies are round as all their collisions together are, unless a joint's limits hold them") {
  const auto shape = [](const std::string& name, const std::string& geometry,
                        const std::string& pose = "0 0 0 0 0 0") {
    return "<collision name='" + name + "'><pose>" + pose + "</pose><geometry>" + geometry +
           "</geometry></collision>";
  };
  const std::string ball = "<sphere><radius>0.02</radius></sphere>";
  const std::string rod = "<cylinder><radius>0.01</radius><length>0.1</length></cylinder>";
  const std::string cube = "<box><size>0.02 0.02 0.02</size></box>";
  const auto of = [](const std::string& collisions, const std::string& pose = "0 0 0 0 0 0") {
    return roundness_of(test::world_of(test::model("it", pose, collisions)), 0);
  };
  CHECK(of(shape("a", ball)).kind == Roundness::kSphere);
  CHECK(of(shape("a", cube)).kind == Roundness::kNone);
  CHECK(of(shape("a", rod)).axis_B == Vector3::UnitZ());
  CHECK(of(shape("a", "<ellipsoid><radii>0.02 0.01 0.01</radii></ellipsoid>")).axis_B ==
        Vector3::UnitX());
  const BodyRoundness lying = of(shape("a", rod, "0 0 0 0 1.57079632679489662 0"));
  CHECK(lying.kind == Roundness::kAxis);
  CHECK((lying.axis_B - Vector3::UnitX()).norm() < 1e-12);
  // A wheel on an axle, and a ball on its end; then a crank.
  CHECK(of(shape("a", rod) + shape("b", ball, "0 0 0.06 0 0 0")).kind == Roundness::kAxis);
  CHECK(of(shape("a", rod) + shape("b", ball, "0.001 0 0.06 0 0 0")).kind == Roundness::kNone);
  CHECK(of(shape("a", rod, "0.001 0 0 0 0 0")).kind == Roundness::kNone);
  CHECK(of(shape("a", rod) + shape("b", cube)).kind == Roundness::kNone);
}

}  // namespace
}  // namespace hlm::ve
