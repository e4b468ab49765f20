#include "hlm/ve_client/world/world.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <stdexcept>

#include "hlm/common/range.h"

namespace hlm::ve {
namespace {

/// Share of a joint's or a tool contact's error that one step corrects. Near 1, the tool jumps;
/// near 0, it sinks in.
constexpr double kErrorReduction = 0.4;
/// Softness of joints, tool contacts and friction, m/(N·s): enough to keep redundant constraints
/// solvable; 1 N then yields 1e-8 m/s.
constexpr double kConstraintForceMixing = 1e-8;
/// Speed, m/s, up to which overlap is pushed apart. Higher throws bodies that start overlapped.
constexpr double kMaxCorrectingVelocity = 1;
/// Steps of the solver per second, and its sweeps over all constraints in each, where bodies can
/// move. With half of either six stacked cubes creep by 0.7 to 1 mm in a minute instead of 0.2 mm.
constexpr double kSolverRate = 960;
constexpr int kSweeps = 40;
/// Sweeps where only the tool moves, once a frame: it has no piles to hold.
constexpr int kSweepsOfTool = 20;
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

/// What the pieces of a world are made of.
std::vector<PieceSource> sources_of(const WorldDescription& description,
                                    const std::vector<std::vector<Convex>>& shapes) {
  std::vector<PieceSource> sources;
  for (std::size_t b = 0; b < shapes.size(); ++b) {
    const BodyDescription& body = description.bodies[b];
    for (std::size_t s = 0; s < shapes[b].size(); ++s) {
      const CollisionDescription& collision = body.collisions[s];
      sources.push_back({.id = {static_cast<int>(b), static_cast<int>(s)},
                         .convex = &shapes[b][s],
                         .X_FG = body.fixed ? body.X_WB * collision.X_BG : collision.X_BG,
                         .fixed = body.fixed,
                         .friction = {collision.friction.value_or(-1)},
                         .mesh = collision.mesh.get(),
                         .triangle = collision.triangle});
    }
  }
  return sources;
}

}  // namespace

World::World(const WorldDescription& description, std::span<const int> tool_bodies)
    : description_(description),
      is_tool_(description.bodies.size()),
      tool_bodies_(tool_bodies.begin(), tool_bodies.end()) {
  initialise_engine();
  world_.reset(dWorldCreate());
  contacts_.reset(dJointGroupCreate(0));

  const Vector3& g = description_.gravity_W;
  dWorldSetGravity(world_.get(), g.x(), g.y(), g.z());
  dWorldSetERP(world_.get(), kErrorReduction);
  dWorldSetCFM(world_.get(), kConstraintForceMixing);
  dWorldSetContactMaxCorrectingVel(world_.get(), kMaxCorrectingVelocity);
  dWorldSetContactSurfaceLayer(world_.get(), 0);
  dWorldSetAutoDisableFlag(world_.get(), 0);  // Rest does it, of whole piles and repeatably.
  for (const int body : tool_bodies_) {
    is_tool_[at(body)] = true;
    description_.bodies[at(body)].fixed = false;  // The tool moves it, if only with its root.
  }
  add_bodies();
  broad_phase_.emplace(description_, bodies_, shapes_, is_tool_);
  pieces_.emplace(sources_of(description_, shapes_));
  dWorldSetQuickStepNumIterations(
      world_.get(), description_.solver.sweeps.value_or(has_movable_ ? kSweeps : kSweepsOfTool));
  joints_.emplace(world_.get(), description_, bodies_);
  require_slow_springs();
}

/// Throws where a spring would not be stable in steps of the solver.
void World::require_slow_springs() const {
  const double h = longest_step();
  for (int i = 0; i < static_cast<int>(description_.joints.size()); ++i) {
    const JointDescription& joint = description_.joints[at(i)];
    if (joint.stiffness == 0) continue;
    // A quarter of what semi-implicit Euler can take.
    const double most = 1 / (h * h * joint_mobility(i));
    const std::string name = joint.name + ": spring_stiffness";
    if (const auto error = find_error(name, joint.stiffness, {0, most})) {
      throw std::runtime_error("joint " + *error + " to be stable in steps of " + shortest_text(h) +
                               " s (physics: max_step_size)");
    }
  }
}

double World::longest_step() const noexcept {
  return description_.solver.largest_step.value_or(1 / kSolverRate);
}

void World::add_bodies() {
  std::vector<bool> movable;
  for (int i = 0; i < static_cast<int>(description_.bodies.size()); ++i) {
    const BodyDescription& body = description_.bodies[at(i)];
    bodies_.push_back(body.fixed ? nullptr : dBodyCreate(world_.get()));
    movable.push_back(is_movable(i));
    has_movable_ = has_movable_ || is_movable(i);
    if (!body.fixed) {
      set_mass(i);
      dBodySetGravityMode(handle(i), !is_tool_[at(i)] && !body.weightless);
      place(i, body.X_WB);
    }
    std::vector<Convex>& convexes = shapes_.emplace_back();
    double& radius = radii_.emplace_back(0);
    for (const CollisionDescription& shape : body.collisions) {
      const auto box = convexes.emplace_back(shape.shape).bounds(shape.X_BG);
      radius = std::max(radius, box.max().cwiseMax(-box.min()).norm());
    }
  }
  rest_.emplace(description_, movable);
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
  if (is_movable(body)) {
    for (int other = 0; other < static_cast<int>(bodies_.size()); ++other) {
      if (rests(other)) wake(other);
    }
  }
  place(body, X_WB);
}

void World::place(int body, const Pose& X_WB) {
  if (!is_tool(body)) ++changes_;
  dBodySetPosition(handle(body), X_WB.p.x(), X_WB.p.y(), X_WB.p.z());
  const Quaternion& R = X_WB.R;
  const dQuaternion q = {R.w(), R.x(), R.y(), R.z()};
  dBodySetQuaternion(handle(body), q);
}

void World::set_velocity(int body, const Twist& V) {
  disturb(body);
  dBodySetLinearVel(handle(body), V[0], V[1], V[2]);
  dBodySetAngularVel(handle(body), V[3], V[4], V[5]);
}

void World::hold(int body, const Pose& X_WB, const Twist& V_WB) {
  place(body, X_WB);
  set_velocity(body, V_WB);
  dBodySetKinematic(handle(body));
}

void World::let_go(int body) {
  const Twist V = V_WB(body);
  dBodySetDynamic(handle(body));
  set_velocity(body, V);
}

bool World::is_held(int body) const {
  return is_movable(body) && dBodyIsKinematic(handle(body)) != 0;
}

void World::add_wrench(int body, const Wrench& F) {
  if (F.isZero(0)) return;
  if (!stepping_) {
    held_.try_emplace(body, Wrench::Zero()).first->second += F;
    return;
  }
  disturb(body);
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
  const double present = inertia_factor(body);
  if (factor == present) return;
  if (factor > present) set_velocity(body, present / factor * V_WB(body));
  inertia_factors_.insert_or_assign(body, factor);
  if (factor == 1) inertia_factors_.erase(body);
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
  return std::max(1, static_cast<int>(std::ceil(dt / longest_step() - kRounding)));
}

void World::step(double dt, std::span<const ToolContact> tool_contacts, const Drive& drive) {
  const int count = substeps(dt);
  substep_ = dt / count;
  std::vector<CarriedContact> carried;
  for (const ToolContact& contact : tool_contacts) {
    carried.emplace_back(contact, X_WB(contact.tool_body), X_WB(contact.body));
  }
  memory_.begin_frame(count, [this](std::uint32_t body) {
    return is_movable(static_cast<int>(body)) && !rests(static_cast<int>(body));
  });
  stepping_ = true;
  for (int i = 0; i < count && !fault_; ++i) {
    push_held();
    joints_->push_springs();
    if (drive) drive(substep_);
    for (const CarriedContact& contact : carried) disturb(contact.body());
    collide_all();
    for (const CarriedContact& contact : carried) {
      add_contact(contact.at(X_WB(contact.tool_body()), X_WB(contact.body())));
    }
    solve(substep_);
    memory_.end_step();
    dJointGroupEmpty(contacts_.get());
    find_fault();
  }
  stepping_ = false;
  held_.clear();
  settle(dt);
}

void World::push_held() {
  for (const auto& [body, F] : held_) add_wrench(body, F);
  // The engine's weight goes with inertia.
  for (const auto& [body, factor] : inertia_factors_) {
    const BodyDescription& description = description_.bodies[at(body)];
    if (description.weightless) continue;
    Wrench surplus = Wrench::Zero();
    surplus.head<3>() = (1 - factor) * description.mass * description_.gravity_W;
    add_wrench(body, surplus);
  }
}

void World::wake(int body) {
  rest_->wake(body);
  broad_phase_->set_still(body, false);
  dBodyEnable(handle(body));
}

void World::disturb(int body) {
  if (!is_movable(body)) return;
  if (rests(body)) wake(body);
  rest_->push(body);
}

void World::settle(double dt) {
  const auto fastest = [this](int body) {
    const Twist V = V_WB(body);
    return V.head<3>().norm() + radii_[at(body)] * V.tail<3>().norm();
  };
  for (const int body : rest_->settle(dt, fastest)) stop(body);
}

void World::stop(int body) {
  dBodySetLinearVel(handle(body), 0, 0, 0);
  dBodySetAngularVel(handle(body), 0, 0, 0);
  dBodyDisable(handle(body));
  broad_phase_->set_still(body, true);
}

void World::solve(double h) {
  // The engine has one pool of jobs and one random sequence for all worlds. The solver shuffles its
  // rows with that: without a seed of its own a step would depend on the steps of other worlds.
  static std::mutex engine;
  const std::lock_guard lock(engine);
  dRandSetSeed(steps_++);
  ++changes_;
  dWorldQuickStep(world_.get(), h);
}

void World::find_fault() {
  const auto fail = [&](int body, const std::string& what) {
    fault_ = "body '" + description_.bodies[at(body)].name + "' " + what;
  };
  const auto finite = [&](int body) {
    const Pose X_WB = this->X_WB(body);
    return X_WB.p.allFinite() && X_WB.R.coeffs().allFinite() && V_WB(body).allFinite();
  };
  std::vector<int> gone;
  for (const int body : rest_->awake()) {
    const double speed = V_WB(body).head<3>().norm();
    const double rate = V_WB(body).tail<3>().norm();
    if (!finite(body)) {
      fail(body, "has no finite position and velocity");
    } else if (speed > kPlausibleSpeed) {
      fail(body, "moves at " + shortest_text(speed) + " m/s");
    } else if (rate > kPlausibleRate) {
      fail(body, "turns at " + shortest_text(rate) + " rad/s");
    } else if (X_WB(body).p.norm() > kWorldRadius) {
      gone.push_back(body);
    }
  }
  for (const int body : tool_bodies_) {  // It goes where the proxy is, however fast.
    if (!finite(body)) fail(body, "has no finite position and velocity");
  }
  for (const int body : gone) {
    rest_->put_to_rest(body);
    stop(body);
  }
}

bool World::can_touch(int first, int second) const {
  const dBodyID a = handle(first);
  const dBodyID b = handle(second);
  if (a == b) return false;  // One body, or both fixed.
  return a == nullptr || b == nullptr || !dAreConnectedExcluding(a, b, dJointTypeContact);
}

}  // namespace hlm::ve
