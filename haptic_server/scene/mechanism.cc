#include "hlm/haptic_server/scene/mechanism.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>
#include <string>

#include <Eigen/Cholesky>

namespace hlm::server {
namespace {

/// Stiffness and damping of what sticks or stops, as shares of the coordinate's inertia and step:
/// critical. Softer, it is felt to give way; stiffer, it rings.
constexpr double kGrip = 1;
constexpr double kGripDamping = 2;
/// Speed at which no joint moves, m/s or rad/s.
constexpr double kLargestSpeed = 1000;
/// A joint is at its stop where it is no farther away, m or rad.
constexpr double kAtStop = 1e-6;

}  // namespace

ToolDescription Mechanism::tree_of(std::span<const Member> members) {
  ToolDescription tree;
  for (const auto& [inertia, joint] : members) {
    const std::string name = "body " + std::to_string(inertia.body);
    if (tree.links.size() == tree.links.capacity()) {
      throw std::invalid_argument(name + " is one of more than " + std::to_string(kMaxLinks) +
                                  " that joints connect");
    }
    Link& link = tree.links.emplace_back();
    const auto parent = std::ranges::find(members, joint.parent,
                                          [](const Member& member) { return member.inertia.body; });
    const bool is_root = joint.parent == kNoBody;
    const Pose X_LB = joint.X_BJ.inverse();
    link.parent = is_root ? -1 : static_cast<int>(parent - members.begin());
    link.joint = joint.type;
    link.X_PJ = is_root ? joint.X_PJ : parent->joint.X_BJ.inverse() * joint.X_PJ;
    link.axis = joint.axis;
    link.mass = inertia.mass;
    link.p_LCom = X_LB * inertia.p_BCom;
    const Matrix3 R = X_LB.R.toRotationMatrix();
    link.I_LCom = R * inertia.I_BCom * R.transpose();
    link.I_LCom = (link.I_LCom + link.I_LCom.transpose()).eval() / 2;
  }
  if (const auto error = find_error(tree)) {
    throw std::invalid_argument("bodies that joints connect: " + std::string(error->view()));
  }
  return tree;
}

Mechanism::Mechanism(std::span<const Member> members)
    : model_(tree_of(members)), extra_(model_.configuration_size() - model_.dof()) {
  for (const auto& [inertia, joint] : members) {
    const bool is_free = joint.type == JointType::kFree;
    parts_.push_back({.body = inertia.body,
                      .joint = joint,
                      .coordinate = is_free ? -1 : static_cast<int>(forces_.size()),
                      .X_LB = joint.X_BJ.inverse(),
                      .gravity_W = inertia.gravity_W});
    for (int i = 0; i < joint_dof(joint.type); ++i) {
      forces_.push_back({.part = parts_.size() - 1, .lower = joint.lower, .upper = joint.upper});
    }
  }
  if (const auto error = find_singular_error(model_)) {
    throw std::invalid_argument("bodies that joints connect: " + std::string(error->view()));
  }
  v_ = a_ = Velocity::Zero(dof());
  T_.setZero(dof(), dof());
}

bool Mechanism::is_built_as(const Mechanism& other) const noexcept {
  return std::ranges::equal(parts_, other.parts_, [](const Part& a, const Part& b) {
    return a.body == b.body && a.joint == b.joint;
  });
}

void Mechanism::set_state(std::span<const BodyPose> poses, double pace) noexcept {
  pace_ = pace;
  Configuration q = model_.neutral();
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Part& part = parts_[i];
    if (part.coordinate < 0) {
      const BodyPose& root = poses[i];
      q.head<7>() << root.X_WB.p, root.X_WB.R.w(), root.X_WB.R.vec();
      v_.head<6>() = root.V_W;
      continue;
    }
    const int parent = model_.description().links[i].parent;
    const BodyPose of_world;
    const auto [at, speed] = joint_state(
        part.joint, parent < 0 ? of_world : poses[static_cast<std::size_t>(parent)], poses[i]);
    q[part.coordinate + extra_] = at;
    v_[part.coordinate] = speed;
    Force& force = forces_[static_cast<std::size_t>(part.coordinate)];
    // Beyond a limit that is it: nothing is thrown back.
    force.lower = std::min(force.lower, at);
    force.upper = std::max(force.upper, at);
    force.at_stop = at <= force.lower + kAtStop ? 1 : at >= force.upper - kAtStop ? -1 : 0;
  }
  model_.set_configuration(q);
}

