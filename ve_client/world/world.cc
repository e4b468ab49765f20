#include "ve_client/world/world.h"

#include <algorithm>
#include <array>
#include <mutex>

namespace hlm::ve {
namespace {

/// Sweeps of the constraint solver. More stop piles from sagging, at proportional cost.
constexpr int kIterations = 20;
/// Share of a joint's or contact's error that one step corrects. Near 1, stacks jump; near 0,
/// bodies sink into each other.
constexpr double kErrorReduction = 0.4;
/// Softness of joints and contacts, m/(N·s): enough to keep redundant contacts solvable; 1 N then
/// yields 1e-8 m/s.
constexpr double kConstraintForceMixing = 1e-8;
/// Speed, m/s, up to which overlap is pushed apart. Higher throws bodies that start overlapped.
constexpr double kMaxCorrectingVelocity = 1;
/// Overlap, m, that bodies keep when they rest on each other. With none, a resting body is in
/// contact in some steps and not in others: friction slips, and the tool's active contacts (σ <= 0)
/// flicker. With more than a tenth of a millimetre it can be seen.
constexpr double kRestingOverlap = 2e-5;
/// Contacts kept of one pair of the engine's shapes.
constexpr int kMaxPairContacts = 8;

/// Prepares the engine for the calling thread, once in the program's life.
void initialise_engine() {
  static const bool kInitialised = dInitODE2(0) != 0;
  (void)kInitialised;
  dAllocateODEDataForThread(static_cast<unsigned>(dAllocateMaskAll));
}

Vector3 to_vector(const dReal* v) { return {v[0], v[1], v[2]}; }

void set(dVector3& target, const Vector3& v) {
  target[0] = v.x();
  target[1] = v.y();
  target[2] = v.z();
}

/// A geometry with the shape at X_WG (which only a plane takes).
dGeomID create_geometry(dSpaceID space, const Shape& shape, const Pose& X_WG) {
  struct Creator {
    dGeomID operator()(const Sphere& s) const { return dCreateSphere(space, s.radius); }
    dGeomID operator()(const Capsule& s) const { return dCreateCapsule(space, s.radius, s.length); }
    dGeomID operator()(const Cylinder& s) const {
      return dCreateCylinder(space, s.radius, s.length);
    }
    dGeomID operator()(const Box& s) const {
      return dCreateBox(space, s.size.x(), s.size.y(), s.size.z());
    }
    dGeomID operator()(const HalfSpace&) const {
      const Vector3 n = X_WG.R * Vector3::UnitZ();
      return dCreatePlane(space, n.x(), n.y(), n.z(), n.dot(X_WG.p));
    }
    dSpaceID space;
    const Pose& X_WG;
  };
  return std::visit(Creator{space, X_WG}, shape);
}

const CollisionId& id_of(dGeomID geometry) {
  return *static_cast<const CollisionId*>(dGeomGetData(geometry));
}

std::array<dReal, 4> to_quaternion(const Quaternion& R) { return {R.w(), R.x(), R.y(), R.z()}; }

dContact frictional_contact(double friction) {
  dContact contact{};
  contact.surface.mode = dContactApprox1;
  contact.surface.mu = friction;
  return contact;
}

}  // namespace

World::World(const WorldDescription& description, std::span<const int> tool_bodies)
    : description_(description) {
  initialise_engine();
  world_.reset(dWorldCreate());
  space_.reset(dSweepAndPruneSpaceCreate(nullptr, dSAP_AXES_XYZ));
  contacts_.reset(dJointGroupCreate(0));
  query_box_.reset(dCreateBox(nullptr, 1, 1, 1));

  const Vector3& g = description_.gravity_W;
  dWorldSetGravity(world_.get(), g.x(), g.y(), g.z());
  dWorldSetQuickStepNumIterations(world_.get(), kIterations);
  dWorldSetERP(world_.get(), kErrorReduction);
  dWorldSetCFM(world_.get(), kConstraintForceMixing);
  dWorldSetContactMaxCorrectingVel(world_.get(), kMaxCorrectingVelocity);
  dWorldSetContactSurfaceLayer(world_.get(), 0);
  dWorldSetAutoDisableFlag(world_.get(), 0);
  add_bodies(tool_bodies);
  for (const JointDescription& joint : description_.joints) add_joint(joint);
}

void World::add_bodies(std::span<const int> tool_bodies) {
  std::size_t shapes = 0;
  for (const BodyDescription& body : description_.bodies) shapes += body.collisions.size();
  collision_ids_.reserve(shapes);  // Geometries keep pointers into it.

  for (int i = 0; i < static_cast<int>(description_.bodies.size()); ++i) {
    const BodyDescription& body = description_.bodies[static_cast<std::size_t>(i)];
    const bool is_tool = std::ranges::find(tool_bodies, i) != tool_bodies.end();
    bodies_.push_back(body.fixed ? nullptr : dBodyCreate(world_.get()));
    if (!body.fixed) {
      dMass mass;
      const Matrix3& I = body.I_B;
      dMassSetParameters(&mass, body.mass, 0, 0, 0, I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2),
                         I(1, 2));
      dBodySetMass(handle(i), &mass);
      dBodySetGravityMode(handle(i), !is_tool && !body.weightless);
      set_pose(i, body.X_WB);
    }
    if (!is_tool) add_geometries(i);
  }
}

