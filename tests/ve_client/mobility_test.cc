// How jointed bodies answer forces, against probing: a wrench on the simulated body for one short
// step.
#include "hlm/ve_client/world/world.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/worlds.h"

namespace hlm::ve {
namespace {

constexpr double kStep = 1e-4;  // s: short, so that positions hardly change.
const std::string kEarth = "1 -2 -9.81";

std::string link(const std::string& name, const std::string& pose) {
  return "<link name='" + name + "'><pose>" + pose +
         "</pose><inertial><mass>0.8</mass><inertia><ixx>1e-3</ixx><iyy>3e-3</iyy><izz>2.5e-3</izz>"
         "<ixy>2e-4</ixy></inertia></inertial></link>";
}

std::string joint(const std::string& name, const std::string& type, const std::string& parent,
                  const std::string& child, const std::string& dynamics = "") {
  return "<joint name='" + name + "' type='" + type +
         "'><pose>-0.15 0.02 0 0.3 0.2 0.1</pose><parent>" + parent + "</parent><child>" + child +
         "</child><axis><xyz>0 0.6 0.8</xyz>" + dynamics + "</axis></joint>";
}

const std::string kSpring =
    "<dynamics><spring_stiffness>3</spring_stiffness><spring_reference>-0.2</spring_reference>"
    "<damping>0.05</damping></dynamics>";

WorldDescription world_of(const std::string& contents) {
  WorldDescription description = test::world_of("<model name='m'>" + contents + "</model>", kEarth);
  description.solver.sweeps = 2000;  // Until the joints hold exactly.
  description.solver.largest_step = kStep;
  return description;
}

Wrench random_wrench(test::Random& random) {
  Wrench F;
  F << random.vector(20), random.vector(0.5);
  return F;
}

/// Sets the bodies in motion as their joints allow, and lets them go.
void stir(World& world, test::Random& random) {
  std::vector<Wrench> wrenches;
  for (std::size_t i = 0; i < world.description().bodies.size(); ++i) {
    wrenches.push_back(random_wrench(random));
  }
  for (int i = 0; i < 300; ++i) {
    for (std::size_t body = 0; body < wrenches.size() && i < 200; ++body) {
      world.add_wrench(static_cast<int>(body), wrenches[body]);
    }
    world.step(kStep, {});
  }
}

/// The change of velocity of `body` in one short step with a wrench on it, m/s and rad/s.
Twist probe(const World& state, int body, const Wrench& F) {
  World world(state.description(), {});
  for (int i = 0; i < static_cast<int>(state.description().bodies.size()); ++i) {
    world.set_pose(i, state.X_WB(i));
    world.set_velocity(i, state.V_WB(i));
  }
  world.add_wrench(body, F);
  world.step(kStep, {});
  return world.V_WB(body) - state.V_WB(body);
}

TEST_CASE("Inverse inertia and free acceleration are those of the simulated body, however joined") {
  const std::string contents = GENERATE(
      as<std::string>{}, link("a", "0 0 0 0 0 0"),
      link("a", "0 0 0 0 0 0") + joint("door", "revolute", "world", "a"),
      link("a", "0 0 0 0 0 0") + joint("door", "revolute", "world", "a", kSpring),
      link("a", "0 0 0 0 0 0") + joint("drawer", "prismatic", "world", "a", kSpring),
      link("a", "0 0 0 0 0 0") + link("b", "0.3 0 0 0 0.4 0") + joint("j", "revolute", "a", "b"),
      link("a", "0 0 0 0 0 0") + joint("lamp", "ball", "world", "a"),
      link("a", "0 0 0 0 0 0") + link("b", "0.3 0 0 0 0.4 0") +
          joint("shoulder", "ball", "world", "a") + joint("elbow", "ball", "a", "b"),
      link("a", "0 0 0 0 0 0") + link("b", "0.3 0 0 0 0.4 0") +
          joint("shoulder", "revolute", "world", "a", kSpring) +
          joint("elbow", "revolute", "a", "b", kSpring),
      link("a", "0 0 0 0 0 0") + link("b", "0.3 0 0 0 0.4 0") +
          joint("shoulder", "revolute", "world", "a") + joint("slide", "prismatic", "a", "b"));
  CAPTURE(contents);
  test::Random random;
  World world(world_of(contents), {});
  stir(world, random);
  for (int body = 0; body < static_cast<int>(world.description().bodies.size()); ++body) {
    const Twist unpushed = probe(world, body, Wrench::Zero());
    const Vector6 A = world.mobility_of(body).A_W;
    CAPTURE(A.transpose(), unpushed.transpose() / kStep);
    CHECK((unpushed / kStep - A).norm() < 0.02 * (1 + A.norm()));
    const Matrix6 W = world.mobility_of(body).W;
    CHECK((W - W.transpose()).norm() < 1e-9 * W.norm());
    for (int i = 0; i < 6; ++i) {
      const Wrench F = random_wrench(random);
      const Vector6 a = (probe(world, body, F) - unpushed) / kStep;
      CAPTURE(a.transpose(), (W * F).transpose());
      CHECK((a - W * F).norm() < 5e-3 * a.norm());
    }
  }
}

TEST_CASE("A body without joints has its own mass and inertia") {
  World world(world_of(link("a", "0 0 0 0 0 1.5707963267948966")), {});
  const Matrix6 W = world.mobility_of(0).W;
  CHECK(W(0, 0) == Approx(1 / 0.8));
  Matrix3 I;
  I << 3e-3, -2e-4, 0, -2e-4, 1e-3, 0, 0, 0, 2.5e-3;  // Turned by a quarter about z.
  CHECK((W.bottomRightCorner<3, 3>() * I - Matrix3::Identity()).norm() < 1e-9);
}

TEST_CASE("A body that is welded to the world cannot be moved") {
  WorldDescription description =
      world_of(link("a", "0 0 0 0 0 0") + joint("weld", "fixed", "world", "a"));
  description.bodies.at(0).fixed = false;  // As if the joint alone held it.
  World world(description, {});
  CHECK(world.mobility_of(0).W.norm() < 1e-9);
  CHECK(world.mobility_of(0).A_W.norm() < 1e-9);
}

TEST_CASE("A spring that the solver's steps cannot hold is an error with the limit") {
  const std::string stiff = "<dynamics><spring_stiffness>1e9</spring_stiffness></dynamics>";
  const WorldDescription description =
      world_of(link("a", "0 0 0 0 0 0") + joint("door", "revolute", "world", "a", stiff));
  CHECK_THROWS_WITH(World(description, {}),
                    Catch::Contains("m::door: spring_stiffness") && Catch::Contains("must be"));
}

}  // namespace
}  // namespace hlm::ve
