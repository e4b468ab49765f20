// The step in which contacts take part, by Newton's method (docs/method.md 4.3).
#include <algorithm>
#include <cstdint>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "hlm/haptic_server/local_model/contact_forces.h"

namespace hlm::server {
namespace {

/// Most rounds of the contact solver; one or two are typical.
constexpr int kMaxRounds = 8;
/// Least part of a round's change of the velocities that is tried.
constexpr double kLeastShare = 0.0625;
/// Error, as a share of the kinetic energy, that is rounding.
constexpr double kRounding = 1e-20;
/// Changes of friction's direction in a round below this are none.
constexpr double kSettled = 1e-2;
/// Groups of contacts in one step: the tool's, the limits of its joints, and those of movable
/// bodies among themselves.
constexpr std::size_t kMaxGroups = 3;

/// Most friction, for each newton, that follows the normal force within a step. With more a rod
/// that stands on its end could jam without bound (Painlevé): a uniform one from 4/3 on.
constexpr double kMostFollowing = 1.2;

/// How a contact takes part in one round of the solver.
enum class Mode : std::uint8_t {
  kOff,
  kStick,
  kSlip,  ///< Friction is at its limit.
};

/// What the contacts between two frames do in one round, about O: wrench on a less Z times the
/// difference of the frames' twists.
struct PairLoad {
  FrameIndex a = kWorldFrame;
  FrameIndex b = kWorldFrame;
  Matrix6 impedance;
  Wrench wrench;
};
using PairLoads = StaticVector<PairLoad, kMaxFrames * kMaxFrames>;

std::uint16_t pair_of(const LocalContact& contact, PairLoads& pairs) noexcept {
  for (std::size_t i = pairs.size(); i-- > 0;) {
    if (pairs[i].a == contact.frame_a && pairs[i].b == contact.frame_b) {
      return static_cast<std::uint16_t>(i);
    }
  }
  PairLoad& pair = pairs.emplace_back();
  pair.a = contact.frame_a;
  pair.b = contact.frame_b;
  return static_cast<std::uint16_t>(pairs.size() - 1);
}

struct Trial {
  Mode mode = Mode::kOff;
  bool capped = false;             ///< The normal force is at its limit.
  std::uint16_t pair = 0;          ///< Index of its PairLoad.
  Vector3 slip = Vector3::Zero();  ///< In kSlip: friction for each newton of normal force,
  double across = 0;               ///< the part of elastic_friction() across it,
  Vector3 rest = Vector3::Zero();  ///< and friction that does not follow within the round, N.
  Vector3 arm = Vector3::Zero();   ///< Arm of the contact point from O, m.

