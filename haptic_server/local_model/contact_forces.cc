#include "haptic_server/local_model/contact_forces.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace hlm::server {
namespace {

/// Rounds of the contact solver. Two are typical; what is undecided after the last is clamped.
constexpr int kMaxPasses = 4;

constexpr std::size_t at(int link) noexcept { return static_cast<std::size_t>(link); }

Vector3 tangential(const Vector3& v, const Vector3& n) noexcept { return v - n.dot(v) * n; }

Vector3 point_velocity(const Twist& twist, const Vector3& arm) noexcept {
  return twist.head<3>() + Vector3(twist.tail<3>()).cross(arm);
}

/// Velocity of the proxy's contact point against the constraint, along n and across it.
struct RelativeVelocity {
  double normal;       ///< v_n, m/s.
  Vector3 tangential;  ///< m/s.
};
RelativeVelocity relative_velocity(const LocalContact& contact, const Twist& twist,
                                   const Vector3& arm) noexcept {
  const Vector3 v = point_velocity(twist, arm) - contact.v_WC;
  return {contact.n_W.dot(v), tangential(v, contact.n_W)};
}

/// -k s - b v_n: the normal force before it is clamped, N.
double penalty(const LocalContact& contact, double v_n, const ContactLaw& law) noexcept {
  const double moved = law.step == ContactStep::kImplicit ? law.dt * v_n : 0;
  return -law.stiffness * (contact.s + moved) - law.damping * v_n;
}

/// μ_s, μ_k: the materials' own where the environment gives it.
double static_friction(const LocalContact& contact, const ContactLaw& law) noexcept {
  return contact.friction >= 0 ? contact.friction : law.static_friction;
}
double kinetic_friction(const LocalContact& contact, const ContactLaw& law) noexcept {
  return contact.friction >= 0 ? contact.friction : law.kinetic_friction;
}

/// f*: what the tangential spring and damper ask for, N, on the tool.
Vector3 elastic_friction(const LocalContact& contact, const Vector3& v_t,
                         const ContactLaw& law) noexcept {
  return -law.stiffness * (contact.z_W + law.dt * v_t) - law.damping * v_t;
}

/// How a contact takes part in one round of the solver.
enum class Mode : std::uint8_t { kOff, kStick, kSlip };

struct Trial {
  Mode mode = Mode::kOff;
  Vector3 slip_force = Vector3::Zero();  ///< N, in mode kSlip.
  Vector3 arm = Vector3::Zero();
};
using Trials = StaticVector<Trial, kMaxLocalContacts>;

Trials first_trials(const LocalContacts& contacts, const LinkMotion& links,
                    const ContactLaw& law) noexcept {
  Trials trials;
  for (const LocalContact& contact : contacts) {
    Trial& trial = trials.emplace_back();
    if (contact.s > 0) continue;
    trial.arm = links.arm(contact);
    trial.mode =
        contact.slipping || static_friction(contact, law) == 0 ? Mode::kSlip : Mode::kStick;
    if (contact.slipping) trial.slip_force = tangential(contact.f_W, contact.n_W);
  }
  return trials;
}

/// Generalised impedance and force of the contacts in one round.
struct System {
  MassMatrix A;
  GeneralisedForce r;
};

/// Adds the contact's force, f = f_0 - Z v_point, to its link's 6×6 impedance and wrench.
void add_contact(const LocalContact& contact, const Trial& trial, const ContactLaw& law,
                 Matrix6& impedance, Wrench& wrench) noexcept {
  const double beta = law.damping + law.stiffness * law.dt;
  const Vector3& n = contact.n_W;
  Vector3 f_0 = (-law.stiffness * contact.s + beta * contact.v_constr) * n;
  Vector6 row;
  row << n, trial.arm.cross(n);
  if (trial.mode == Mode::kStick) {
    // Z = β I: the normal and both tangential directions share one impedance.
    f_0 += -law.stiffness * contact.z_W + beta * tangential(contact.v_WC, n);
    const Matrix3 arm = beta * skew(trial.arm);
    impedance.topLeftCorner<3, 3>().diagonal().array() += beta;
    impedance.topRightCorner<3, 3>() -= arm;
    impedance.bottomLeftCorner<3, 3>() += arm;
    impedance.bottomRightCorner<3, 3>().noalias() -= arm * skew(trial.arm);
  } else {
    f_0 += trial.slip_force;
    impedance.noalias() += (beta * row) * row.transpose();
  }
  wrench.head<3>() += f_0;
  wrench.tail<3>() += trial.arm.cross(f_0);
}

System assemble(const LocalContacts& contacts, const Trials& trials, const LinkMotion& links,
                const MassMatrix& E, const GeneralisedForce& r, const ContactLaw& law) noexcept {
  StaticVector<Matrix6, kMaxLinks> impedance(static_cast<std::size_t>(links.count()),
                                             Matrix6::Zero());
  StaticVector<Wrench, kMaxLinks> wrench(static_cast<std::size_t>(links.count()), Wrench::Zero());
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (trials[i].mode == Mode::kOff) continue;
    const auto link = at(contacts[i].link());
    add_contact(contacts[i], trials[i], law, impedance[link], wrench[link]);
  }
  System system{E, r};
  for (int i = 0; i < links.count(); ++i) {
    const Jacobian& J = links.jacobian(i);
    const Jacobian ZJ = impedance[at(i)].lazyProduct(J);
    system.A += law.dt * J.transpose().lazyProduct(ZJ);
    system.r += law.dt * J.transpose().lazyProduct(wrench[at(i)]);
  }
  return system;
}

