// Simultaneous frictionless collisions of tool, bodies and constraints (docs/method.md 5,
// Eqs. 9-11).
#pragma once

#include "hlm/haptic_server/local_model/frames.h"
#include "hlm/haptic_server/local_model/local_contact.h"
#include "hlm/haptic_server/local_model/parameters.h"

namespace hlm::server {

/// Contacts that are resolved at once; the penalty stops the others.
inline constexpr std::size_t kMaxCollisions = 128;

/// n×m: how a unit impulse of each contact changes u, the velocities in coordinates of unit mass
/// (u = Lᵀ q̇ for D = L Lᵀ): kinetic energy is |u|²/2.
using ImpulseColumns =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxUnknowns, kMaxCollisions>;
/// One number for each contact.
using ContactNumbers = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxCollisions, 1>;

/// Sine of the angle below which two contacts are one where constraints are at rest: with less
/// their impulses are the inverse of rounding.
inline constexpr double kDistinctAngle = 1e-6;
/// How far, in radians, a contact whose constraint moves must lean from those already resolved to
/// be resolved with them. Two moving walls that close on a tool like a wedge have impulses of the
/// inverse of their angle; left out, such a contact is stopped by its penalty alone.
inline constexpr double kWedgeAngle = 0.05;

/// The impulses p (N·s) that resolve the collisions. w: for each contact (1 + e) times its normal
/// velocity before the collision, m/s.
/// kNewton gives Eq. 11, p = -(Aᵀ A)⁺ w; kNonnegative the p >= 0 for which p ⟂ Aᵀ A p + w >= 0.
/// Neither adds kinetic energy where constraints are at rest, w = (1 + e) Aᵀ u. `independence`:
/// sine of the angle below which kNonnegative leaves a contact to those that it nearly repeats.
ContactNumbers collision_impulses(CollisionRule rule, const ImpulseColumns& A,
                                  const ContactNumbers& w, double independence) noexcept;

}  // namespace hlm::server
