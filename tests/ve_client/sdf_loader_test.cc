// Loading worlds: what an SDF file says, and the message for each thing that it must not say.
#include <fstream>
#include <numbers>

#include "tests/support/catch.h"
#include "tests/support/worlds.h"

namespace hlm::ve {
namespace {

using Catch::Matchers::ContainsSubstring;
using test::box;
using test::fixed_model;
using test::kInertial;
using test::model;
using test::world_of;

/// The message with which loading these models fails; empty if it succeeds.
std::string error_of(const std::string& models) {
  try {
    world_of(models);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

std::string with_geometry(const std::string& geometry) {
  return fixed_model("wall", "0 0 0 0 0 0",
                     "<collision name='c'><geometry>" + geometry + "</geometry></collision>");
}

TEST_CASE("The testbed is an enclosure of six boxes and a planar peg of 80 x 40 mm, 1 kg") {
  const WorldDescription world = test::repository_world("testbed.sdf");
  REQUIRE(world.bodies.size() == 2);
  CHECK(world.gravity_W.isZero(0));
  CHECK(world.bodies[0].fixed);
  CHECK(world.bodies[0].collisions.size() == 6);
  const BodyDescription& peg = world.bodies[1];
  CHECK_FALSE(peg.fixed);
  CHECK(peg.mass == 1);
  CHECK(std::get<Box>(peg.collisions.at(0).shape).size == Vector3(0.08, 0.04, 0.04));
  CHECK(peg.collisions[0].friction == 0.3);
  CHECK(world.models.at(1).tool_joint == JointType::kPlanar);
}

TEST_CASE("The other worlds of the repository load") {
  CHECK(test::repository_world("playground.sdf").bodies.size() == 8);
  const WorldDescription linkage = test::repository_world("linkage.sdf");
  CHECK(linkage.joints.size() == 3);
  CHECK(linkage.models.at(0).hand_link == "forearm");
  CHECK(linkage.models[0].X_SH.p == Vector3(0.2, 0, 0));
}

TEST_CASE("A world may name its tool, and say what is to be felt") {
  const std::string peg = model("peg", "0 0 0 0 0 0", "");
  const WorldDescription said = world_of(
      "<haptic:tool>peg</haptic:tool><haptic:description>\n  A peg\n"
      "  in a hole.</haptic:description>" +
      peg);
  CHECK(said.tools == std::array<std::string, kMostTools>{"peg", ""});
  CHECK(said.description == "A peg in a hole.");
  const WorldDescription silent = world_of(peg);
  CHECK(silent.tools == std::array<std::string, kMostTools>{});
  CHECK(silent.description.empty());

  CHECK_THAT(error_of("<haptic:tool>hammer</haptic:tool>" + peg),
             ContainsSubstring("test.sdf:1: ") && ContainsSubstring("tool 'hammer'") &&
                 ContainsSubstring("it has: peg"));
  CHECK_THAT(error_of("<haptic:tool> </haptic:tool>" + peg),
             ContainsSubstring("<haptic:tool> must not be empty"));
  CHECK_THAT(error_of("<haptic:tool>peg</haptic:tool><haptic:tool>peg</haptic:tool>" + peg),
             ContainsSubstring("<haptic:tool> 'peg' must be the only one"));
  CHECK_THAT(error_of("<haptic:descripton>x</haptic:descripton>" + peg),
             ContainsSubstring("<haptic:descripton>") && ContainsSubstring("<haptic:description>"));
}

TEST_CASE("Poses of nested models, links, centres of mass and collisions compose") {
  const WorldDescription world = world_of(
      "<model name='outer'><pose>1 0 0 0 0 1.5707963267948966</pose>"
      "<link name='base'>" +
      kInertial +
      "</link>"
      "<model name='inner'><pose>0 2 0 0 0 0</pose><link name='arm'><pose>0 0 3 0 0 0</pose>"
      "<inertial><pose>0.5 0 0 0 0 0</pose><mass>2</mass></inertial>"
      "<collision name='c'><pose>0.5 0 1 0 0 "
      "0</pose><geometry><sphere><radius>0.1</radius></sphere>"
      "</geometry></collision></link></model></model>");
  REQUIRE(world.bodies.size() == 2);
  const BodyDescription& arm = world.bodies[1];
  CHECK(arm.name == "outer::inner::arm");
  // Link at (1,0,0) + Rz(90°)(0,2,3); its centre of mass 0.5 m along the turned x axis.
  CHECK(arm.X_WB.p.isApprox(Vector3(-1, 0.5, 3), 1e-12));
  CHECK((arm.X_WB * arm.p_BS).isApprox(Vector3(-1, 0, 3), 1e-12));
  CHECK(arm.collisions.at(0).X_BG.p.isApprox(Vector3(0, 0, 1), 1e-12));
}

TEST_CASE("Poses relative to a frame are resolved") {
  const WorldDescription world = world_of(
      "<frame name='shelf'><pose>0 0 1 0 0 0</pose></frame>"
      "<model name='m'><pose relative_to='shelf'>1 0 0 0 0 0</pose><link name='l'>" +
      kInertial + "</link></model>");
  CHECK(world.bodies.at(0).X_WB.p.isApprox(Vector3(1, 0, 1), 1e-12));
}

TEST_CASE("A rotated inertial frame turns the inertia, not the body's axes") {
  const WorldDescription world = world_of(
      "<model name='m'><link name='l'><inertial><pose>0 0 0 0 0 1.5707963267948966</pose>"
      "<mass>1</mass><inertia><ixx>1</ixx><iyy>2</iyy><izz>2.5</izz></inertia></inertial>"
      "</link></model>");
  CHECK(world.bodies.at(0).X_WB.R.isApprox(Quaternion::Identity(), 1e-12));
  CHECK(world.bodies[0].I_B.isApprox(Matrix3(Vector3(2, 1, 2.5).asDiagonal()), 1e-12));
}

TEST_CASE("A plane's normal is its shape's z axis") {
  const WorldDescription world = world_of(with_geometry("<plane><normal>1 0 0</normal></plane>"));
  const CollisionDescription& plane = world.bodies.at(0).collisions.at(0);
  CHECK(std::holds_alternative<HalfSpace>(plane.shape));
  CHECK((plane.X_BG.R * Vector3::UnitZ()).isApprox(Vector3::UnitX(), 1e-12));
}

TEST_CASE("A joint has its frame, axis and limits") {
  const WorldDescription world = world_of(
      "<model name='m'><pose>0 0 1 0 0 0</pose><link name='a'>" + kInertial +
      "</link>"
      "<link name='b'><pose>1 0 0 0 0 1.5707963267948966</pose>" +
      kInertial +
      "</link>"
      "<joint name='j' type='revolute'><pose>0.25 0 0 0 0 0</pose><parent>a</parent>"
      "<child>b</child><axis><xyz expressed_in='__model__'>1 0 0</xyz>"
      "<limit><lower>-0.5</lower><upper>1.5</upper></limit><dynamics><damping>0.1</damping>"
      "<spring_stiffness>2</spring_stiffness><spring_reference>0.3</spring_reference>"
      "</dynamics></axis></joint></model>");
  const JointDescription& joint = world.joints.at(0);
  CHECK(joint.type == BodyJoint::kRevolute);
  CHECK(joint.parent == 0);
  CHECK(joint.child == 1);
  CHECK(joint.X_WJ.p.isApprox(Vector3(1, 0.25, 1), 1e-12));
  CHECK((joint.X_WJ.R * joint.axis_J).isApprox(Vector3::UnitX(), 1e-12));
  CHECK(joint.lower == -0.5);
  CHECK(joint.upper == 1.5);
  CHECK(joint.stiffness == 2);
  CHECK(joint.rest == 0.3);
  CHECK(joint.damping == 0.1);
}

TEST_CASE("A joint whose limits do not include 0 starts at the nearest, with all that it carries") {
  const auto chain = [](const std::string& limits, const std::string& more = "") {
    const std::string axis = "<axis><xyz>0 0 1</xyz>";
    return "<model name='m'><link name='a'>" + kInertial +
           "</link><link name='b'><pose>1 0 0 0 0 0</pose>" + kInertial +
           "</link><link name='c'><pose>2 0 0 0 0 0</pose>" + kInertial +
           "</link><joint name='j' type='revolute'><pose>-1 0 0 0 0 0</pose><parent>a</parent>"
           "<child>b</child>" +
           axis + limits +
           "<dynamics><spring_stiffness>1</spring_stiffness>"
           "<spring_reference>-1</spring_reference></dynamics></axis></joint>"
           "<joint name='k' type='prismatic'><parent>b</parent><child>c</child>" +
           axis + "<limit><lower>0.25</lower><upper>1</upper></limit></axis></joint>" + more +
           "</model>";
  };
  const std::string limits = "<limit><lower>-3</lower><upper>-1.5707963267948966</upper></limit>";
  const WorldDescription world = world_of(chain(limits));
  CHECK(world.bodies.at(0).X_WB.p.isZero(0));
  CHECK(world.bodies.at(1).X_WB.p.isApprox(Vector3(0, -1, 0), 1e-12));
  CHECK(world.bodies.at(2).X_WB.p.isApprox(Vector3(0, -2, 0.25), 1e-12));
  const JointDescription& turning = world.joints.at(0);
  CHECK(turning.X_WJ.p.isZero(1e-12));
  CHECK(turning.lower == Approx(std::numbers::pi / 2 - 3));
  CHECK(turning.upper == 0);
  CHECK(turning.rest == Approx(std::numbers::pi / 2 - 1));
  CHECK(world.joints.at(1).X_WJ.p.isApprox(Vector3(0, -2, 0.25), 1e-12));
  CHECK(world.joints[1].lower == 0);
  CHECK(world.joints[1].upper == 0.75);
  CHECK_THAT(error_of(chain(limits,
                            "<joint name='l' type='fixed'><parent>world</parent><child>c</child>"
                            "</joint>")),
             ContainsSubstring("joint 'j'") && ContainsSubstring("include 0"));
  CHECK_THAT(error_of(chain("<limit><lower>1e9</lower><upper>2e9</upper></limit>")),
             ContainsSubstring("limits 1e+09 to 2e+09 must include a position within"));
}

TEST_CASE("What fixed joints join to the world is fixed: it may be a plane, and needs no mass") {
  const std::string weld = "<joint name='w' type='fixed'><parent>world</parent><child>a</child>";
  const WorldDescription world = world_of(
      "<model name='m'><link name='a'><inertial><mass>0</mass></inertial><collision name='c'>"
      "<geometry><plane><normal>0 0 1</normal></plane></geometry></collision></link>"
      "<link name='c'/><link name='b'/>"
      "<joint name='v' type='fixed'><parent>b</parent><child>c</child></joint>"
      "<joint name='u' type='fixed'><parent>a</parent><child>b</child></joint>" +
      weld +
      "</joint><link name='d'/><joint name='t' type='revolute'><parent>c</parent><child>d</child>"
      "<axis><xyz>0 0 1</xyz></axis></joint></model>");
  CHECK(world.bodies.at(0).fixed);
  CHECK(world.bodies.at(1).fixed);
  CHECK(world.bodies.at(2).fixed);
  CHECK_FALSE(world.bodies.at(3).fixed);
}

TEST_CASE("Of <physics> the step and the iterations count, where they are given") {
  const WorldDescription plain = world_of("");
  CHECK_FALSE(plain.solver.largest_step);
  CHECK_FALSE(plain.solver.sweeps);
  const auto physics = [](const std::string& step, const std::string& iterations) {
    return "<physics type='ode'><max_step_size>" + step +
           "</max_step_size><real_time_factor>1</real_time_factor><ode><solver><iters>" +
           iterations + "</iters></solver></ode></physics>";
  };
  const WorldDescription given = world_of(physics("0.002", "70"));
  CHECK(given.solver.largest_step == 0.002);
  CHECK(given.solver.sweeps == 70);
  CHECK_THAT(error_of(physics("0", "70")),
             ContainsSubstring("max_step_size 0 s") && ContainsSubstring("0.0001 to 0.1 s"));
  CHECK_THAT(error_of(physics("0.002", "0")), ContainsSubstring("iters 0"));
}

TEST_CASE("What this program does not support is an error that names the element") {
  CHECK_THAT(
      error_of("<model name='m'><link name='a'/><link name='b'/>"
               "<joint name='hip' type='universal'><parent>a</parent><child>b</child></joint>"
               "</model>"),
      ContainsSubstring("model 'm' joint 'hip'") && ContainsSubstring("universal"));
  CHECK_THAT(error_of(model("m", "0 0 0 0 0 0", "", "<haptic:tool_join>planar</haptic:tool_join>")),
             ContainsSubstring("<haptic:tool_join>"));
}

TEST_CASE("A friction that no packet has counts as the largest that one has, and that is said") {
  const std::string wall =
      fixed_model("wall", "0 0 0 0 0 0",
                  "<collision name='c'><geometry><sphere><radius>1</radius></sphere></geometry>"
                  "<surface><friction><ode><mu>1e5</mu></ode></friction></surface></collision>");
  Diagnostics diagnostics;
  const WorldDescription world = parse_world(
      "<sdf version='1.9'><world name='w'>" + wall + "</world></sdf>", "test.sdf", diagnostics);
  CHECK(world.bodies.at(0).collisions.at(0).friction == 10);
  REQUIRE(diagnostics.findings().size() == 1);
  const Finding& finding = diagnostics.findings().front();
  CHECK(finding.verdict == Verdict::kApproximated);
  CHECK_THAT(to_string(finding), ContainsSubstring("test.sdf:") &&
                                     ContainsSubstring("friction mu 100000: it counts as 10"));
}

TEST_CASE("A collision that can have no shape is left out alone, and named") {
  const auto left_out = [](const std::string& geometry, const std::string& why) {
    CAPTURE(geometry);
    Diagnostics diagnostics;
    const WorldDescription world =
        parse_world("<sdf version='1.9'><world name='w'>" +
                        model("m", "0 0 0 0 0 0",
                              box("1 1 1") + "<collision name='c'><geometry>" + geometry +
                                  "</geometry></collision>") +
                        "</world></sdf>",
                    "test.sdf", diagnostics);
    CHECK(diagnostics.usable());
    CHECK(world.bodies.at(0).collisions.size() == 1);
    REQUIRE_FALSE(diagnostics.findings().empty());
    CHECK_THAT(to_string(diagnostics.findings().front()),
               ContainsSubstring("test.sdf:1: model 'm' link 'body' collision 'c': " + why) &&
                   ContainsSubstring("the collision is left out"));
  };
  left_out("<sphere><radius>0</radius></sphere>", "radius 0 m must be");
  left_out("<box><size>1 0 1</size></box>", "size y 0 m must be");
  left_out("<plane><normal>0 0 1</normal></plane>", "a plane is allowed in static models only");
  left_out("<image><uri>walls.png</uri></image>", "<image>: ");
  left_out("<polyline><point>1 1</point><height>1</height></polyline>", "<polyline>: ");
}

TEST_CASE("A value out of range is an error that names it and what is allowed") {
  CHECK_THAT(
      error_of(with_geometry("<sphere><radius>-0.1</radius></sphere>")),
      ContainsSubstring("collision 'c': radius -0.1 m") && ContainsSubstring("1e-06 to 1000000 m"));
  CHECK_THAT(error_of(fixed_model("wall", "0 0 0 0 0 0",
                                  "<collision name='c'><geometry><sphere><radius>1</radius>"
                                  "</sphere></geometry><surface><friction><ode><mu>-1</mu></ode>"
                                  "</friction></surface></collision>")),
             ContainsSubstring("friction mu -1 must be at least 0"));
  CHECK_THAT(error_of("<model name='m'><link name='a'><inertial><mass>-1</mass></inertial></link>"
                      "</model>"),
             ContainsSubstring("link"));
  CHECK_THAT(
      error_of("<model name='m'><link name='a'/><link name='b'/>"
               "<joint name='j' type='revolute'><parent>a</parent><child>b</child>"
               "<axis><xyz>0 0 1</xyz><limit><lower>0.5</lower><upper>0.4</upper></limit>"
               "</axis></joint></model>"),
      ContainsSubstring("model 'm' joint 'j'") && ContainsSubstring("limits 0.5 to 0.4 must not"));
  CHECK_THAT(error_of(model("m", "0 0 0 0 0 0", "", "<haptic:tool_joint>ball</haptic:tool_joint>")),
             ContainsSubstring("model 'm'") && ContainsSubstring("'ball' must be free or planar"));
  CHECK_THAT(error_of(model("m", "0 0 0 0 0 0", "",
                            "<haptic:hand><link>body</link><pose>1 2 x</pose></haptic:hand>")),
             ContainsSubstring("<haptic:hand> <pose> '1 2 x'") && ContainsSubstring("6 numbers"));
  CHECK_THAT(error_of(model("m", "0 0 0 0 0 0", "",
                            "<haptic:start><pose>1 2 3 0 0 0</pose></haptic:start>")),
             ContainsSubstring("<haptic:start>") && ContainsSubstring("<name>"));
  const std::string start = "<haptic:start><name>a</name><pose>1 2 3 0 0 0</pose></haptic:start>";
  CHECK_THAT(error_of(model("m", "0 0 0 0 0 0", "", start + start)),
             ContainsSubstring("<haptic:start> 'a'") && ContainsSubstring("name of its own"));
}

TEST_CASE("A missing or broken file is one line that names it") {
  CHECK_THROWS_WITH(load_world("/nonexistent/w.sdf"), ContainsSubstring("/nonexistent/w.sdf"));
  CHECK_THROWS_WITH(parse_world("<sdf version='1.9'><world", "broken.sdf"),
                    ContainsSubstring("broken.sdf") && !ContainsSubstring("\n"));
  CHECK_THROWS_WITH(
      parse_world("<sdf version='1.9'></sdf>", "empty.sdf"),
      ContainsSubstring("empty.sdf:1: ") && ContainsSubstring("no <world> and no <model>"));
  CHECK_THAT(error_of("<model name='m'><link name='a'/><link name='b'/>"
                      "<joint name='j' type='fixed'><parent>a</parent><child>nobody</child>"
                      "</joint></model>"),
             ContainsSubstring("nobody"));
}

}  // namespace
}  // namespace hlm::ve
