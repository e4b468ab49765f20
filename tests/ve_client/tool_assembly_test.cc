// The virtual tool that a model makes.
#include "hlm/ve_client/scene/tool_assembly.h"

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

/// The tool's bodies are where the world's file puts them.
void check_initial_poses(const WorldDescription& world, const ToolAssembly& tool) {
  ToolModel kinematics(tool.description);
  kinematics.set_configuration(tool.q);
  for (std::size_t i = 0; i < tool.bodies.size(); ++i) {
    const Pose X_WB = kinematics.X_WL(static_cast<int>(i)) * tool.X_LB[i];
    const Pose& expected = world.bodies[static_cast<std::size_t>(tool.bodies[i])].X_WB;
    CHECK(displacement(X_WB, expected).norm() < 1e-12);
    const Vector3 com = kinematics.X_WL(static_cast<int>(i)) * tool.description.links[i].p_LCom;
    CHECK((com - expected.p).norm() < 1e-12);
  }
}

TEST_CASE("A tool begins at a start that its model names") {
  const WorldDescription world =
      world_of(model("t", "0.3 0.2 0 0 0 0.4", "",
                     "<haptic:tool_joint>planar</haptic:tool_joint>"
                     "<haptic:start><name>a</name><pose>1 2 0 0 0 1.5</pose></haptic:start>"
                     "<haptic:start><name>b</name><pose>0 -1 0 0 0 -0.5</pose></haptic:start>"));
  CHECK(assemble_tool(with_start(world, "t", ""), "t").q == assemble_tool(world, "t").q);
  CHECK(assemble_tool(with_start(world, "t", "a"), "t").q.isApprox(Vector3(1, 2, 1.5), 1e-12));
  CHECK(assemble_tool(with_start(world, "t", "b"), "t").q.isApprox(Vector3(0, -1, -0.5), 1e-12));
  CHECK_THROWS_WITH(with_start(world, "t", "c"),
                    ContainsSubstring("start 'c'") && ContainsSubstring("it has: a, b"));
}

TEST_CASE("A linkage moves to another place as one, and its joints with it") {
  const WorldDescription& world = test::repository_world("linkage.sdf");
  const ModelDescription& arm = find_model(world, "arm");
  const Pose X{{0.1, -0.2, 0.3}, rotation_from_vector({0, 0, 0.7})};
  const WorldDescription moved = with_model_at(world, "arm", X * arm.X_WM);
  const ToolAssembly before = assemble_tool(world, "arm");
  const ToolAssembly after = assemble_tool(moved, "arm");
  check_initial_poses(moved, after);
  // Also away from the initial pose, where it matters about which place the joints turn.
  ToolModel here(before.description);
  ToolModel there(after.description);
  here.set_configuration(Eigen::Vector2d(0.4, -0.9));
  there.set_configuration(Eigen::Vector2d(0.4, -0.9));
  for (int link = 0; link < here.links(); ++link) {
    const auto i = static_cast<std::size_t>(link);
    const Pose X_WB = there.X_WL(link) * after.X_LB[i];
    CHECK(displacement(X_WB, X * here.X_WL(link) * before.X_LB[i]).norm() < 1e-12);
  }
}

TEST_CASE("A free tool's configuration is the pose of its centre of mass") {
  const WorldDescription world = world_of(
      "<model name='t'><pose>1 2 3 0 0 0.5</pose><link name='l'><inertial>"
      "<pose>0.1 0 0 0 0 0</pose><mass>2</mass></inertial></link></model>",
      "0 0 -9.81");
  const ToolAssembly tool = assemble_tool(world, "t");
  CHECK(tool.description.links.at(0).joint == JointType::kFree);
  CHECK(tool.description.gravity_W == Vector3(0, 0, -9.81));
  CHECK(tool.q.head<3>().isApprox(world.bodies[0].X_WB.p, 1e-12));
  CHECK(tool.description.X_LH == Pose{});
  CHECK_FALSE(tool.planar_normal_W);
  check_initial_poses(world, tool);
}

TEST_CASE("A planar tool's configuration is the centre of mass in world coordinates and heading") {
  const WorldDescription world = world_of(
      "<model name='t'><pose>0.3 0.2 0.7 0 0 0.4</pose>"
      "<haptic:tool_joint>planar</haptic:tool_joint><link name='l'><inertial>"
      "<pose>0 0.1 0 0 0 0</pose><mass>2</mass></inertial></link></model>");
  const ToolAssembly tool = assemble_tool(world, "t");
  REQUIRE(tool.q.size() == 3);
  CHECK(tool.q[0] == Approx(0.3 - 0.1 * std::sin(0.4)).margin(1e-12));
  CHECK(tool.q[1] == Approx(0.2 + 0.1 * std::cos(0.4)).margin(1e-12));
  CHECK(tool.q[2] == Approx(0.4).margin(1e-12));
  CHECK(tool.planar_normal_W == Vector3::UnitZ());
  check_initial_poses(world, tool);
}

TEST_CASE("A planar tool may stand on its side: its link's axes need not be the plane's") {
  const WorldDescription world = world_of(
      model("t", "0.3 0.2 0 1.2 0.3 0.4", "", "<haptic:tool_joint>planar</haptic:tool_joint>"));
  const ToolAssembly tool = assemble_tool(world, "t");
  CHECK(tool.q[2] == Approx(0.4).margin(1e-12));
  check_initial_poses(world, tool);
}