void Mechanism::begin_step(double dt, double pace) noexcept {
  dt_ = dt;
  if (pace != pace_) v_ *= pace_ > 0 ? pace / pace_ : 0;  // What stood still begins anew.
  pace_ = pace;
  MassMatrix E = model_.mass_matrix();
  GeneralisedForce weight = GeneralisedForce::Zero(dof());
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Link& link = model_.description().links[i];
    const auto number = static_cast<int>(i);
    const PointJacobian J = model_.point_jacobian(number, model_.X_WL(number) * link.p_LCom);
    weight += link.mass * J.transpose().lazyProduct(parts_[i].gravity_W);
  }
  GeneralisedForce r = -model_.bias_force(v_);
  for (int i = 0; i < dof(); ++i) {
    Force& force = forces_[static_cast<std::size_t>(i)];
    const BodyJoint& joint = joint_of(force);
    E(i, i) += joint.armature;
    force.inertia = E(i, i);
    force.grip = kGrip * E(i, i) / (dt * dt);
    force.grip_damping = kGripDamping * E(i, i) / dt;
    decide(force, v_[i]);
    double stiffness = joint.stiffness;
    double damping = joint.damping;
    double f = weight[i];
    if (joint.stiffness > 0) f -= joint.stiffness * (q(i) - joint.reference);
    const auto grip = [&](double strain) {
      f -= force.grip * strain;
      stiffness += force.grip;
      damping += force.grip_damping;
    };
    if (force.slips != 0) {
      f -= joint.friction * force.slips;
    } else if (joint.friction > 0) {
      grip(force.strain);
    }
    if (force.at_stop != 0) grip(q(i) - force.bound());
    const double resistance = pace * damping + pace * pace * dt * stiffness;
    E(i, i) += dt * resistance;
    r[i] += pace * pace * f - resistance * v_[i];
  }
  const Eigen::LLT<MassMatrix> L(E);
  a_ = L.solve(r);
  T_.setIdentity(dof(), dof());
  L.matrixU().solveInPlace(T_);
  T_ *= pace;
}

Pose Mechanism::X_WB(std::size_t i) const noexcept {
  return model_.X_WL(static_cast<int>(i)) * parts_[i].X_LB;
}

Twist Mechanism::velocity(std::size_t i, const Vector3& p_W) const noexcept {
  return model_.jacobian(static_cast<int>(i), p_W).lazyProduct(v_);
}

Twist Mechanism::acceleration(std::size_t i, const Vector3& p_W) const noexcept {
  return model_.jacobian(static_cast<int>(i), p_W).lazyProduct(a_);
}

Jacobian Mechanism::mobility(std::size_t i, const Vector3& p_W) const noexcept {
  return model_.jacobian(static_cast<int>(i), p_W).lazyProduct(T_);
}

void Mechanism::push(const Velocity& y) noexcept { v_ += T_.lazyProduct(y); }

double Mechanism::held_by(const Force& force, double strain, double v) const noexcept {
  const double own = pace_ > 0 ? v / pace_ : 0;
  return -force.grip * (strain + dt_ * v) - force.grip_damping * own;
}

/// Whether dry friction sticks in a step that begins with v: it does not carry more than it can,
/// nor turn the motion round.
void Mechanism::decide(Force& force, double v) const noexcept {
  const double most = joint_of(force).friction;
  if (most == 0) return;
  if (force.slips == 0) {
    if (std::abs(held_by(force, force.strain, v)) > most) force.slips = v > 0 ? 1 : -1;
    return;
  }
  const bool stops = force.slips * v * force.inertia <= dt_ * most;
  if (!stops || std::abs(force.against) >= most) return;
  force.slips = 0;
  force.strain = force.against / force.grip;
}

