// One contact of the local model: an infinite plane on side b, the point of side a that it stops,
// and its state.
#pragma once

#include <cstdint>
#include <limits>

#include "hlm/common/contact.h"
#include "hlm/common/spatial.h"
#include "hlm/common/static_vector.h"
#include "hlm/common/vocabulary.h"
#include "hlm/haptic_server/local_model/frames.h"

namespace hlm::server {

/// The order of the fields counts: with the material behind the evaluation, steps that are repeated
/// at an update took 13 % longer.
struct LocalContact {
  std::uint64_t identity = 0;
  /// The sides as reported. a is a link of the tool or a movable body, whose point p_A is; b may
  /// also be the world, which moves regardless of the tool.
  ContactSide a{SideKind::kToolLink, 0};
  ContactSide b;
  /// The frames that the sides move with. A body that the local model does not have is the world's.
  FrameIndex frame_a = kFirstLinkFrame;
  FrameIndex frame_b = kWorldFrame;
  bool of_scene = false;  ///< Found here in the scene's geometry, not reported.

  /// Of what the two sides are made.
  struct Material {
    double friction = -1;  ///< Coefficient; negative: the local model's own.
    double scale = 1;      ///< On either (body_friction.h).
    bool ahead = false;    ///< A body is moved ahead of its reports on it.
  };
  Material material;

  /// The local constraint: the plane through c with normal n. c is fixed in the frame of b, and n
  /// in that of the side whose face it is. In the world it moves along n at v_constr of its own.
  struct Constraint {
    Vector3 c_B = Vector3::Zero();  ///< m.
    PlaneOwner plane = PlaneOwner::kB;
    Vector3 n_P = Vector3::UnitZ();  ///< Normal in the frame of `plane`.
    double v_constr = 0;             ///< Eq. 2: nᵀ v_c of a constraint in the world's frame, m/s.
    /// Velocity of the point of a constraint in the world's frame as damping and friction meet it,
    /// and as last reported, m/s: an update's change enters gradually.
    Vector3 v_WC = Vector3::Zero();
    Vector3 v_reported_W = Vector3::Zero();
  };
  Constraint constraint;

  /// How the proxy is deformed there, and what of that goes.
  struct Deformation {
    /// The local contact point: a's own point where the proxy is not deformed; of a's own plane the
    /// one over c. Frame of a, m.
    Vector3 p_A = Vector3::Zero();
    /// Of a contact of the scene: δ, s = σ + δ, m.
    double delta = 0;
    /// Change of the separation that an update has deferred, m, and the most of it that one step
    /// applies, m >= 0. > 0 releases load; < 0 brings the constraint back to where it is reported,
    /// with `releases_load` as far as the healing tank pays for it.
    double deferred = 0;
    double deferred_step = 0;
    /// Largest normal force of a contact that the environment no longer reports, N: it falls step
    /// by step, and the contact goes when it is zero. Infinite while the contact is reported.
    double cap = std::numeric_limits<double>::infinity();
  };
  Deformation deformation;
  bool orphaned() const noexcept {
    return deformation.cap < std::numeric_limits<double>::infinity();
  }

  /// Values at the latest evaluation, in the world.
  struct Evaluation {
    Vector3 p_W = Vector3::Zero();  ///< The local contact point, m.
    Vector3 c_W = Vector3::Zero();  ///< m.
    Vector3 n_W = Vector3::UnitZ();
    double s = 0;    ///< Eq. 3, m.
    double v_n = 0;  ///< Normal velocity of a's point against the constraint, m/s.
    ContactState state = ContactState::kImpending;
  };
  Evaluation now;

  /// Dry friction.
  struct Friction {
    Vector3 z_W = Vector3::Zero();  ///< Elastic deflection of the tangential anchor, world, m.
    bool slipping = false;
  };
  Friction friction;

  /// What the latest step made of it.
  struct Outcome {
    Vector3 f_W = Vector3::Zero();  ///< Contact force on a, world, N.
    double s_left = 0;              ///< s where the step, or an update since, left it, m.
    double taken = 0;               ///< Normal energy that went in for good, J.
    bool loaded = false;            ///< Whether the normal force was > 0.
  };
  Outcome latest;
};

/// The plane with its sides at X_WA and X_WB: n, unit, and c, m, in the world.
inline Vector3 normal_W(const LocalContact& contact, const Placement& X_WA,
                        const Placement& X_WB) noexcept {
  if (contact.frame_b == kWorldFrame) return contact.constraint.n_P;
  return (contact.constraint.plane == PlaneOwner::kA ? X_WA : X_WB).R * contact.constraint.n_P;
}
inline Vector3 constraint_point_W(const LocalContact& contact, const Placement& X_WB) noexcept {
  return contact.frame_b == kWorldFrame ? contact.constraint.c_B : X_WB * contact.constraint.c_B;
}

/// Evaluates where the contact is and s (Eq. 3), in the same way.
inline void locate(LocalContact& contact, const Placement& X_WA, const Placement& X_WB) noexcept {
  LocalContact::Evaluation& now = contact.now;
  now.p_W = X_WA * contact.deformation.p_A;
  now.c_W = constraint_point_W(contact, X_WB);
  now.n_W = normal_W(contact, X_WA, X_WB);
  now.s = now.n_W.dot(now.p_W - now.c_W);
  if (contact.constraint.plane == PlaneOwner::kA) now.p_W = now.c_W + now.s * now.n_W;
}

/// Contacts of one update and the released rest of the update before.
inline constexpr std::size_t kMaxLocalContacts = 2 * kMaxContacts;
using LocalContacts = StaticVector<LocalContact, kMaxLocalContacts>;

}  // namespace hlm::server
