// A hand in a Bullet world. The hand's tool, a box, has no weight.
//
//   haptic_server --device-option freedom=spatial --hand HAND.toml   # in another terminal
//   touch_bullet table 127.0.0.1:47800 10 60       # 10 s, 60 frames a second
//
// Scenes: table, brick, puck, tray, hole.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <vector>

#include <btBulletDynamicsCommon.h>
#include <hlm/client/bullet/session.h>
#include <hlm/protocol/transport/udp_socket.h>

namespace {

constexpr double kStep = 1.0 / 480;  // s, of Bullet's steps, at least one in a frame

/// A Bullet world and what it is made of.
class World {
 public:
  World() : world_(&dispatcher_, &broadphase_, &solver_, &configuration_) {
    world_.setGravity({0, 0, btScalar(-9.81)});
  }
  World(const World&) = delete;
  ~World() {
    for (const auto& joint : joints_) world_.removeConstraint(joint.get());
    for (const auto& body : bodies_) world_.removeRigidBody(body.get());
  }

  /// A body of that mass, kg; 0: it stands still. `centre`: m.
  btRigidBody& add(std::unique_ptr<btCollisionShape> shape, const btVector3& centre,
                   btScalar mass = 0, btScalar friction = btScalar(0.7)) {
    btVector3 inertia(0, 0, 0);
    if (mass > 0) shape->calculateLocalInertia(mass, inertia);
    btRigidBody::btRigidBodyConstructionInfo info(mass, nullptr, shape.get(), inertia);
    info.m_startWorldTransform.setOrigin(centre);
    info.m_friction = friction;
    shapes_.push_back(std::move(shape));
    bodies_.push_back(std::make_unique<btRigidBody>(info));
    world_.addRigidBody(bodies_.back().get());
    return *bodies_.back();
  }
  btRigidBody& add_box(const btVector3& size, const btVector3& centre, btScalar mass = 0,
                       btScalar friction = btScalar(0.7)) {
    return add(std::make_unique<btBoxShape>(size / 2), centre, mass, friction);
  }

  void join(std::unique_ptr<btTypedConstraint> joint) {
    joints_.push_back(std::move(joint));
    world_.addConstraint(joints_.back().get(), true);
  }

  btDiscreteDynamicsWorld& bullet() { return world_; }