/// Decides each contact's mode anew for the velocity that a round gave. True if any changed.
bool revise(const LocalContacts& contacts, const LinkTwists& twists, const ContactLaw& law,
            Trials& trials) noexcept {
  bool changed = false;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const LocalContact& contact = contacts[i];
    Trial& trial = trials[i];
    if (contact.s > 0) continue;
    const RelativeVelocity v = relative_velocity(contact, twists[at(contact.link())], trial.arm);
    const double f_n = penalty(contact, v.normal, law);
    Mode mode = Mode::kOff;
    if (f_n > 0) {
      const Vector3 f = elastic_friction(contact, v.tangential, law);
      const double size = f.norm();
      const bool slipped = trial.mode == Mode::kSlip;
      const double mu = slipped ? kinetic_friction(contact, law) : static_friction(contact, law);
      mode = size > mu * f_n ? Mode::kSlip : Mode::kStick;
      if (mode == Mode::kSlip && size > 0) {
        trial.slip_force = (kinetic_friction(contact, law) * f_n / size) * f;
      }
    }
    changed |= mode != trial.mode;
    trial.mode = mode;
  }
  return changed;
}

}  // namespace

LinkMotion::LinkMotion(const ToolModel& proxy) noexcept {
  for (int i = 0; i < proxy.links(); ++i) {
    X_WL_.push_back(proxy.X_WL(i));
    J_.push_back(proxy.jacobian(i, proxy.X_WL(i).p));
  }
}

LinkTwists link_twists(const LinkMotion& links, const Velocity& v) noexcept {
  LinkTwists twists;
  for (int i = 0; i < links.count(); ++i) twists.push_back(links.jacobian(i).lazyProduct(v));
  return twists;
}

void evaluate_contacts(LocalContacts& contacts, const LinkMotion& links,
                       const LinkTwists& twists) noexcept {
  for (LocalContact& contact : contacts) {
    const bool was_impending = contact.state == ContactState::kImpending;
    const Vector3 arm = links.arm(contact);
    contact.s = contact.n_W.dot(links.pose(contact.link()).p + arm - contact.c_W);
    contact.v_n = relative_velocity(contact, twists[at(contact.link())], arm).normal;
    if (contact.s > 0) {
      contact.state = ContactState::kImpending;
    } else if (contact.v_n > 0) {
      contact.state = ContactState::kSeparating;
    } else {
      contact.state = was_impending ? ContactState::kColliding : ContactState::kPenetrating;
    }
  }
}

GeneralisedForce apply_contact_forces(LocalContacts& contacts, const LinkMotion& links,
                                      const LinkTwists& twists, const ContactLaw& law) noexcept {
  StaticVector<Wrench, kMaxLinks> wrench(static_cast<std::size_t>(links.count()), Wrench::Zero());
  for (LocalContact& contact : contacts) {
    contact.f_W.setZero();
    contact.loaded = false;
    if (contact.s > 0) {
      contact.z_W.setZero();
      contact.slipping = false;
      continue;
    }
    const Vector3 arm = links.arm(contact);
    const RelativeVelocity v = relative_velocity(contact, twists[at(contact.link())], arm);
    const double f_n = std::max(0.0, penalty(contact, v.normal, law));
    Vector3 f_t = elastic_friction(contact, v.tangential, law);
    const double size = f_t.norm();
    const double mu =
        contact.slipping ? kinetic_friction(contact, law) : static_friction(contact, law);
    contact.slipping = size > mu * f_n;
    if (contact.slipping) f_t *= kinetic_friction(contact, law) * f_n / size;
    // Backward Euler of the elasto-plastic anchor: exact in stick, and in slip it follows.
    contact.z_W =
        (-law.dt * f_t + law.damping * contact.z_W) / (law.stiffness * law.dt + law.damping);
    contact.loaded = f_n > 0;
    contact.f_W = f_n * contact.n_W + f_t;
    wrench[at(contact.link())].head<3>() += contact.f_W;
    wrench[at(contact.link())].tail<3>() += arm.cross(contact.f_W);
  }
  GeneralisedForce tau = GeneralisedForce::Zero(links.dof());
  for (int i = 0; i < links.count(); ++i) {
    tau += links.jacobian(i).transpose().lazyProduct(wrench[at(i)]);
  }
  return tau;
}

Velocity solve_contact_step(const LocalContacts& contacts, const LinkMotion& links,
                            const MassMatrix& E, const GeneralisedForce& r,
                            const ContactLaw& law) noexcept {
  Trials trials = first_trials(contacts, links, law);
  Velocity v;
  for (int pass = 0; pass < kMaxPasses; ++pass) {
    const System system = assemble(contacts, trials, links, E, r, law);
    v = system.A.llt().solve(system.r);
    if (!revise(contacts, link_twists(links, v), law, trials)) break;
  }
  return v;
}

MassMatrix unit_stiffness(const LocalContacts& contacts, const LinkMotion& links) noexcept {
  StaticVector<Matrix6, kMaxLinks> sum(static_cast<std::size_t>(links.count()), Matrix6::Zero());
  for (const LocalContact& contact : contacts) {
    Vector6 row;
    row << contact.n_W, links.arm(contact).cross(contact.n_W);
    sum[at(contact.link())].noalias() += row * row.transpose();
  }
  MassMatrix K = MassMatrix::Zero(links.dof(), links.dof());
  for (int i = 0; i < links.count(); ++i) {
    const Jacobian& J = links.jacobian(i);
    const Jacobian product = sum[at(i)].lazyProduct(J);
    K += J.transpose().lazyProduct(product);
  }
  return K;
}

}  // namespace hlm::server
