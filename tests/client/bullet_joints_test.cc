// What joints leave of bodies' mobility, against what Bullet's own solver makes of a push.
#include <memory>

#include "hlm/client/bullet/joints.h"
#include "tests/support/catch.h"

namespace hlm::bullet {
namespace {

constexpr btScalar kStep = btScalar(1e-3);  // s

class World {
 public:
  explicit World(const btVector3& gravity)
      : world_(&dispatcher_, &broadphase_, &solver_, &configuration_) {
    world_.setGravity(gravity);
    world_.getSolverInfo().m_numIterations = 500;
    world_.getSolverInfo().m_erp = 0;  // No velocity that only mends how joints have drifted.
    world_.getSolverInfo().m_solverMode &= ~SOLVER_USE_WARMSTARTING;
  }
  World(const World&) = delete;
  ~World() {
    for (const auto& joint : joints_) world_.removeConstraint(joint.get());
    for (const auto& body : bodies_) world_.removeRigidBody(body.get());
  }

  btRigidBody& add(const btVector3& half, const btVector3& centre, btScalar mass) {
    shapes_.push_back(std::make_unique<btBoxShape>(half));
    btVector3 inertia(0, 0, 0);
    shapes_.back()->calculateLocalInertia(mass, inertia);
    btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, shapes_.back().get(), inertia);
    info.m_startWorldTransform.setOrigin(centre);
    bodies_.push_back(std::make_unique<btRigidBody>(info));
    world_.addRigidBody(bodies_.back().get(), 0, 0);  // Nothing touches anything.
    return *bodies_.back();
  }
  template <class Joint, class... Arguments>
  void join(Arguments&&... arguments) {
    keep(std::make_unique<Joint>(std::forward<Arguments>(arguments)...));
  }
  void keep(std::unique_ptr<btTypedConstraint> joint) {
    joints_.push_back(std::move(joint));
    world_.addConstraint(joints_.back().get());
  }
  btDiscreteDynamicsWorld& bullet() { return world_; }
  void step() { world_.stepSimulation(kStep, 0, kStep); }