void World::add_geometries(int index) {
  const BodyDescription& body = description_.bodies[static_cast<std::size_t>(index)];
  for (std::size_t i = 0; i < body.collisions.size(); ++i) {
    const CollisionDescription& collision = body.collisions[i];
    const Pose X_WG = body.X_WB * collision.X_BG;
    const dGeomID geometry = create_geometry(space_.get(), collision.shape, X_WG);
    collision_ids_.push_back({index, static_cast<int>(i)});
    dGeomSetData(geometry, &collision_ids_.back());
    if (std::holds_alternative<HalfSpace>(collision.shape)) continue;
    if (!body.fixed) {
      const Vector3& p = collision.X_BG.p;
      dGeomSetBody(geometry, handle(index));
      dGeomSetOffsetPosition(geometry, p.x(), p.y(), p.z());
      dGeomSetOffsetQuaternion(geometry, to_quaternion(collision.X_BG.R).data());
    } else {
      dGeomSetPosition(geometry, X_WG.p.x(), X_WG.p.y(), X_WG.p.z());
      dGeomSetQuaternion(geometry, to_quaternion(X_WG.R).data());
    }
  }
}

void World::add_joint(const JointDescription& joint) {
  const dBodyID child = handle(joint.child);
  const dBodyID parent = joint.parent < 0 ? nullptr : handle(joint.parent);
  if (child == nullptr && parent == nullptr) return;
  const Vector3 axis = joint.X_WJ.R * joint.axis_J;
  const Vector3& p = joint.X_WJ.p;
  switch (joint.type) {
    case JointType::kRevolute: {
      const dJointID hinge = dJointCreateHinge(world_.get(), nullptr);
      dJointAttach(hinge, child, parent);
      dJointSetHingeAnchor(hinge, p.x(), p.y(), p.z());
      dJointSetHingeAxis(hinge, axis.x(), axis.y(), axis.z());
      dJointSetHingeParam(hinge, dParamLoStop, joint.lower);
      dJointSetHingeParam(hinge, dParamHiStop, joint.upper);
      return;
    }
    case JointType::kPrismatic: {
      const dJointID slider = dJointCreateSlider(world_.get(), nullptr);
      dJointAttach(slider, child, parent);
      dJointSetSliderAxis(slider, axis.x(), axis.y(), axis.z());
      dJointSetSliderParam(slider, dParamLoStop, joint.lower);
      dJointSetSliderParam(slider, dParamHiStop, joint.upper);
      return;
    }
    case JointType::kFixed:
    case JointType::kPlanar:
    case JointType::kFree: {  // SDF files have fixed joints only, of these.
      const dJointID fixed = dJointCreateFixed(world_.get(), nullptr);
      dJointAttach(fixed, child, parent);
      dJointSetFixed(fixed);
      return;
    }
  }
}

Pose World::X_WB(int body) const {
  const dBodyID b = handle(body);
  if (b == nullptr) return description_.bodies[static_cast<std::size_t>(body)].X_WB;
  const dReal* R = dBodyGetQuaternion(b);
  return {to_vector(dBodyGetPosition(b)), Quaternion(R[0], R[1], R[2], R[3])};
}

Twist World::V_WB(int body) const {
  const dBodyID b = handle(body);
  Twist V = Twist::Zero();
  if (b != nullptr) V << to_vector(dBodyGetLinearVel(b)), to_vector(dBodyGetAngularVel(b));
  return V;
}

Vector3 World::velocity_at(int body, const Vector3& p_W) const {
  const Twist V = V_WB(body);
  return V.head<3>() + V.tail<3>().cross(p_W - X_WB(body).p);
}

void World::set_pose(int body, const Pose& X_WB) {
  dBodySetPosition(handle(body), X_WB.p.x(), X_WB.p.y(), X_WB.p.z());
  dBodySetQuaternion(handle(body), to_quaternion(X_WB.R).data());
}

void World::set_velocity(int body, const Twist& V) {
  dBodySetLinearVel(handle(body), V[0], V[1], V[2]);
  dBodySetAngularVel(handle(body), V[3], V[4], V[5]);
}

void World::add_wrench(int body, const Wrench& F) {
  dBodyAddForce(handle(body), F[0], F[1], F[2]);
  dBodyAddTorque(handle(body), F[3], F[4], F[5]);
}