 private:
  btDefaultCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_{&configuration_};
  btDbvtBroadphase broadphase_;
  btSequentialImpulseConstraintSolver solver_;
  std::vector<std::unique_ptr<btCollisionShape>> shapes_;
  std::vector<std::unique_ptr<btRigidBody>> bodies_;
  std::vector<std::unique_ptr<btTypedConstraint>> joints_;
  btDiscreteDynamicsWorld world_;
};

struct Scene {
  btRigidBody* tool;
  btRigidBody* body;  ///< What the tool can move; null: nothing.
};

/// Friction of two bodies is the product of their coefficients.
Scene make(std::string_view name, World& world) {
  constexpr btScalar cm = btScalar(0.01);
  world.add(std::make_unique<btStaticPlaneShape>(btVector3(0, 0, 1), btScalar(0)), {0, 0, 0}, 0, 1);
  const auto make_tool = [&](const btVector3& size, btScalar height, btScalar friction) {
    btRigidBody* tool = &world.add_box(size, {0, 0, height}, btScalar(0.1), friction);
    tool->setGravity({0, 0, 0});
    return tool;
  };
  if (name == "table") return {make_tool({4 * cm, 4 * cm, 4 * cm}, 3 * cm, btScalar(0.5)), nullptr};
  if (name == "brick" || name == "puck") {
    btRigidBody* tool = make_tool({4 * cm, 4 * cm, 3 * cm}, 2 * cm, 0);
    return {tool, &world.add_box({4 * cm, 8 * cm, 4 * cm}, {8 * cm, 0, 2 * cm}, btScalar(0.3),
                                 name == "puck" ? 0 : btScalar(0.4))};
  }
  if (name == "tray") {  // It comes up between two rails, on which the body lies.
    for (const btScalar y : {btScalar(-7), btScalar(7)}) {
      world.add_box({10 * cm, 2 * cm, 6 * cm}, {0, y * cm, 3 * cm});
    }
    btRigidBody* tool = make_tool({10 * cm, 10 * cm, cm}, btScalar(4.5) * cm, btScalar(0.7));
    return {tool, &world.add_box({4 * cm, 14 * cm, 4 * cm}, {0, 0, 8 * cm}, btScalar(0.3))};
  }
  if (name == "seesaw") {  // A plank on a hinge; a cube on its right end, which lies on a post.
    btRigidBody& plank = world.add_box({40 * cm, 6 * cm, cm}, {0, 0, 10 * cm}, btScalar(0.4));
    const btVector3 middle(0, 0, 0);
    world.join(std::make_unique<btHingeConstraint>(plank, middle, btVector3(0, 1, 0)));
    world.add_box({2 * cm, 6 * cm, 9 * cm}, {19 * cm, 0, 5 * cm});
    btRigidBody* tool = make_tool({cm, 4 * cm, 3 * cm}, 13 * cm, btScalar(0.5));
    tool->translate({-15 * cm, 0, 0});
    const btScalar height = btScalar(12.5) * cm;
    return {tool, &world.add_box({4 * cm, 4 * cm, 4 * cm}, {15 * cm, 0, height}, btScalar(0.3))};
  }
  if (name == "drawer") {  // It slides along x.
    btRigidBody* tool = make_tool({4 * cm, 4 * cm, 3 * cm}, 3 * cm, 0);
    const btVector3 at(8 * cm, 0, 4 * cm);
    btRigidBody& drawer = world.add_box({4 * cm, 8 * cm, 4 * cm}, at, btScalar(0.3), 0);
    world.join(std::make_unique<btSliderConstraint>(drawer, btTransform::getIdentity(), true));
    return {tool, &drawer};
  }
  if (name == "hole") {
    for (const btScalar x : {btScalar(-3.01), btScalar(3.01)}) {
      world.add_box({4 * cm, 8 * cm, 6 * cm}, {x * cm, 0, 3 * cm});
    }
    return {make_tool({2 * cm, 2 * cm, 6 * cm}, 10 * cm, 0), nullptr};
  }
  throw std::invalid_argument(
      "scene must be table, brick, puck, tray, seesaw, drawer or hole, not " + std::string(name));
}

void simulate(std::string_view name, const char* server, double seconds, double rate) {
  const double period = 1 / rate;
  World world;
  const Scene scene = make(name, world);
  hlm::protocol::UdpSocket socket(hlm::protocol::Endpoint{});  // any free port
  hlm::bullet::Options options;
  options.server = hlm::protocol::resolve(server);
  options.period = period;
  options.step = std::min(kStep, period);
  hlm::bullet::Session touch(socket, world.bullet(), *scene.tool, options);

  const auto start = std::chrono::steady_clock::now();
  const int frames = static_cast<int>(seconds * rate);
  for (int frame = 1; frame <= frames; ++frame) {
    const int steps = touch.drive();
    world.bullet().stepSimulation(btScalar(steps * options.step), steps + 1,
                                  btScalar(options.step));
    touch.send();
    if (frame % std::max(1, static_cast<int>(rate / 2)) == 0) {
      const btVector3 body =
          scene.body != nullptr ? scene.body->getCenterOfMassPosition() : btVector3(0, 0, 0);
      std::printf("%s, tool at (%.4f, %.4f, %.4f) m, body at (%.4f, %.4f, %.4f) m, contacts: %zu\n",
                  touch.client().connected() ? "connected" : "no server", touch.q()[0],
                  touch.q()[1], touch.q()[2], double{body.x()}, double{body.y()}, double{body.z()},
                  touch.contacts());
    }
    std::this_thread::sleep_until(start + frame * std::chrono::duration<double>(period));
  }
  touch.close();
}

}  // namespace

int main(int argc, char** argv) try {
  simulate(argc > 1 ? argv[1] : "table", argc > 2 ? argv[2] : "127.0.0.1:47800",
           argc > 3 ? std::atof(argv[3]) : 10, argc > 4 ? std::atof(argv[4]) : 60);
} catch (const std::exception& error) {
  std::fprintf(stderr, "touch_bullet: %s\n", error.what());
  return 1;
}
