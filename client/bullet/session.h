// A Bullet world in the hand.
//
//   hlm::bullet::Session touch(socket, world, tool, options);
//   while (running) {
//     const int steps = touch.drive();                         // proxy pose onto the tool
//     world.stepSimulation(steps * step, steps + 1, step);
//     touch.send();                                            // where bodies are
//   }
//
// Header only, over hlm::client and the user's Bullet; examples/bullet is a whole program.
#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include <btBulletDynamicsCommon.h>

#include "hlm/client/bullet/bodies.h"
#include "hlm/client/bullet/world_shapes.h"
#include "hlm/client/contact_check.h"
#include "hlm/client/haptic_client.h"
#include "hlm/common/steady_seconds.h"
#include "hlm/protocol/codec.h"

namespace hlm::bullet {

struct Options {
  protocol::Endpoint server;
  double period = 1.0 / 60;  ///< Roughly that of the frames, s.
  double step = 1.0 / 240;   ///< Bullet's step, the last argument of stepSimulation(), s, > 0.
  std::function<double()> clock = steady_seconds;  ///< s, any steady origin.
};

/// The virtual tool that a hand holds when it holds this body, with Bullet's mass for it.
inline ToolDescription tool_of(btRigidBody& body) {
  if (movable(body) == nullptr || body.getBroadphaseHandle() == nullptr) {
    throw std::invalid_argument("the tool must be a body with mass, in the world, that moves");
  }
  btVector3 low, high;
  body.getCollisionShape()->getAabb(btTransform::getIdentity(), low, high);
  Link link;
  link.mass = 1 / double{body.getInvMass()};
  link.I_LCom = vector_of(body.getLocalInertia()).asDiagonal();
  ToolDescription tool;
  tool.links.push_back(link);
  tool.gravity_W = vector_of(body.getGravity());
  tool.length = vector_of(high - low).maxCoeff();
  return tool;
}

/// A client for one world. Which motions joints allow a body comes from the rows of Bullet's own
/// solver (joints.h).
///
/// From construction on the tool is kinematic: it is where the proxy is. While the server answers,
/// the tool makes no force of its own, but pushes bodies by the impulses that the hand felt. The
/// bodies near it are kept awake.
class Session {
 public:
  /// All must outlive this. Throws std::invalid_argument if the tool is not a body with mass in the
  /// world, the options or a shape cannot be used.
  Session(protocol::DatagramLink& link, btDiscreteDynamicsWorld& world, btRigidBody& tool,
          const Options& options)
      : world_(world),
        tool_(tool),
        step_(options.step),
        clock_(options.clock),
        model_(tool_of(tool)),
        shapes_(world, tool),
        q_(configuration(tool.getWorldTransform())),
        client_(link, client_options(options)) {
    tool.setMassProps(0, {0, 0, 0});  // Bullet's solver would move a kinematic body that has mass.
    tool.setCollisionFlags((tool.getCollisionFlags() & ~btCollisionObject::CF_STATIC_OBJECT) |
                           btCollisionObject::CF_KINEMATIC_OBJECT);
    tool.setActivationState(DISABLE_DEACTIVATION);
    offer();
  }

  /// Before a frame: puts the tool where the proxy is, and applies its impulses on bodies as forces
  /// during all of the frame's steps. Returns how many steps to take: they bring Bullet's time up
  /// to the hand's, so frames may be late. 0 if less than a step has passed.
  int drive() {
    const protocol::ProxyState* proxy = client_.poll(clock_()).state;
    if (proxy != nullptr) {
      q_ = proxy->q;
      v_ = proxy->v;
      contacts_ = proxy->active_contacts;
    }
    const int steps = client_.take_steps(step_);
    frame_ = steps * step_;
    place_held();
    place(client_.tool_pushes());
    for (const protocol::BodyImpulse& due : client_.take_impulses(frame_)) {
      btCollisionObject* object = reported_.contains(due.body) ? find(world_, due.body) : nullptr;
      btRigidBody* body = object != nullptr ? movable(*object) : nullptr;
      if (body == nullptr) continue;
      const Vector6 F_W = due.P_W / frame_;
      body->activate();
      body->applyCentralForce(bullet_vector(F_W.head<3>()));
      body->applyTorque(bullet_vector(F_W.tail<3>()));
    }
    return steps;
  }

  /// After a frame: sends where bodies are. Throws std::invalid_argument if a shape cannot be used,
  /// Bullet's state is not finite, or something in it is out of a server's range.
  void send() {
    if (frame_ == 0) return;
    const double sampled_at = clock_();
    model_.set_configuration(q_);
    offer();
    const std::vector<WorldShapes::Moving> moving = shapes_.moving();
    protocol::ContactUpdate update;
    update.q_VE = q_;
    update.v_VE = v_;
    update.poses = WorldShapes::poses_of(moving);
    const auto has_pose = [&](const btRigidBody& body) {
      return std::ranges::find(update.poses, number_of(body), &BodyPose::body) !=
             update.poses.end();
    };
    std::vector<btRigidBody*> near;
    for (const auto& [object, gap] : moving) {
      btRigidBody* body = movable(*object);
      if (body != nullptr && gap <= reach()) near.push_back(body);
    }
    add_touching(world_, tool_, near);
    // What touches one that the server cannot hold goes with it.
    std::erase_if(near, [&](btRigidBody* body) { return client_.holds(number_of(*body)); });
    add_touching(world_, tool_, near);
    std::vector<JointedBodies> groups;
    for (btRigidBody* body : near) {
      body->activate();
      if (update.bodies.size() == kMaxBodies || !has_pose(*body)) continue;
      auto group = std::ranges::find_if(groups, [&](const auto& g) { return g.has(*body); });
      if (group == groups.end()) group = groups.emplace(group, world_, *body);
      update.bodies.push_back(describe(*body, *group));
      reported_.insert(number_of(*body));
    }
    if (const auto error = find_error(update, model_)) throw std::invalid_argument(*error);
    client_.sample(sampled_at, q_, v_, frame_);
    client_.follow_accelerations(update.bodies);
    client_.send(clock_(), {}, update.bodies, update.poses);
  }

