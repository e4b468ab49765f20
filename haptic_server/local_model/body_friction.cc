#include "hlm/haptic_server/local_model/body_friction.h"

#include <algorithm>
#include <optional>

namespace hlm::server {
namespace {

/// Slower contacts may as well stick, m/s.
constexpr double kSlides = 0.005;
/// Slowing by friction from which on a correction tells of it, m/s².
constexpr double kLeastSlowing = 0.1;
/// Share of an error that is learnt from the updates within one round through the environment.
/// Larger swings; smaller learns more slowly than a person begins to push.
constexpr double kGain = 0.6;
/// Largest error of the scale that one update may show, and bounds of the scale.
constexpr double kLargestError = 0.2;
constexpr double kLeastScale = 0.5;
constexpr double kLargestScale = 1.25;

/// Sum of the friction forces on the body that slides on all its loaded contacts, N, world axes,
/// as the coefficients have it. Empty if one of them does not slide, or may move with the tool:
/// then the body's motion tells nothing of its friction.
std::optional<Vector3> sliding_friction(std::uint32_t body, const Pose& X_WB, const Twist& V_W,
                                        const FrictionReport& report) noexcept {
  const auto is_body = [body](const ContactSide& side) {
    return side.kind == SideKind::kMovableBody && side.index == body;
  };
  Vector3 sum = Vector3::Zero();
  for (const ReportedContact& contact : report.contacts) {
    if (contact.a.kind == SideKind::kToolLink || contact.load <= 0) continue;
    if (is_body(contact.b)) return std::nullopt;
    if (!is_body(contact.a)) continue;
    if (contact.b.kind != SideKind::kWorld) return std::nullopt;
    const Vector3 v = V_W.head<3>() + V_W.tail<3>().cross(contact.p_WC - X_WB.p) - contact.v_WC;
    const Vector3 slip = v - contact.n_W.dot(v) * contact.n_W;
    const double speed = slip.norm();
    if (speed < kSlides) return std::nullopt;
    const double mu = contact.friction >= 0 ? contact.friction : report.kinetic_friction;
    sum -= contact.load * mu / speed * slip;
  }
  return sum;
}

}  // namespace

void scale_friction(LocalBodies& bodies, const LocalBodies& known, FrameIndex first_frame,
                    LocalContacts& contacts) noexcept {
  for (LocalBody& body : bodies) {
    for (const LocalBody& before : known) {
      if (before.id == body.id) body.friction_scale = before.friction_scale;
    }
  }
  for (LocalContact& contact : contacts) {
    const auto body = static_cast<std::size_t>(contact.frame_a - first_frame);
    contact.material.scale = contact.frame_b == kWorldFrame ? bodies[body].friction_scale : 1;
  }
}

void learn_friction(LocalBody& body, const Pose& X_WB, const Twist& V_W,
                    const FrictionReport& report) noexcept {
  if (body.correction_steps == 0 || report.elapsed <= 0) return;
  const auto friction = sliding_friction(body.id, X_WB, V_W, report);
  if (!friction) return;
  const Matrix6 W = body.B.lazyProduct(body.B.transpose());
  const Vector3 slowing = W.topLeftCorner<3, 3>() * *friction;  // m/s²
  if (slowing.norm() < kLeastSlowing) return;
  // The correction stems from friction that was scaled by `ahead` since the update before.
  const double seen =
      slowing.dot(body.correction.head<3>()) / (slowing.squaredNorm() * report.elapsed);
  const double error = (1 - report.ahead) * body.friction_scale - seen;
  const double gain = kGain / (1 + report.late / report.elapsed);
  body.friction_scale =
      std::clamp(body.friction_scale - gain * std::clamp(error, -kLargestError, kLargestError),
                 kLeastScale, kLargestScale);
}

}  // namespace hlm::server
