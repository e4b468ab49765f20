#include "ve_client/world/world.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <stdexcept>

#include "common/range.h"
#include "ve_client/world/engine_geometry.h"
#include "ve_client/world/mobility.h"

namespace hlm::ve {
namespace {

/// Share of a joint's or a tool contact's error that one step corrects. Near 1, the tool jumps;
/// near 0, it sinks in.
constexpr double kErrorReduction = 0.4;
/// Softness of joints, tool contacts and friction, m/(N·s): enough to keep redundant constraints
/// solvable; 1 N then yields 1e-8 m/s.
constexpr double kConstraintForceMixing = 1e-8;
/// Stiffness (N/m) and damping (N·s/m) of a contact between bodies. The solver goes through few
/// sweeps: rigid contacts would leave a pile unsolved after each, so that it creeps and falls. A
/// corner of a 0.3 kg cube yields 4 µm.
constexpr double kContactStiffness = 2e5;
constexpr double kContactDamping = 100;
/// Speed, m/s, up to which overlap is pushed apart. Higher throws bodies that start overlapped.
constexpr double kMaxCorrectingVelocity = 1;
/// Overlap, m, that bodies keep when they rest on each other. With none, a resting body is in
/// contact in some steps and not in others: friction slips, and the tool's active contacts (σ <= 0)
/// flicker. With more than a tenth of a millimetre it can be seen.
constexpr double kRestingOverlap = 2e-5;
/// Steps of the solver per second, and its sweeps over all constraints in each, where bodies can
/// move. With half of either six stacked cubes creep by 0.7 to 1 mm in a minute instead of 0.2 mm.
constexpr double kSolverRate = 960;
constexpr int kSweeps = 40;
/// Sweeps where only the tool moves, once a frame: it has no piles to hold.
constexpr int kSweepsOfTool = 20;
/// Friction acts against the slip from this speed on, m/s; below, as it did in the step before.
/// Lower takes the solver's noise for slip.
constexpr double kSlipSpeed = 1e-3;
/// Least share of the bound that friction has across the direction in which it acts. With none it
/// could not turn; more lets it exceed its bound, 0.1 by half a per cent.
constexpr double kLeastShare = 0.1;
/// No body is faster, m/s and rad/s, unless the simulation went wrong.
constexpr double kPlausibleSpeed = 100;
constexpr double kPlausibleRate = 1000;
/// A body farther from the origin than this, m, has left the world: it is left there at rest.
constexpr double kWorldRadius = 100;

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

const CollisionId& id_of(dGeomID geometry) {
  return *static_cast<const CollisionId*>(dGeomGetData(geometry));
}

dGeomID as_geometry(dSpaceID space) { return reinterpret_cast<dGeomID>(space); }

dContact frictional_contact(double friction, const Vector3& p_W, const Vector3& n_W) {
  dContact contact{};
  contact.surface.mode = dContactApprox1;
  contact.surface.mu = friction;
  set(contact.geom.pos, p_W);
  set(contact.geom.normal, n_W);
  return contact;
}

}  // namespace

World::World(const WorldDescription& description, std::span<const int> tool_bodies)
    : description_(description),
      is_tool_(description.bodies.size()),
      inertia_factors_(description.bodies.size(), 1),
      held_(description.bodies.size(), Wrench::Zero()) {
  initialise_engine();
  world_.reset(dWorldCreate());
  space_.reset(dSweepAndPruneSpaceCreate(nullptr, dSAP_AXES_XYZ));
  contacts_.reset(dJointGroupCreate(0));
  query_box_.reset(dCreateBox(nullptr, 1, 1, 1));

  const Vector3& g = description_.gravity_W;
  dWorldSetGravity(world_.get(), g.x(), g.y(), g.z());
  dWorldSetERP(world_.get(), kErrorReduction);
  dWorldSetCFM(world_.get(), kConstraintForceMixing);
  dWorldSetContactMaxCorrectingVel(world_.get(), kMaxCorrectingVelocity);
  dWorldSetContactSurfaceLayer(world_.get(), 0);
  dWorldSetAutoDisableFlag(world_.get(), 0);
  for (const int body : tool_bodies) is_tool_[at(body)] = true;
  skins_.reset(create_mesh_space(description_));
  add_bodies();
  pieces_.emplace(description_, shapes_);
  dWorldSetQuickStepNumIterations(
      world_.get(), description_.solver.sweeps.value_or(has_movable_ ? kSweeps : kSweepsOfTool));
  joints_.emplace(world_.get(), description_, bodies_);
  require_slow_springs();
}

/// Throws where a spring or damping would not be stable in steps of the solver.
void World::require_slow_springs() const {
  const double h = description_.solver.largest_step.value_or(1 / kSolverRate);
  for (int i = 0; i < static_cast<int>(description_.joints.size()); ++i) {
    const JointDescription& joint = description_.joints[at(i)];
    if (!joint.sprung()) continue;
    // Half of what semi-implicit Euler bears alone, so that both together are stable.
    const double mobility = joint_mobility(*this, i);
    const auto require = [&](const char* what, double value, double factor) {
      const double most = 1 / (factor * mobility);
      if (const auto error = find_error(joint.name + ": " + what, value, {0, most})) {
        throw std::runtime_error("joint " + *error + " to be stable in steps of " +
                                 shortest_text(h) + " s (physics: max_step_size)");
      }
    };
    require("spring_stiffness", joint.stiffness, h * h);
    require("damping", joint.damping, h);
  }
}

void World::add_bodies() {
  std::size_t shapes = 0;
  for (const BodyDescription& body : description_.bodies) shapes += body.collisions.size();
  collision_ids_.reserve(shapes);  // Geometries keep pointers into it.

  for (int i = 0; i < static_cast<int>(description_.bodies.size()); ++i) {
    const BodyDescription& body = description_.bodies[at(i)];
    const bool is_tool = is_tool_[at(i)];
    bodies_.push_back(body.fixed ? nullptr : dBodyCreate(world_.get()));
    has_movable_ = has_movable_ || is_movable(i);
    if (!body.fixed) {
      set_mass(i);
      dBodySetGravityMode(handle(i), !is_tool && !body.weightless);
      set_pose(i, body.X_WB);
    }
    std::vector<Convex>& convexes = shapes_.emplace_back();
    for (const CollisionDescription& shape : body.collisions) convexes.emplace_back(shape.shape);
    if (!is_tool) add_geometries(i);
  }
}

void World::add_geometries(int index) {
  const BodyDescription& body = description_.bodies[at(index)];
  for (std::size_t i = 0; i < body.collisions.size(); ++i) {
    const CollisionDescription& collision = body.collisions[i];
    const dGeomID geometry =
        create_geometry(collision.mesh ? skins_.get() : space_.get(), collision.shape,
                        body.X_WB * collision.X_BG, handle(index), collision.X_BG);
    collision_ids_.push_back({index, static_cast<int>(i)});
    dGeomSetData(geometry, &collision_ids_.back());
  }
}

Pose World::X_WB(int body) const {
  const dBodyID b = handle(body);
  if (b == nullptr) return description_.bodies[at(body)].X_WB;
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
  const Quaternion& R = X_WB.R;
  const dQuaternion q = {R.w(), R.x(), R.y(), R.z()};
  dBodySetQuaternion(handle(body), q);
}

void World::set_velocity(int body, const Twist& V) {
  dBodySetLinearVel(handle(body), V[0], V[1], V[2]);
  dBodySetAngularVel(handle(body), V[3], V[4], V[5]);
}

void World::add_wrench(int body, const Wrench& F) {
  if (!stepping_) {
    held_[at(body)] += F;
    return;
  }
  dBodyAddForce(handle(body), F[0], F[1], F[2]);
  dBodyAddTorque(handle(body), F[3], F[4], F[5]);
}

void World::set_mass(int index) {
  const BodyDescription& body = description_.bodies[at(index)];
  const double factor = inertia_factor(index);
  const Matrix3 I = factor * body.I_B;
  dMass mass;
  dMassSetParameters(&mass, factor * body.mass, 0, 0, 0, I(0, 0), I(1, 1), I(2, 2), I(0, 1),
                     I(0, 2), I(1, 2));
  dBodySetMass(handle(index), &mass);
}

void World::set_inertia_factor(int body, double factor) {
  double& present = inertia_factors_[at(body)];
  if (factor == present) return;
  if (factor > present) set_velocity(body, present / factor * V_WB(body));
  present = factor;
  set_mass(body);
}

void World::make_kinematic(int body) {
  const dBodyID b = handle(body);
  joints_->remove_from(b);
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

int World::substeps(double dt) const noexcept {
  if (!description_.solver.largest_step && !has_movable_) return 1;
  // A frame that is a whole number of steps long, up to rounding, gets no further one.
  constexpr double kRounding = 1e-9;
  const double largest = description_.solver.largest_step.value_or(1 / kSolverRate);
  return std::max(1, static_cast<int>(std::ceil(dt / largest - kRounding)));
}

void World::step(double dt, std::span<const ToolContact> tool_contacts, const Drive& drive) {
  const int count = substeps(dt);
  substep_ = dt / count;
  std::vector<CarriedContact> carried;
  for (const ToolContact& contact : tool_contacts) {
    carried.emplace_back(contact, X_WB(contact.tool_body), X_WB(contact.body));
  }
  memory_.begin_frame(count);
  stepping_ = true;
  for (int i = 0; i < count && !fault_; ++i) {
    push_held();
    joints_->push_springs();
    if (drive) drive(substep_);
    dNearCallback* const meet = [](void* world, dGeomID first, dGeomID second) {
      static_cast<World*>(world)->collide(id_of(first), id_of(second));
    };
    dSpaceCollide(space_.get(), this, meet);
    if (skins_) dSpaceCollide2(as_geometry(space_.get()), as_geometry(skins_.get()), this, meet);
    for (const CarriedContact& contact : carried) {
      add_contact(contact.at(X_WB(contact.tool_body()), X_WB(contact.body())));
    }
    solve(substep_);
    memory_.end_step();
    dJointGroupEmpty(contacts_.get());
    find_fault();
  }
  stepping_ = false;
  std::ranges::fill(held_, Wrench::Zero());
}

void World::push_held() {
  for (int body = 0; body < static_cast<int>(held_.size()); ++body) {
    if (!held_[at(body)].isZero(0)) add_wrench(body, held_[at(body)]);
    // The engine's weight goes with inertia.
    const double surplus = inertia_factors_[at(body)] - 1;
    const BodyDescription& description = description_.bodies[at(body)];
    if (surplus == 0 || description.weightless) continue;
    const Vector3 weight = description.mass * description_.gravity_W;
    add_wrench(body, (Wrench() << -surplus * weight, Vector3::Zero()).finished());
  }
}

void World::solve(double h) {
  // The engine has one pool of jobs and one random sequence for all worlds. The solver shuffles its
  // rows with that: without a seed of its own a step would depend on the steps of other worlds.
  static std::mutex engine;
  const std::lock_guard lock(engine);
  dRandSetSeed(steps_++);
  dWorldQuickStep(world_.get(), h);
}

void World::find_fault() {
  const auto fail = [&](int body, const std::string& what) {
    fault_ = "body '" + description_.bodies[at(body)].name + "' " + what;
  };
  for (int body = 0; body < static_cast<int>(bodies_.size()); ++body) {
    if (handle(body) == nullptr) continue;
    const Pose X_WB = this->X_WB(body);
    const Twist V_WB = this->V_WB(body);
    const double speed = V_WB.head<3>().norm();
    const double rate = V_WB.tail<3>().norm();
    if (!X_WB.p.allFinite() || !X_WB.R.coeffs().allFinite() || !V_WB.allFinite()) {
      fail(body, "has no finite position and velocity");
    } else if (is_tool_[at(body)]) {
      continue;  // It goes where the proxy is.
    } else if (speed > kPlausibleSpeed) {
      fail(body, "moves at " + shortest_text(speed) + " m/s");
    } else if (rate > kPlausibleRate) {
      fail(body, "turns at " + shortest_text(rate) + " rad/s");
    } else if (X_WB.p.norm() > kWorldRadius) {
      set_velocity(body, Twist::Zero());
      dBodyDisable(handle(body));
    }
  }
}

bool World::can_touch(int first, int second) const {
  const dBodyID a = handle(first);
  const dBodyID b = handle(second);
  if (a == b) return false;  // One body, or both fixed.
  return a == nullptr || b == nullptr || !dAreConnectedExcluding(a, b, dJointTypeContact);
}

void World::collide(CollisionId first, CollisionId second) {
  if (!can_touch(first.body, second.body)) return;
  // Whom the normal points to can move.
  if (handle(first.body) == nullptr) std::swap(first, second);
  const double friction =
      friction_between(collision(first), collision(second)).value_or(kDefaultFriction);
  const PairSide a{pieces_->of(first), X_WG(first)};
  const PairSide b{pieces_->of(second), X_WG(second)};
  const auto side = [](const CollisionId& id) {
    return ContactSide{SideKind::kMovableBody, static_cast<std::uint32_t>(id.body)};
  };
  touching_.clear();
  for (const ManifoldPoint& point :
       find_contacts(convex(first), a.X_WG, convex(second), b.X_WG, 0, statistics_)) {
    touching_.push_back(found_contact(point, side(first), first, side(second), second));
    touching_.back().friction = friction;
  }
  resolve_seams(*pieces_, a, b, touching_, 0);
  for (const FoundContact& contact : touching_) add_contact(contact);
}

void World::add_contact(const FoundContact& found) {
  const int first = static_cast<int>(found.key.a.index);
  const int second = static_cast<int>(found.key.b.index);
  dContact contact = frictional_contact(found.friction, found.p_WC, found.n_W);
  contact.geom.depth = std::max(0.0, -found.separation - kRestingOverlap);
  const double spring = substep_ * kContactStiffness;
  contact.surface.mode |= dContactSoftERP | dContactSoftCFM;
  contact.surface.soft_erp = spring / (spring + kContactDamping);
  contact.surface.soft_cfm = 1 / (spring + kContactDamping);

  bound_friction(contact, found);
  const dJointID joint = dJointCreateContact(world_.get(), contacts_.get(), &contact);
  dJointAttach(joint, handle(first), handle(second));
  dJointSetFeedback(joint, &memory_.add(found.key, found.n_W));
}

/// The engine bounds friction along two directions, each by μ f_n: together by up to √2 of that.
/// So the first is that in which it acts, and the second gets what that leaves.
void World::bound_friction(dContact& contact, const FoundContact& found) const {
  const ContactKey& key = found.key;
  const Vector3& n = found.n_W;
  const auto across = [&](const Vector3& v) { return Vector3(v - v.dot(n) * n); };
  const Vector3 slip = across(velocity_at(static_cast<int>(key.a.index), found.p_WC) -
                              velocity_at(static_cast<int>(key.b.index), found.p_WC));
  const ContactMemory::Carried latest = memory_.latest(key);
  const double bound = contact.surface.mu * latest.normal;
  const bool slips = slip.norm() > kSlipSpeed;
  const Vector3 direction = slips ? slip : across(latest.friction);
  if (direction.isZero(0) || !(bound > 0)) return;
  const double used = slips ? 1 : std::min(1.0, latest.friction.norm() / bound);
  contact.surface.mode |= dContactFDir1 | dContactMu2;
  set(contact.fdir1, direction.normalized());
  contact.surface.mu2 = contact.surface.mu * std::max(kLeastShare, std::sqrt(1 - used * used));
}

void World::add_contact(const ToolContact& tool_contact) {
  const dBodyID first = handle(tool_contact.tool_body);
  const dBodyID second = handle(tool_contact.body);
  const auto yields = [](dBodyID body) { return body != nullptr && !dBodyIsKinematic(body); };
  if (!yields(first) && !yields(second)) return;
  dContact contact = frictional_contact(tool_contact.friction, tool_contact.p_W, tool_contact.n_W);
  const double gap = tool_contact.separation + kRestingOverlap;
  contact.geom.depth = std::max(0.0, -gap);
  contact.surface.mode |= dContactMotionN;
  contact.surface.motionN = -std::max(0.0, gap) / substep_;  // Least velocity along the normal.
  dJointAttach(dJointCreateContact(world_.get(), contacts_.get(), &contact), first, second);
}

void World::find_near(const Eigen::AlignedBox3d& box, std::vector<CollisionId>& found) {
  found.clear();
  const Vector3 center = box.center();
  const Vector3 size = box.sizes();
  dGeomBoxSetLengths(query_box_.get(), size.x(), size.y(), size.z());
  dGeomSetPosition(query_box_.get(), center.x(), center.y(), center.z());
  dNearCallback* const add = [](void* result, dGeomID first, dGeomID second) {
    const dGeomID other = dGeomGetData(first) != nullptr ? first : second;
    static_cast<std::vector<CollisionId>*>(result)->push_back(id_of(other));
  };
  dSpaceCollide2(query_box_.get(), as_geometry(space_.get()), &found, add);
  if (skins_) dSpaceCollide2(query_box_.get(), as_geometry(skins_.get()), &found, add);
  std::ranges::sort(found);
}

}  // namespace hlm::ve
