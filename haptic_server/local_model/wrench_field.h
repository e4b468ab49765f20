// A wrench on a link of the tool that the environment states and no contact explains: of a weld, a
// tendon, a payload, drag, or a robot's force sensor (docs/method.md 19).
#pragma once

#include "hlm/common/contact.h"
#include "hlm/common/spatial.h"

namespace hlm::server {

/// What the environment states of a link, and the link's state for which that holds.
struct WrenchReport {
  double time = 0;  ///< The environment's, s.
  Pose X_WL;
  Twist V_W = Twist::Zero();    ///< At the link's origin, as the wrench.
  Wrench F_W = Wrench::Zero();  ///< World axes, N and N·m.
};

/// A wrench that is held from report to report reacts a frame and a delay late, and what depends on
/// the link's motion then swings: a stiff spring, drag, a payload's inertia. This finds in the
/// reports how the wrench depends on it, and lets it follow at every step:
///
///     F = F_r - K δ - B (V - V_r) - M (A - A_r),
///
/// with δ, V, A the link's displacement, twist and acceleration, and r at the latest report. M and
/// B are one number each for translation and for rotation, from a fit with forgetting; K is found
/// from report to report (BFGS), so that a wall is there from its first report on. All are
/// positive semidefinite, so that what is found can only resist. What they do not explain enters
/// over `kRise`. It is never much more than what was reported of late.
///
/// Rotations are scaled by a length: metres and newtons throughout.
class WrenchField {
 public:
  /// length: of the tool, m.
  explicit WrenchField(double length) noexcept : length_(length) {}

  void report(const WrenchReport& report) noexcept;
  /// Whether it acts, or has acted shortly before. Steps in between may be left out.
  bool acts() const noexcept { return acts_; }

  /// What acts on the link in a step of Δt that begins at X_WL with twist V, as an equation for
  /// the twist V⁺ at its end: F = F - Δt K V⁺ - B V⁺ - M (V⁺ - V) / Δt.
  /// most: force, N, beyond which it is constant.
  struct Step {
    Wrench F_W = Wrench::Zero();          ///< N, N·m about the link's origin.
    Matrix6 stiffness = Matrix6::Zero();  ///< K, world axes: N/m, N·m/rad on its diagonal.
    Matrix6 damping = Matrix6::Zero();    ///< B: N·s/m, N·m·s/rad.
    Matrix6 inertia = Matrix6::Zero();    ///< M: kg, kg·m².
  };
  Step begin_step(const Pose& X_WL, const Twist& V_W, double dt, double most) noexcept;
  /// The step has led to that twist. Returns the wrench that acted in it, N and N·m.
  Wrench end_step(const Twist& V_W, double dt) noexcept;

 private:
  /// Fit of what B and M explain of the changes of three components, without negative parts.
  struct Response {
    double damping = 0;  ///< N·s/m.
    double inertia = 0;  ///< kg.

    void learn(const Vector3& change_V, const Vector3& change_A, const Vector3& change_F) noexcept;

   private:
    double vv_ = 0, va_ = 0, aa_ = 0, vf_ = 0, af_ = 0, ff_ = 0;  ///< Sums of products.
  };

  Vector6 scaled(const Vector6& motion) const noexcept;
  Vector6 scaled_force(const Wrench& F) const noexcept;
  void learn(const Vector6& moved, const Vector6& change_V, const Vector6& change_A,
             const Vector6& change_F) noexcept;
  void learn_stiffness(const Vector6& moved, const Vector6& resisted) noexcept;
  template <int first, int count>
  void bound(double most) noexcept;

  double length_;
  bool acts_ = false;
  int reports_ = 0;  ///< That were compared, up to two.
  WrenchReport latest_;
  WrenchReport learned_;         ///< The latest that was compared with the one before.
  Vector6 A_ = Vector6::Zero();  ///< Mean acceleration before that.
  Response linear_, angular_;
  Matrix6 K_ = Matrix6::Zero();

  bool jumps_ = false;                ///< A report has come since the latest step.
  double reported_ = 0;               ///< Largest of late, N.
  Vector6 gap_ = Vector6::Zero();     ///< From what is found to what acts: goes to zero.
  Step step_;                         ///< The present one, scaled.
  Vector6 V_ = Vector6::Zero();       ///< At its start.
  Vector6 A_step_ = Vector6::Zero();  ///< In the latest one.
  Vector6 F_ = Vector6::Zero();       ///< What acted in it.
};

}  // namespace hlm::server