TEST_CASE("The linkage is a chain of two revolute links at q = 0, held at its tip") {
  const WorldDescription world = test::repository_world("linkage.sdf");
  const ToolAssembly tool = assemble_tool(world, "arm");
  REQUIRE(tool.description.dof() == 2);
  CHECK(tool.q.isZero(0));
  CHECK(tool.description.links.at(1).parent == 0);
  check_initial_poses(world, tool);
  ToolModel kinematics(tool.description);
  CHECK(kinematics.X_WH().p.isApprox(Vector3(0.4, 0, 0), 1e-12));
  kinematics.set_configuration(Eigen::Vector2d(M_PI / 2, -M_PI / 2));
  CHECK(kinematics.X_WH().p.isApprox(Vector3(0.2, 0.2, 0), 1e-12));
}

TEST_CASE("Joint frames and link frames of a tree may lie anywhere") {
  const WorldDescription world = world_of(
      "<model name='t'><pose>0.1 0.2 0.3 0.4 0.5 0.6</pose>"
      "<link name='tip'><pose>1 0 0 0.3 0 0</pose>" +
      kInertial +
      "</link>"
      "<link name='root'><pose>0 1 0 0 0.2 0</pose>" +
      kInertial +
      "</link>"
      "<link name='slide'><pose>0 0 1 0 0 0.7</pose>" +
      kInertial +
      "</link>"
      "<joint name='a' type='prismatic'><pose>0.1 0 0 0.2 0 0</pose><parent>root</parent>"
      "<child>slide</child><axis><xyz>0 1 0</xyz></axis></joint>"
      "<joint name='b' type='continuous'><pose>0 0.1 0 0 0.3 0</pose><parent>slide</parent>"
      "<child>tip</child><axis><xyz>0 0.6 0.8</xyz></axis></joint></model>");
  const ToolAssembly tool = assemble_tool(world, "t");
  CHECK(tool.description.dof() == 8);
  CHECK(tool.bodies == std::vector<int>{1, 2, 0});
  check_initial_poses(world, tool);
}

TEST_CASE("The tool's length is its largest reach from the hand") {
  const WorldDescription world = test::repository_world("testbed.sdf");
  CHECK(assemble_tool(world, "peg").description.length ==
        Approx(Vector3(0.04, 0.02, 0.02).norm()).margin(1e-12));
}

TEST_CASE("A model that cannot be a tool is an error that says why") {
  const WorldDescription world = world_of(
      fixed_model("wall", "0 0 0 0 0 0", box("1 1 1")) + model("ball", "0 0 0 0 0 0", "") +
      "<model name='pair'><link name='a'/><link name='b'/></model>"
      "<model name='odd'><haptic:hand><link>nobody</link></haptic:hand><link name='a'/></model>"
      "<model name='lamp'><link name='a'/><link name='b'/>"
      "<joint name='hip' type='ball'><parent>a</parent><child>b</child></joint></model>"
      "<model name='stuck'><link name='a'/>"
      "<joint name='j' type='fixed'><parent>world</parent><child>a</child></joint></model>");
  CHECK_THROWS_WITH(assemble_tool(world, "peg"),
                    ContainsSubstring("'peg'") && ContainsSubstring("wall, ball, pair"));
  CHECK_THROWS_WITH(assemble_tool(world, "wall"), ContainsSubstring("static"));
  CHECK_THROWS_WITH(assemble_tool(world, "lamp"),
                    ContainsSubstring("joint 'lamp::hip' is a ball joint") &&
                        ContainsSubstring("three revolute"));
  CHECK_THROWS_WITH(assemble_tool(world, "pair"), ContainsSubstring("one tree"));
  CHECK_THROWS_WITH(assemble_tool(world, "odd"), ContainsSubstring("'nobody'"));
  CHECK_THROWS_WITH(assemble_tool(world, "stuck"), ContainsSubstring("degrees of freedom 0"));
}

TEST_CASE("A gripper drives the joints that it names, and a wrong one is an error that says why") {
  const WorldDescription& world = test::repository_world("gripper.sdf");
  const ToolAssembly tool = assemble_tool(world, "gripper");
  REQUIRE(tool.drives.size() == 2);
  for (const JointDrive& drive : tool.drives) {
    CHECK(drive.follows_device);
    CHECK(drive.closed == -0.034);
    CHECK(drive.open == 0.005);
    CHECK(drive.most == 20);
  }
  const auto error_after = [&](auto change) {
    WorldDescription wrong = world;
    for (ModelDescription& model : wrong.models) {
      if (model.gripper) change(*model.gripper);
    }
    try {
      assemble_tool(wrong, "gripper");
    } catch (const std::runtime_error& error) {
      return std::string(error.what());
    }
    return std::string("none");
  };
  using G = GripperDescription;
  CHECK_THAT(error_after([](G& g) { g.joints[0] = "middle"; }),
             ContainsSubstring("<joint> 'middle' must be a joint of the model"));
  CHECK_THAT(error_after([](G& g) { g.joints[1] = g.joints[0]; }),
             ContainsSubstring("one, not two"));
  CHECK_THAT(error_after([](G& g) { g.joints.assign(20, g.joints[0]); }),
             ContainsSubstring("<haptic:gripper>"));
  CHECK_THAT(error_after([](G& g) { g.stiffness = 1e12; }), ContainsSubstring("stiffness 1e+12"));
}

TEST_CASE("Joint limits are those of the tool's links") {
  const WorldDescription world = world_of(
      "<model name='stopped'><link name='a'/><link name='b'/>"
      "<joint name='j' type='revolute'><parent>a</parent><child>b</child><axis><xyz>0 0 1</xyz>"
      "<limit><lower>-1</lower><upper>1</upper></limit></axis></joint></model>");
  const ToolDescription tool = assemble_tool(world, "stopped").description;
  CHECK(tool.links[0].lower == -kNoLimit);
  CHECK(tool.links[0].upper == kNoLimit);
  CHECK(tool.links[1].lower == -1);  // rad
  CHECK(tool.links[1].upper == 1);
}

}  // namespace
}  // namespace hlm::ve
