// One contact of the local model: an infinite plane on side b, the point of side a that it stops,
// and its state.
#pragma once

#include <cstdint>

#include "common/contact.h"
#include "common/spatial.h"
#include "common/static_vector.h"
#include "common/vocabulary.h"

namespace hlm::server {

struct LocalContact {
  std::uint64_t identity = 0;
  /// The sides: a is a link of the tool, whose point p_L is; b is the world, or moves regardless of
  /// the tool. Other sides have a Jacobian block each, and are left out at an update so far.
  ContactSide a;
  ContactSide b;
  double friction = -1;  ///< Of the two materials; negative: the local model's own.

  // The local constraint: the plane through c with normal n, moving along n.
  Vector3 c_W = Vector3::Zero();  ///< Point on the environment, world, m.
  Vector3 n_W = Vector3::UnitZ();
  Vector3 v_WC = Vector3::Zero();  ///< Velocity of the environment's point, world, m/s.
  double v_constr = 0;             ///< Eq. 2: nᵀ v_c, m/s.

  /// Link of the tool on side a.
  int link() const noexcept { return static_cast<int>(a.index); }

  /// The local contact point: the tool's own point where the proxy is not deformed. Link frame, m.
  Vector3 p_L = Vector3::Zero();

  /// Change of the separation that an update has deferred, m, and the most of it that one step
  /// applies, m >= 0. Rule `retain` releases load (> 0), `plane_recovery` goes either way.
  double deferred = 0;
  double deferred_step = 0;
  /// The environment no longer reports the contact; it goes once released.
  bool orphaned = false;

  ContactState state = ContactState::kImpending;
  double s = 0;    ///< Eq. 3, at the latest evaluation, m.
  double v_n = 0;  ///< Normal velocity of the proxy's point against the constraint, m/s.

  // Dry friction.
  Vector3 z_W = Vector3::Zero();  ///< Elastic deflection of the tangential anchor, world, m.
  bool slipping = false;
  bool loaded = false;            ///< Whether the normal force was > 0 in the latest step.
  Vector3 f_W = Vector3::Zero();  ///< Contact force on the tool in the latest step, world, N.
};

/// Contacts of one update and the released rest of the update before.
inline constexpr std::size_t kMaxLocalContacts = 2 * kMaxContacts;
using LocalContacts = StaticVector<LocalContact, kMaxLocalContacts>;

}  // namespace hlm::server
