#include "haptic_server/local_model/body_friction.h"

#include <algorithm>

namespace hlm::server {
namespace {

/// Slower bodies may as well stick, m/s.
constexpr double kSlides = 0.005;
/// Share of an error that is learnt from the updates within one round through the environment.
/// Larger swings; smaller learns more slowly than a person begins to push.
constexpr double kGain = 0.6;
/// Largest error of the scale that one update may show, and bounds of the scale.
constexpr double kLargestError = 0.2;
constexpr double kLeastScale = 0.5;
constexpr double kLargestScale = 1.25;

double coefficient(double reported, double kinetic_friction) noexcept {
  return reported >= 0 ? reported : kinetic_friction;
}

/// Friction of all contacts of the body with others than the tool if it slides, N.
double sliding_friction(std::uint32_t body, const ReportedContacts& contacts,
                        double kinetic_friction) noexcept {
  const auto is_body = [body](const ContactSide& side) {
    return side.kind == SideKind::kMovableBody && side.index == body;
  };
  double sum = 0;
  for (const ReportedContact& contact : contacts) {
    if (contact.a.kind == SideKind::kToolLink || contact.load <= 0) continue;
    if (!is_body(contact.a) && !is_body(contact.b)) continue;
    sum += contact.load * coefficient(contact.friction, kinetic_friction);
  }
  return sum;
}

}  // namespace

void scale_friction(LocalBodies& bodies, const LocalBodies& known, FrameIndex first_frame,
                    double kinetic_friction, LocalContacts& contacts) noexcept {
  for (LocalBody& body : bodies) {
    for (const LocalBody& before : known) {
      if (before.id == body.id) body.friction_scale = before.friction_scale;
    }
  }
  for (LocalContact& contact : contacts) {
    const auto body = static_cast<std::size_t>(contact.frame_a - first_frame);
    contact.friction =
        bodies[body].friction_scale * coefficient(contact.friction, kinetic_friction);
  }
}

void learn_friction(LocalBody& body, const Twist& V_W, const ReportedContacts& contacts,
                    double kinetic_friction, double ahead, double period, double late) noexcept {
  const double speed = V_W.head<3>().norm();
  if (speed < kSlides || body.correction_steps == 0 || period <= 0) return;
  const Vector3 d = V_W.head<3>() / speed;
  const Matrix6 W = body.B.lazyProduct(body.B.transpose());
  const double slowing = sliding_friction(body.id, contacts, kinetic_friction) *
                         d.dot(W.topLeftCorner<3, 3>() * d);  // m/s²
  if (slowing <= 0) return;
  // The correction is due to friction that was scaled by `ahead` for a frame.
  const double error =
      d.dot(body.correction.head<3>()) / (slowing * period) + (1 - ahead) * body.friction_scale;
  const double gain = kGain / (1 + late / period);
  body.friction_scale =
      std::clamp(body.friction_scale - gain * std::clamp(error, -kLargestError, kLargestError),
                 kLeastScale, kLargestScale);
}

}  // namespace hlm::server