  /// Starts in the mode of the step before.
  Trial(const LocalContact& contact, const ContactLaw& law, const FrameMotions& frames,
        PairLoads& pairs) noexcept {
    if (!takes_part(contact, law)) return;
    pair = pair_of(contact, pairs);
    arm = contact.now.p_W - frames.reference_W();
    const bool slips = contact.friction.slipping || static_friction(contact, law) == 0;
    mode = slips ? Mode::kSlip : Mode::kStick;
    if (contact.friction.slipping) {
      const double mu = std::min(kinetic_friction(contact, law), kMostFollowing);
      slip = mu * tangential(contact.latest.f_W, contact.now.n_W).stableNormalized();
    }
  }
};
using Trials = StaticVector<Trial, kMaxLocalContacts>;

/// A unit force along n at `arm` from O: force and moment.
Vector6 unit_wrench(const Vector3& n, const Vector3& arm) noexcept {
  Vector6 wrench;
  wrench << n, arm.cross(n);
  return wrench;
}

/// Adds [β I, -β [r]; β [r], -β [r]²], [r] = skew(r): the impedance of a point at r from O that is
/// β in every direction. By its entries, which takes half the time of whole matrices.
void add_point_impedance(double beta, const Vector3& r, Matrix6& Z) noexcept {
  const Vector3 m = beta * r;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    const int k = (i + 2) % 3;
    Z(i, i) += beta;
    Z(i, 3 + j) += m[k];
    Z(j, 3 + i) -= m[k];
    Z(3 + i, j) -= m[k];
    Z(3 + j, i) += m[k];
    Z(3 + i, 3 + i) += m[j] * r[j] + m[k] * r[k];
    Z(3 + i, 3 + j) -= r[i] * m[j];
    Z(3 + j, 3 + i) -= r[j] * m[i];
  }
}

/// Adds the contact's force, f = f_0 - Z v_point, to the load of its pair.
void add_contact(const LocalContact& contact, const Trial& trial, const ContactLaw& law,
                 PairLoad& load) noexcept {
  const double beta = law.damping + law.stiffness * law.dt;
  const Vector3& n = contact.now.n_W;
  const double f_n = trial.capped
                         ? contact.deformation.cap
                         : -law.stiffness * contact.now.s + beta * n.dot(contact.constraint.v_WC);
  Vector3 f_0;
  if (trial.mode == Mode::kStick) {
    // Z = β I: the normal and both tangential directions share one impedance.
    f_0 = f_n * n - law.stiffness * contact.friction.z_W +
          beta * tangential(contact.constraint.v_WC, n);
    add_point_impedance(beta, trial.arm, load.impedance);
    if (trial.capped) {
      const Vector6 normal = unit_wrench(n, trial.arm);
      load.impedance.noalias() -= (beta * normal) * normal.transpose();
    }
  } else {
    // Friction follows the normal force within the step, so that a body that is tilted by its
    // friction has the loads that go with it.
    const Vector3 direction = n + trial.slip;
    f_0 = f_n * direction + trial.rest;
    if (!trial.capped) {
      load.impedance.noalias() +=
          (beta * unit_wrench(direction, trial.arm)) * unit_wrench(n, trial.arm).transpose();
    }
    if (trial.across > 0) {  // The force turns with the velocity.
      const Vector3 elastic = beta * contact.constraint.v_WC - law.stiffness * contact.friction.z_W;
      const Vector3 e = n.cross(trial.slip).normalized();
      const Vector6 row = unit_wrench(e, trial.arm);
      f_0 += trial.across * e.dot(elastic) * e;
      load.impedance.noalias() += (trial.across * beta * row) * row.transpose();
    }
  }
  load.wrench.head<3>() += f_0;
  load.wrench.tail<3>() += trial.arm.cross(f_0);
}

/// Adds J_relᵀ Z J_rel and J_relᵀ F of a pair, J_rel the Jacobian of a less that of b.
void add_pair(const PairLoad& load, const FrameMotions& frames, double dt,
              StepSystem& system) noexcept {
  const FrameMotion& a = frames[load.a];
  const FrameMotion& b = frames[load.b];
  const Wrench F = dt * (load.wrench - load.impedance * (a.V_bias - b.V_bias));
  const auto add = [&](const FrameMotion& frame, const Jacobian& J, double sign) {
    const Jacobian ZJ = load.impedance.lazyProduct(J);
    system.E.block(frame.first, frame.first, J.cols(), J.cols()) +=
        dt * J.transpose().lazyProduct(ZJ);
    system.r.segment(frame.first, J.cols()) += sign * J.transpose().lazyProduct(F);
    return ZJ;
  };
  if (a.J.cols() > 0 && b.J.cols() > 0 && a.first == b.first) {
    add(a, a.J - b.J, 1);
    return;
  }
  Jacobian ZJ_a;
  if (a.J.cols() > 0) ZJ_a = add(a, a.J, 1);
  if (b.J.cols() == 0) return;
  const Jacobian ZJ_b = add(b, b.J, -1);
  if (a.J.cols() == 0) return;
  system.E.block(a.first, b.first, a.J.cols(), b.J.cols()) -=
      dt * a.J.transpose().lazyProduct(ZJ_b);
  system.E.block(b.first, a.first, b.J.cols(), a.J.cols()) -=
      dt * b.J.transpose().lazyProduct(ZJ_a);
}

/// Decides a contact's mode again for the velocity that a round gave. True if it changed.
bool revise(const LocalContact& contact, const Twist& V, const ContactLaw& law,
            Trial& trial) noexcept {
  const RelativeVelocity v = relative_velocity(contact, V, trial.arm);
  const double wanted = penalty(contact, v.normal, law);
  const double f_n = std::min(wanted, contact.deformation.cap);
  const bool capped = wanted > contact.deformation.cap;
  const Vector3 slip_before = trial.slip;
  Mode mode = Mode::kOff;
  trial.slip.setZero();
  trial.rest.setZero();
  if (f_n > 0) {
    const Vector3 f = elastic_friction(contact, v.tangential, law);
    const double size = f.norm();
    const double mu_k = kinetic_friction(contact, law);
    const double mu = contact.friction.slipping ? mu_k : static_friction(contact, law);
    // Friction at its limit that turned the slip round within the step would have stopped it.
    const bool stopped = trial.mode == Mode::kSlip && f.dot(slip_before) < 0;
    const bool slips = mu == 0 || (size > mu * f_n && !stopped);
    mode = slips ? Mode::kSlip : Mode::kStick;
    if (slips && size > 0) {
      const double following = std::min(mu_k, kMostFollowing);
      trial.slip = (following / size) * f;
      trial.across = mu_k * f_n / size;
      trial.rest = ((mu_k - following) * f_n / size) * f;
    }
  }
  const bool changed = mode != trial.mode || capped != trial.capped ||
                       (trial.slip - slip_before).squaredNorm() > kSettled * kSettled;
  trial.mode = mode;
  trial.capped = capped;
  return changed;
}

/// One round: the loads of the pairs in the present modes, and the velocities that follow.
class ContactSolver {
 public:
  ContactSolver(ContactGroups groups, const FrameMotions& frames, const StepSystem& given) noexcept
      : groups_(groups), frames_(frames), given_(given) {
    for (const ContactGroup& group : groups_) {
      Trials& trials = trials_.emplace_back();
      for (const LocalContact& contact : group.contacts) {
        trials.emplace_back(contact, group.law, frames_, pairs_);
      }
    }
  }