 private:
  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_{&configuration_};
  btDbvtBroadphase broadphase_;
  btSequentialImpulseConstraintSolver solver_;
  std::vector<std::unique_ptr<btBoxShape>> shapes_;
  std::vector<std::unique_ptr<btRigidBody>> bodies_;
  std::vector<std::unique_ptr<btTypedConstraint>> joints_;
  btDiscreteDynamicsWorld world_;
};

Vector6 twist(const btRigidBody& body) {
  Vector6 V;
  V << vector_of(body.getLinearVelocity()), vector_of(body.getAngularVelocity());
  return V;
}

/// A push of 1 N and 0.1 N·m for one step, and what it changes.
Vector6 push(World& world, btRigidBody& body, const Vector6& F) {
  const Vector6 before = twist(body);
  body.applyCentralForce({btScalar(F[0]), btScalar(F[1]), btScalar(F[2])});
  body.applyTorque({btScalar(F[3]), btScalar(F[4]), btScalar(F[5])});
  world.step();
  return (twist(body) - before) / double{kStep};
}

const Vector6 kPush = (Vector6() << 1, -0.5, 0.8, 0.05, 0.1, -0.07).finished();

TEST_CASE("A plank on a hinge answers a push as Bullet's solver makes it answer") {
  World world({0, 0, btScalar(-9.81)});
  btRigidBody& plank =
      world.add({btScalar(0.2), btScalar(0.03), btScalar(0.005)}, {0, 0, 0}, btScalar(0.4));
  world.join<btHingeConstraint>(plank, btVector3(btScalar(-0.15), 0, 0), btVector3(0, 1, 0));
  const JointedBodies jointed(world.bullet(), plank);
  REQUIRE(jointed.has_joints());
  const Vector6 due = jointed.inverse_inertia(plank) * kPush + jointed.acceleration(plank);
  const Vector6 got = push(world, plank, kPush);
  CAPTURE(due.transpose(), got.transpose());
  CHECK((due - got).norm() < 0.01 * got.norm());
  // By hand: it falls about the hinge.
  const double I = 0.4 / 12 * (0.4 * 0.4 + 0.01 * 0.01) + 0.4 * 0.15 * 0.15;
  CHECK(jointed.acceleration(plank)[4] == Approx(0.4 * 9.81 * 0.15 / I).epsilon(1e-3));
}

TEST_CASE("A drawer on a slider moves along it alone") {
  World world({0, 0, btScalar(-9.81)});
  btRigidBody& drawer = world.add({btScalar(0.1), btScalar(0.1), btScalar(0.05)}, {0, 0, 0}, 2);
  btTransform frame;
  frame.setIdentity();
  world.join<btSliderConstraint>(drawer, frame, true);
  const JointedBodies jointed(world.bullet(), drawer);
  Matrix6 due = Matrix6::Zero();
  due(0, 0) = 0.5;
  const Matrix6 W = jointed.inverse_inertia(drawer);
  CHECK((W - due).topLeftCorner<3, 3>().norm() < 1e-4);
  CHECK(jointed.acceleration(drawer).norm() < 1e-3);
}

TEST_CASE(
    "Of two bodies that a joint connects each has the other to move, and swings as it turns") {
  World world({0, 0, btScalar(-9.81)});
  btRigidBody& upper = world.add({btScalar(0.02), btScalar(0.02), btScalar(0.1)},
                                 {0, 0, btScalar(-0.1)}, btScalar(0.5));
  btRigidBody& lower = world.add({btScalar(0.02), btScalar(0.02), btScalar(0.1)},
                                 {0, 0, btScalar(-0.3)}, btScalar(0.3));
  world.join<btPoint2PointConstraint>(upper, btVector3(0, 0, btScalar(0.1)));
  world.join<btPoint2PointConstraint>(upper, lower, btVector3(0, 0, btScalar(-0.1)),
                                      btVector3(0, 0, btScalar(0.1)));
  SECTION("at rest") {}
  SECTION("swinging") {
    // About the hook with 3 rad/s, as one.
    for (btRigidBody* body : {&upper, &lower}) {
      body->setAngularVelocity({0, 3, 0});
      body->setLinearVelocity(btVector3(0, 3, 0).cross(body->getCenterOfMassPosition()));
    }
  }
  // A step turns the velocities as the joints ask in the poses before it.
  world.step();
  const JointedBodies jointed(world.bullet(), lower);
  const Vector6 due = jointed.inverse_inertia(lower) * kPush + jointed.acceleration(lower);
  const Vector6 got = push(world, lower, kPush);
  CAPTURE(due.transpose(), got.transpose());
  CHECK((due - got).head<3>().norm() < 0.02 * got.head<3>().norm());
  CHECK((due - got).tail<3>().norm() < 0.02 * got.tail<3>().norm());
}

TEST_CASE("Axes that a joint of six degrees locks are locked where nothing is off, too") {
  World world({0, 0, btScalar(-9.81)});
  btRigidBody& drawer = world.add({btScalar(0.1), btScalar(0.1), btScalar(0.05)}, {0, 0, 0}, 2);
  auto joint = std::make_unique<btGeneric6DofConstraint>(drawer, btTransform::getIdentity(), true);
  joint->setLinearLowerLimit({1, 0, 0});  // Free along x: the lower one above the upper.
  joint->setLinearUpperLimit({-1, 0, 0});
  joint->setAngularLowerLimit({0, 0, 0});
  joint->setAngularUpperLimit({0, 0, 0});
  world.keep(std::move(joint));
  const JointedBodies jointed(world.bullet(), drawer);
  Matrix6 due = Matrix6::Zero();
  due(0, 0) = 0.5;
  CHECK((jointed.inverse_inertia(drawer) - due).norm() < 1e-3);
  CHECK(jointed.acceleration(drawer).norm() < 1e-2);
}

TEST_CASE("A heavy door keeps its hinge though a tiny knob is on it") {
  World world({0, 0, 0});
  btRigidBody& door = world.add({1, btScalar(0.05), 1}, {1, 0, 0}, 200);
  btRigidBody& knob = world.add({btScalar(0.001), btScalar(0.001), btScalar(0.001)},
                                {2, btScalar(-0.05), 0}, btScalar(0.0003));
  world.join<btHingeConstraint>(door, btVector3(-1, 0, 0), btVector3(0, 0, 1));
  world.join<btPoint2PointConstraint>(door, knob, btVector3(1, btScalar(-0.05), 0),
                                      btVector3(0, 0, 0));
  const JointedBodies jointed(world.bullet(), door);
  REQUIRE(jointed.has(knob));
  const Matrix6 W = jointed.inverse_inertia(door);
  CHECK(W(0, 0) < 1e-6);  // 1/kg, along the door; free it has 5e-3.
  CHECK(W(2, 2) < 1e-6);
  const double I = 200.0 / 12 * (2 * 2 + 0.1 * 0.1) + 200 * 1 * 1;
  CHECK(W(5, 5) == Approx(1 / I).epsilon(1e-3));
}

TEST_CASE("A fast hinge turns its body's velocity, and brakes nothing") {
  World world({0, 0, 0});
  btRigidBody& rod =
      world.add({btScalar(0.5), btScalar(0.02), btScalar(0.02)}, {btScalar(0.5), 0, 0}, 1);
  world.join<btHingeConstraint>(rod, btVector3(btScalar(-0.5), 0, 0), btVector3(0, 0, 1));
  rod.setAngularVelocity({0, 0, 10});
  rod.setLinearVelocity({0, 5, 0});
  const JointedBodies jointed(world.bullet(), rod);
  const Vector6 A = jointed.acceleration(rod);
  CHECK(A[0] == Approx(-50).epsilon(0.01));  // m/s², ω² r
  CHECK(A[1] == Approx(0).margin(0.1));
  CHECK(A[5] == Approx(0).margin(0.2));  // rad/s²
}

}  // namespace
}  // namespace hlm::bullet