void World::make_kinematic(int body) {
  const dBodyID b = handle(body);
  while (dBodyGetNumJoints(b) > 0) dJointDestroy(dBodyGetJoint(b, 0));
  dBodySetKinematic(b);
  // Exact rotation for a constant angular velocity, so that the body arrives where it is sent.
  dBodySetFiniteRotationMode(b, 1);
}

void World::keep_planar(int body) {
  constexpr int kGlobalAxes = 0;
  const dJointID height = dJointCreateLMotor(world_.get(), nullptr);
  dJointAttach(height, handle(body), nullptr);
  dJointSetLMotorNumAxes(height, 1);
  dJointSetLMotorAxis(height, 0, kGlobalAxes, 0, 0, 1);
  dJointSetLMotorParam(height, dParamFMax, dInfinity);

  const dJointID tilt = dJointCreateAMotor(world_.get(), nullptr);
  dJointAttach(tilt, handle(body), nullptr);
  dJointSetAMotorNumAxes(tilt, 2);
  dJointSetAMotorAxis(tilt, 0, kGlobalAxes, 1, 0, 0);
  dJointSetAMotorAxis(tilt, 1, kGlobalAxes, 0, 1, 0);
  dJointSetAMotorParam(tilt, dParamFMax1, dInfinity);
  dJointSetAMotorParam(tilt, dParamFMax2, dInfinity);
}

void World::step(double dt, std::span<const ToolContact> tool_contacts) {
  dSpaceCollide(space_.get(), this, [](void* world, dGeomID first, dGeomID second) {
    static_cast<World*>(world)->collide(first, second);
  });
  for (const ToolContact& tool_contact : tool_contacts) {
    dContact contact = frictional_contact(tool_contact.friction);
    set(contact.geom.pos, tool_contact.p_W);
    set(contact.geom.normal, tool_contact.n_W);
    const double gap = tool_contact.separation + kRestingOverlap;
    contact.geom.depth = std::max(0.0, -gap);
    contact.surface.mode |= dContactMotionN;
    contact.surface.motionN = -std::max(0.0, gap) / dt;  // Least velocity along the normal.
    add_contact(contact, handle(tool_contact.tool_body), handle(tool_contact.body));
  }
  solve(dt);
  dJointGroupEmpty(contacts_.get());
}

void World::solve(double dt) {
  // The engine has one pool of jobs and one random sequence for all worlds. The solver shuffles its
  // rows with that: without a seed of its own a step would depend on the steps of other worlds.
  static std::mutex engine;
  const std::lock_guard lock(engine);
  dRandSetSeed(steps_++);
  dWorldQuickStep(world_.get(), dt);
}

void World::collide(dGeomID first, dGeomID second) {
  const dBodyID a = dGeomGetBody(first);
  const dBodyID b = dGeomGetBody(second);
  if (a == nullptr && b == nullptr) return;
  if (a != nullptr && b != nullptr && dAreConnectedExcluding(a, b, dJointTypeContact)) return;

  const auto friction = [&](const CollisionId& id) {
    return description_.bodies[static_cast<std::size_t>(id.body)]
        .collisions[static_cast<std::size_t>(id.shape)]
        .friction;
  };
  std::array<dContactGeom, kMaxPairContacts> points;
  const int count = dCollide(first, second, kMaxPairContacts, points.data(), sizeof(dContactGeom));
  for (int i = 0; i < count; ++i) {
    dContact contact =
        frictional_contact(std::min(friction(id_of(first)), friction(id_of(second))));
    contact.geom = points[static_cast<std::size_t>(i)];
    contact.geom.depth = std::max(0.0, contact.geom.depth - kRestingOverlap);
    add_contact(contact, a, b);
  }
}

void World::add_contact(dContact& contact, dBodyID first, dBodyID second) {
  const auto yields = [](dBodyID body) { return body != nullptr && !dBodyIsKinematic(body); };
  if (!yields(first) && !yields(second)) return;
  dJointAttach(dJointCreateContact(world_.get(), contacts_.get(), &contact), first, second);
}

void World::find_near(const Eigen::AlignedBox3d& box, std::vector<CollisionId>& found) {
  found.clear();
  const Vector3 center = box.center();
  const Vector3 size = box.sizes();
  dGeomBoxSetLengths(query_box_.get(), size.x(), size.y(), size.z());
  dGeomSetPosition(query_box_.get(), center.x(), center.y(), center.z());
  dSpaceCollide2(query_box_.get(), reinterpret_cast<dGeomID>(space_.get()), &found,
                 [](void* result, dGeomID first, dGeomID second) {
                   const dGeomID other = dGeomGetData(first) != nullptr ? first : second;
                   static_cast<std::vector<CollisionId>*>(result)->push_back(id_of(other));
                 });
  std::ranges::sort(found);
}

}  // namespace hlm::ve
