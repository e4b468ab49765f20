// URDF files of the kinds that are common in public: what engines of URDF make of them.
#include <numbers>

#include <Eigen/Eigenvalues>

#include "hlm/ve_client/world/world.h"
#include "tests/support/catch.h"
#include "tests/support/worlds.h"

namespace hlm::ve {
namespace {

using Catch::Matchers::ContainsSubstring;

struct Loaded {
  WorldDescription world;
  std::string said;  ///< All findings, one a line.
};

/// A robot of this file that can be used.
Loaded robot(const std::string& contents) {
  Diagnostics diagnostics;
  Loaded loaded;
  loaded.world = parse_world("<robot name='r'>" + contents + "</robot>", "r.urdf", diagnostics);
  for (const Finding& finding : diagnostics.findings()) {
    loaded.said += to_string(finding) + "\n";
  }
  CAPTURE(loaded.said);
  CHECK(diagnostics.usable());
  return loaded;
}

const BodyDescription& body(const Loaded& loaded, const std::string& name) {
  const auto found = std::ranges::find(loaded.world.bodies, "r::" + name, &BodyDescription::name);
  REQUIRE(found != loaded.world.bodies.end());
  return *found;
}

std::string link(const std::string& name, const std::string& contents) {
  return "<link name='" + name + "'>" + contents + "</link>";
}

std::string joint(const std::string& type, const std::string& parent, const std::string& child,
                  const std::string& origin = "") {
  return "<joint name='" + child + "_joint' type='" + type + "'><parent link='" + parent +
         "'/><child link='" + child + "'/><axis xyz='0 0 1'/><origin " + origin + "/></joint>";
}

std::string collision(const std::string& geometry) {
  return "<collision><geometry>" + geometry + "</geometry></collision>";
}

const std::string kCube = collision("<box size='1 1 1'/>");
const std::string kMass =
    "<inertial><mass value='2'/><inertia ixx='0.3' iyy='0.4' izz='0.5' ixy='0' ixz='0' iyz='0'/>"
    "</inertial>";
const std::string kNoMass =
    "<inertial><mass value='0'/><inertia ixx='0' iyy='0' izz='0' ixy='0' ixz='0' iyz='0'/>"
    "</inertial>";

TEST_CASE("A root without mass is fixed to the world, and what hangs on it moves") {
  for (const std::string& root : {kCube, kNoMass + kCube}) {
    const Loaded arm =
        robot(link("base", root) + link("tip", "") + link("arm", kMass + kCube) +
              joint("continuous", "base", "arm", "xyz='0 0 2'") + joint("fixed", "arm", "tip"));
    REQUIRE(arm.world.bodies.size() == 2);
    CHECK(body(arm, "base").fixed);
    CHECK(body(arm, "base").collisions.size() == 1);
    CHECK_FALSE(body(arm, "arm").fixed);
    CHECK(body(arm, "arm").X_WB.p.isApprox(Vector3(0, 0, 2)));
    CHECK_THAT(arm.said, ContainsSubstring("link 'base': a root without mass is fixed"));
  }
  // A footprint that a fixed joint joins to what has mass is part of that.
  const Loaded rover = robot(link("footprint", "") + link("base", kMass + kCube) +
                             joint("fixed", "footprint", "base", "xyz='0 0 1'"));
  REQUIRE(rover.world.bodies.size() == 1);
  CHECK_FALSE(body(rover, "footprint").fixed);
  CHECK(body(rover, "footprint").mass == 2);
}

TEST_CASE("A link without mass that hangs on others turns as its shapes do, and carries others") {
  const Loaded arm = robot(link("base", kCube) + link("arm", kCube) + link("hand", kCube) +
                           joint("continuous", "base", "arm") + joint("continuous", "arm", "hand"));
  REQUIRE(arm.world.bodies.size() == 3);
  CHECK(body(arm, "hand").mass == 1);
  CHECK(body(arm, "hand").I_B.isApprox(Matrix3::Identity() / 6, 1e-9));
  CHECK_THAT(arm.said, ContainsSubstring("link 'arm': a link without <inertial> has 1 kg") &&
                           ContainsSubstring("(2 times)"));
}

TEST_CASE("A link without mass and shapes that carries nothing is left out, with a word") {
  const Loaded arm =
      robot(link("base", kMass) + link("camera", "") + link("lens", "") +
            joint("continuous", "base", "camera") + joint("fixed", "camera", "lens"));
  CHECK(arm.world.bodies.size() == 1);
  CHECK(arm.world.joints.empty());
  CHECK_THAT(arm.said, ContainsSubstring("link 'camera': a link without mass and shapes"));
}

TEST_CASE("Links that fixed joints join weigh and turn as one body, wherever they stand") {
  const std::string origin = "xyz='0.3 -0.2 0.1' rpy='0.4 -0.5 0.6'";
  const Loaded one =
      robot(link("a", kMass) + link("b", kCube) +
            link("c",
                 "<inertial><origin xyz='0.1 0 0' rpy='0 0 0.3'/><mass value='3'/><inertia ixx='1' "
                 "iyy='2' izz='2.5' ixy='0.1' ixz='0' iyz='0'/></inertial>") +
            joint("fixed", "a", "b", origin) + joint("fixed", "b", "c", origin));
  REQUIRE(one.world.bodies.size() == 1);
  const BodyDescription& whole = one.world.bodies[0];
  const Pose X{{0.3, -0.2, 0.1},
               Quaternion(Eigen::AngleAxisd(0.6, Vector3::UnitZ()) *
                          Eigen::AngleAxisd(-0.5, Vector3::UnitY()) *
                          Eigen::AngleAxisd(0.4, Vector3::UnitX()))};
  const Pose X_AC = X * X;
  const Vector3 p_C = X_AC * Vector3(0.1, 0, 0);
  CHECK(whole.mass == Approx(5));
  CHECK(whole.X_WB.p.isApprox(3 * p_C / 5, 1e-9));
  CHECK((whole.X_WB * whole.collisions.at(0).X_BG).p.isApprox(X.p, 1e-9));
  CHECK((whole.X_WB * whole.collisions[0].X_BG).R.isApprox(X.R, 1e-9));
  Matrix3 I_C;
  I_C << 1, 0.1, 0, 0.1, 2, 0, 0, 0, 2.5;
  const Matrix3 R =
      (X_AC.R * Quaternion(Eigen::AngleAxisd(0.3, Vector3::UnitZ()))).toRotationMatrix();
  const Matrix3 I_A = Vector3(0.3, 0.4, 0.5).asDiagonal();
  const Matrix3 between = p_C.squaredNorm() * Matrix3::Identity() - p_C * p_C.transpose();
  const Matrix3 due = I_A + R * I_C * R.transpose() + 2 * 3 / 5.0 * between;
  CHECK(whole.I_B.isApprox(due, 1e-9));
}

TEST_CASE("A root that is called world is the world, and any other link is one like others") {
  const std::string arm = link("arm", kMass + kCube) + joint("continuous", "world", "arm");
  const Loaded bare = robot(link("world", "") + arm);
  CHECK(bare.world.bodies.size() == 1);
  CHECK(bare.world.joints.at(0).parent == -1);
  for (const std::string& mass : {std::string(), kNoMass, kMass}) {
    const Loaded ground = robot(link("world", mass + kCube) + arm);
    REQUIRE(ground.world.bodies.size() == 2);
    CHECK(body(ground, "world_link").fixed);
    CHECK(body(ground, "world_link").collisions.size() == 1);
    CHECK_FALSE(body(ground, "arm").fixed);
  }
  CHECK(body(robot(link("world", kCube)), "world_link").fixed);
  const Loaded held =
      robot(link("base", kMass) + link("world", kMass) + joint("continuous", "base", "world"));
  CHECK_FALSE(body(held, "world_link").fixed);
}

TEST_CASE("Shapes of later URDF, and those that nobody knows, cost no other shape") {
  const Loaded shapes =
      robot(link("a", kMass + "<visual><geometry><blob/></geometry></visual>" +
                          collision("<capsule radius='0.1' length='0.3'/>") + collision("<blob/>") +
                          collision("<sphere radius='0.2'/>") + "<collision/>"));
  const auto& collisions = shapes.world.bodies.at(0).collisions;
  REQUIRE(collisions.size() == 2);
  const auto& capsule = std::get<Capsule>(collisions[0].shape);
  CHECK(capsule.radius == 0.1);
  CHECK(capsule.length == 0.3);
  CHECK(std::get<Sphere>(collisions[1].shape).radius == 0.2);
  CHECK_THAT(shapes.said, ContainsSubstring("<blob> is not known here") &&
                              ContainsSubstring("collision 'a_collision_1'") &&
                              ContainsSubstring("is left out (2 times)"));
  const Loaded plane = robot(link("ground", collision("<plane normal='0 0 1'/>")));
  CHECK(std::holds_alternative<HalfSpace>(body(plane, "ground").collisions.at(0).shape));
}

TEST_CASE("A mesh of a URDF file may have one scale for all axes") {
  const std::string file = std::string(HLM_TEST_WORLDS) + "/meshes/crowded_edge.obj";
  const auto extent = [&](const std::string& scale) {
    const Loaded mesh = robot(link("a", collision("<mesh filename='" + file + "'" + scale + "/>")));
    REQUIRE_FALSE(mesh.world.bodies.at(0).collisions.empty());
    double most = 0;
    for (const CollisionDescription& piece : mesh.world.bodies[0].collisions) {
      for (const Vector3& p : std::get<Hull>(piece.shape).vertices) most = std::max(most, p.norm());
    }
    return most;
  };
  CHECK(extent(" scale='3'") == Approx(extent(" scale='3 3 3'")));
  CHECK(extent(" scale='3'") == Approx(3 * extent("")).epsilon(0.01));  // A skin is thick.
}

TEST_CASE("Friction of a link is what a file says for Gazebo or Bullet") {
  const Loaded rubber =
      robot(link("a", kMass + kCube + "<contact><lateral_friction value='0.7'/></contact>") +
            link("b", kMass + kCube) + joint("continuous", "a", "b") +
            "<gazebo reference='b'><mu1>0.2</mu1><turnGravityOff>true</turnGravityOff></gazebo>");
  CHECK(body(rubber, "a").collisions.at(0).friction == 0.7);
  CHECK(body(rubber, "b").collisions.at(0).friction == 0.2);
  CHECK(body(rubber, "b").weightless);
}

TEST_CASE("A joint of Bullet's type spherical is a ball joint, and a robot needs no name") {
  const Loaded arm = robot(link("a", kMass) + link("b", kMass) + joint("spherical", "a", "b"));
  CHECK(arm.world.joints.at(0).type == BodyJoint::kBall);
  CHECK_NOTHROW(parse_world("<robot>" + link("a", kMass) + "</robot>", "r.urdf"));
}

TEST_CASE("A URDF file that is no tree is refused, with the links that make it none") {
  const auto error_of = [](const std::string& contents) {
    try {
      parse_world("<robot name='r'>" + contents + "</robot>", "r.urdf");
    } catch (const RefusedWorld& refused) {
      return std::string(refused.what());
    }
    return std::string();
  };
  CHECK_THAT(error_of(link("a", kMass) + link("b", kMass)),
             ContainsSubstring("links 'a' and 'b' are no joint's child"));
  CHECK_THAT(error_of(link("a", kMass) + joint("fixed", "a", "b")),
             ContainsSubstring("joins a link 'b', which the file does not have"));
  CHECK_THAT(error_of(link("a", kMass) + link("b", kMass) + link("c", kMass) +
                      joint("continuous", "b", "c") + joint("continuous", "c", "b")),
             ContainsSubstring("loop"));
  CHECK_THAT(error_of(link("a", kMass) + link("a", kMass)), ContainsSubstring("<link> name 'a'"));
}

}  // namespace
}  // namespace hlm::ve