  Unknowns solve() noexcept {
    bool slips = false;
    for (PairLoad& pair : pairs_) {
      pair.impedance.setZero();
      pair.wrench.setZero();
    }
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      for (std::size_t i = 0; i < trials_[g].size(); ++i) {
        const Trial& trial = trials_[g][i];
        if (trial.mode == Mode::kOff) continue;
        slips = slips || (trial.mode == Mode::kSlip && !trial.slip.isZero(0));
        add_contact(groups_[g].contacts[i], trial, groups_[g].law, pairs_[trial.pair]);
      }
    }
    system_.E = given_.E;
    system_.r = given_.r;
    for (const PairLoad& pair : pairs_) add_pair(pair, frames_, groups_[0].law.dt, system_);
    // Friction that follows the normal force makes E unsymmetric.
    if (slips) return system_.E.partialPivLu().solve(system_.r);
    return system_.E.llt().solve(system_.r);
  }

  /// How far x is from a solution: the square of what is missing in E x = r + Δt Σ Jᵀ f(x).
  double error(const Unknowns& x) const noexcept {
    const FrameTwists twists = frames_.twists(x);
    RelativeTwists relative(twists);
    FrameLoads loads(frames_);
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      for (std::size_t i = 0; i < groups_[g].contacts.size(); ++i) {
        const LocalContact& contact = groups_[g].contacts[i];
        if (!takes_part(contact, groups_[g].law)) continue;
        const Vector3& arm = trials_[g][i].arm;
        const RelativeVelocity v = relative_velocity(contact, relative.of(contact), arm);
        const ContactForce f = force_at(contact, v, groups_[g].law);
        loads.add(contact, arm, f.normal * contact.now.n_W + f.friction);
      }
    }
    const Unknowns missing =
        given_.E.lazyProduct(x) - given_.r - groups_[0].law.dt * loads.generalised();
    return missing.cwiseAbs2().cwiseQuotient(given_.E.diagonal()).sum();
  }

  bool revise_modes(const Unknowns& x) noexcept {
    const FrameTwists twists = frames_.twists(x);
    RelativeTwists relative(twists);
    bool changed = false;
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      const ContactGroup& group = groups_[g];
      for (std::size_t i = 0; i < group.contacts.size(); ++i) {
        const LocalContact& contact = group.contacts[i];
        if (!takes_part(contact, group.law)) continue;
        changed |= revise(contact, relative.of(contact), group.law, trials_[g][i]);
      }
    }
    return changed;
  }

 private:
  ContactGroups groups_;
  const FrameMotions& frames_;
  const StepSystem& given_;
  StepSystem system_;
  PairLoads pairs_;
  StaticVector<Trials, kMaxGroups> trials_;
};

}  // namespace

Unknowns solve_contact_step(ContactGroups groups, const FrameMotions& frames,
                            const StepSystem& system) noexcept {
  ContactSolver solver(groups, frames, system);
  Unknowns x = solver.solve();
  if (!solver.revise_modes(x)) return x;
  double error = solver.error(x);
  const double rounding = kRounding * x.cwiseAbs2().dot(system.E.diagonal());
  for (int round = 1; round < kMaxRounds && error > rounding; ++round) {
    const Unknowns change = solver.solve() - x;
    double share = 1;
    Unknowns next = x + change;
    double next_error = solver.error(next);
    while (next_error >= error && share > kLeastShare) {
      share /= 2;
      next = x + share * change;
      next_error = solver.error(next);
    }
    x = next;
    error = next_error;
    if (!solver.revise_modes(x) && share == 1) break;
  }
  return x;
}

}  // namespace hlm::server