  /// Ends the session. Bodies that the hand held have their weight again.
  void close() {
    client_.close(clock_());
    for (int i = 0; i < world_.getNumCollisionObjects(); ++i) {
      btRigidBody* body = movable(*world_.getCollisionObjectArray()[i]);
      if (body != nullptr) let_go(*body);
    }
  }

  HapticClient& client() { return client_; }
  /// Where the tool is, and how many contacts it has.
  const Configuration& q() const { return q_; }
  std::size_t contacts() const { return contacts_; }

 private:
  /// Bodies within this distance are sent, plus how far the tool travels until the third update
  /// from now has come, up to the farthest, m: a body that was not sent is a wall.
  double reach() const {
    constexpr double kNear = 0.02;
    constexpr double kFarthest = 0.3;
    constexpr double kUsualSpeed = 0.3;  // m/s: of a hand that was at rest.
    const double delay = client_.round_trip() + 2 * frame_;
    return std::min(kNear + 4.5 * delay * std::max(v_.head<3>().norm(), kUsualSpeed), kFarthest);
  }

  static btVector3 bullet_vector(const Vector3& v) {
    return {static_cast<btScalar>(v.x()), static_cast<btScalar>(v.y()),
            static_cast<btScalar>(v.z())};
  }
  static Configuration configuration(const btTransform& X_WT) {
    const btQuaternion turn = X_WT.getRotation();
    const Quaternion R = Quaternion(turn.w(), turn.x(), turn.y(), turn.z()).normalized();
    Configuration q(7);
    q << vector_of(X_WT.getOrigin()), R.w(), R.vec();
    return q;
  }

  HapticClientOptions client_options(const Options& options) const {
    HapticClientOptions client;
    client.server = options.server;
    client.tool = model_.description();
    client.q = q_;
    client.ve_rate = 1 / options.period;
    return client;
  }

  /// Puts the bodies that the hand holds where the server has them.
  void place_held() {
    for (const HeldPlace& held : client_.take_held()) {
      btCollisionObject* object = find(world_, held.body);
      btRigidBody* body = object != nullptr && object != &tool_ ? movable(*object) : nullptr;
      if (body == nullptr) continue;
      body->setWorldTransform(transform_of(held.X_WB));
      body->setInterpolationWorldTransform(body->getWorldTransform());
      body->setLinearVelocity(bullet_vector(held.V_W.head<3>()));
      body->setAngularVelocity(bullet_vector(held.V_W.tail<3>()));
      body->activate();
      if (is_held(held.number)) {  // It is not to fall.
        held_.try_emplace(body, body->getGravity());
        body->setGravity({0, 0, 0});
      } else {
        let_go(*body);
      }
    }
  }

  void let_go(btRigidBody& body) {
    const auto own = held_.find(&body);
    if (own == held_.end()) return;
    body.setGravity(own->second);
    held_.erase(own);
  }
  void offer() {
    shapes_.offer(client_, [this](const btRigidBody& body) {
      const auto own = held_.find(&body);
      return own == held_.end() ? body.getGravity() : own->second;
    });
  }

  static btTransform transform_of(const Pose& X) {
    const auto number = [](double x) { return static_cast<btScalar>(x); };
    const btQuaternion turn(number(X.R.x()), number(X.R.y()), number(X.R.z()), number(X.R.w()));
    return btTransform(turn, bullet_vector(X.p));
  }

  /// collides: it pushes what it touches in Bullet.
  void place(bool collides) {
    constexpr int kNoForce = btCollisionObject::CF_NO_CONTACT_RESPONSE;
    const int flags = tool_.getCollisionFlags();
    tool_.setCollisionFlags(collides ? flags & ~kNoForce : flags | kNoForce);
    const btTransform X_WT = transform_of({q_.head<3>(), {q_[3], q_[4], q_[5], q_[6]}});
    tool_.setWorldTransform(X_WT);
    if (tool_.getMotionState() != nullptr) tool_.getMotionState()->setWorldTransform(X_WT);
  }

  btDiscreteDynamicsWorld& world_;
  btRigidBody& tool_;
  double step_;
  std::function<double()> clock_;
  double frame_ = 0;  ///< Length of the present frame's steps, s.
  ToolModel model_;
  WorldShapes shapes_;
  Configuration q_;
  Velocity v_ = Velocity::Zero(6);
  HapticClient client_;
  std::map<const btRigidBody*, btVector3> held_;  ///< Gravity of what the hand holds.
  std::set<std::uint32_t> reported_;  ///< Bodies. The server can push no others, whatever it says.
  std::size_t contacts_ = 0;          ///< Of the tool, at the server.
};

}  // namespace hlm::bullet