void Mechanism::settle(Force& force, double q, double v_before, double v) const noexcept {
  const double most = joint_of(force).friction;
  if (most > 0) {
    const double friction =
        force.slips != 0 ? -most * force.slips : held_by(force, force.strain, v);
    force.against = force.inertia * (v - v_before) / dt_ - friction;
    if (force.slips != 0) {
      if (force.slips * v < 0) force.slips = -force.slips;
    } else if (std::abs(friction) > most) {
      force.slips = friction < 0 ? 1 : -1;
    } else {
      force.strain += dt_ * v;
    }
  }
  if (force.at_stop != 0) {
    if (force.at_stop * held_by(force, q - force.bound(), v) <= 0) force.at_stop = 0;
  } else if (q + 2 * dt_ * v < force.lower) {
    force.at_stop = 1;
  } else if (q + 2 * dt_ * v > force.upper) {
    force.at_stop = -1;
  }
}

void Mechanism::advance(const Velocity& y) noexcept {
  const Velocity before = v_;
  v_ += dt_ * a_ + T_.lazyProduct(y);
  // What is faster is the product of numbers without sense.
  if (!(v_.cwiseAbs().maxCoeff() <= kLargestSpeed)) v_.setZero();
  for (int i = 0; i < dof(); ++i) {
    settle(forces_[static_cast<std::size_t>(i)], q(i), before[i], v_[i]);
  }
  model_.set_configuration(model_.integrate(model_.configuration(), v_, dt_));
}

std::vector<Mechanism> mechanisms_of(std::vector<BodyInertia>& inertias,
                                     std::span<const BodyJoint> joints) {
  std::map<std::uint32_t, const BodyInertia*> known;
  for (const BodyInertia& inertia : inertias) known[inertia.body] = &inertia;
  std::map<std::uint32_t, const BodyJoint*> hangs;
  std::map<std::uint32_t, std::vector<std::uint32_t>> carries;
  const auto require_known = [&](const BodyJoint& joint, std::uint32_t body) {
    if (known.contains(body)) return;
    throw std::invalid_argument("joint of body " + std::to_string(joint.body) + ": body " +
                                std::to_string(body) + " must have an inertia");
  };
  for (const BodyJoint& joint : joints) {
    require_known(joint, joint.body);
    if (joint.parent != kNoBody) require_known(joint, joint.parent);
    hangs[joint.body] = &joint;
    if (joint.parent != kNoBody) carries[joint.parent].push_back(joint.body);
  }
  std::vector<Mechanism> found;
  std::set<std::uint32_t> walls;
  std::size_t in_trees = 0;
  for (const auto& [root, inertia] : known) {
    const auto joint = hangs.find(root);
    const bool is_root = joint == hangs.end() || joint->second->parent == kNoBody;
    if (!is_root || (joint == hangs.end() && !carries.contains(root))) continue;
    std::vector<std::uint32_t> bodies{root};
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const auto children = carries.find(bodies[i]);
      if (children == carries.end()) continue;
      bodies.insert(bodies.end(), children->second.begin(), children->second.end());
    }
    std::vector<Mechanism::Member> members;
    for (const std::uint32_t body : bodies) {
      const auto own = hangs.find(body);
      members.push_back({*known.at(body), own != hangs.end()
                                              ? *own->second
                                              : BodyJoint{.body = body, .type = JointType::kFree}});
      in_trees += own != hangs.end() ? 1 : 0;
    }
    try {
      found.emplace_back(members);
    } catch (const std::invalid_argument&) {
      walls.insert(bodies.begin(), bodies.end());
    }
  }
  if (in_trees < hangs.size()) {
    throw std::invalid_argument("joints of bodies must not make a loop");
  }
  std::erase_if(inertias, [&](const BodyInertia& one) { return walls.contains(one.body); });
  return found;
}

}  // namespace hlm::server
