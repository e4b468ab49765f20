// The force of one contact at a velocity, and what forces do to the frames
// (docs/method.md 4.1, 4.2).
#pragma once

#include <algorithm>

#include "hlm/haptic_server/local_model/frames.h"
#include "hlm/haptic_server/local_model/local_contact.h"
#include "hlm/haptic_server/local_model/parameters.h"

namespace hlm::server {

/// What every contact of a group shares in a step.
struct ContactLaw {
  double stiffness = 0;         ///< k, N/m, after limiting.
  double damping = 0;           ///< b, N·s/m.
  double static_friction = 0;   ///< μ_s where a contact has no coefficient of its own.
  double kinetic_friction = 0;  ///< μ_k, in the same case.
  double ahead = 1;             ///< Factor on the own coefficient of what is moved ahead.
  double dt = 0;                ///< Step, s.
  double rendered = 1;          ///< Explicit step: share of the force before that did its work.
  ContactStep step = ContactStep::kImplicit;
};

/// Stiffness and damping of contacts without the tool, N/m and N·s/m. Nobody feels them, so they
/// may be as good as rigid: softer, a jammed body yields under the tool; much stiffer, rounding of
/// their separation is felt.
inline constexpr double kSupportStiffness = 1e6;
inline constexpr double kSupportDamping = 1e3;
/// Factor on the friction of bodies that are moved ahead of their reports. With 1, one that slides
/// in the environment sticks here now and then: it is lost and hit again.
inline constexpr double kSupportFriction = 0.9;

inline Vector3 tangential(const Vector3& v, const Vector3& n) noexcept { return v - n.dot(v) * n; }

inline Vector3 point_velocity(const Twist& V, const Vector3& arm) noexcept {
  return V.head<3>() + V.tail<3>().cross(arm);
}

/// Velocity of a contact's point on a against the one on b, along n and across it.
struct RelativeVelocity {
  double normal;       ///< v_n, m/s.
  Vector3 tangential;  ///< m/s.
};
/// V: twist of frame a less that of frame b, about O; arm: of the point from O.
inline RelativeVelocity relative_velocity(const LocalContact& contact, const Twist& V,
                                          const Vector3& arm) noexcept {
  const Vector3 v = point_velocity(V, arm) - contact.constraint.v_WC;
  return {contact.now.n_W.dot(v), tangential(v, contact.now.n_W)};
}

/// The twist of frame a less that of frame b; most contacts follow one of the same two frames.
class RelativeTwists {
 public:
  explicit RelativeTwists(const FrameTwists& twists) noexcept : twists_(twists) {}

  const Twist& of(const LocalContact& contact) noexcept {
    if (contact.frame_a != a_ || contact.frame_b != b_) {
      a_ = contact.frame_a;
      b_ = contact.frame_b;
      V_ = twists_[a_] - twists_[b_];
    }
    return V_;
  }

 private:
  const FrameTwists& twists_;
  FrameIndex a_ = kWorldFrame;
  FrameIndex b_ = kWorldFrame;
  Twist V_ = Twist::Zero();
};

/// Whether the contact may carry in this step: it is closed, or closes before the step ends.
inline bool takes_part(const LocalContact& contact, const ContactLaw& law) noexcept {
  if (contact.now.s <= 0) return true;
  return law.step == ContactStep::kImplicit && contact.now.s + law.dt * contact.now.v_n < 0;
}

/// -k s - b v_n: the normal force before it is clamped, N.
inline double penalty(const LocalContact& contact, double v_n, const ContactLaw& law) noexcept {
  const double moved = law.step == ContactStep::kImplicit ? law.dt * v_n : 0;
  return -law.stiffness * (contact.now.s + moved) - law.damping * v_n;
}

/// μ_s, μ_k: the materials' own where the environment gives it, else the local model's.
inline double coefficient(const LocalContact::Material& material, const ContactLaw& law,
                          double otherwise) noexcept {
  const double ahead = material.ahead ? law.ahead : 1;
  const double mu = material.friction >= 0 ? ahead * material.friction : otherwise;
  return material.scale * mu;
}
inline double static_friction(const LocalContact& contact, const ContactLaw& law) noexcept {
  return coefficient(contact.material, law, law.static_friction);
}
inline double kinetic_friction(const LocalContact& contact, const ContactLaw& law) noexcept {
  return coefficient(contact.material, law, law.kinetic_friction);
}

/// f*: what the tangential spring and damper ask for, N, on a.
inline Vector3 elastic_friction(const LocalContact& contact, const Vector3& v_t,
                                const ContactLaw& law) noexcept {
  return -law.stiffness * (contact.friction.z_W + law.dt * v_t) - law.damping * v_t;
}

struct ContactForce {
  double normal;
  Vector3 friction;
  bool slips;
};
/// What the contact does to a at this velocity at the end of the step, N.
inline ContactForce force_at(const LocalContact& contact, const RelativeVelocity& v,
                             const ContactLaw& law) noexcept {
  ContactForce f;
  f.normal = std::clamp(penalty(contact, v.normal, law), 0.0, contact.deformation.cap);
  f.friction = elastic_friction(contact, v.tangential, law);
  const double size = f.friction.norm();
  const double mu =
      contact.friction.slipping ? kinetic_friction(contact, law) : static_friction(contact, law);
  f.slips = size > mu * f.normal;
  if (f.slips) f.friction *= kinetic_friction(contact, law) * f.normal / size;
  return f;
}

/// Wrenches on the frames about O, and what they do to the unknowns.
class FrameLoads {
 public:
  explicit FrameLoads(const FrameMotions& frames) noexcept
      : frames_(frames), wrenches_(frames.count(), Wrench::Zero()) {}

  /// A force on a, and the opposite on b.
  void add(const LocalContact& contact, const Vector3& arm, const Vector3& f) noexcept {
    // The wrenches are added by halves: one that is put together first waits for its own stores.
    const Vector3 moment = arm.cross(f);
    Wrench& on_a = wrenches_[contact.frame_a];
    Wrench& on_b = wrenches_[contact.frame_b];
    on_a.head<3>() += f;
    on_a.tail<3>() += moment;
    on_b.head<3>() -= f;
    on_b.tail<3>() -= moment;
  }

  Unknowns generalised() const noexcept {
    Unknowns tau = Unknowns::Zero(frames_.unknowns());
    for (std::size_t i = 0; i < frames_.count(); ++i) {
      const FrameMotion& frame = frames_[static_cast<FrameIndex>(i)];
      if (frame.J.cols() == 0) continue;
      tau.segment(frame.first, frame.J.cols()) += frame.J.transpose().lazyProduct(wrenches_[i]);
    }
    return tau;
  }

 private:
  const FrameMotions& frames_;
  StaticVector<Wrench, kMaxFrames> wrenches_;
};

}  // namespace hlm::server
