#include "hlm/ve_client/world/roundness.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace hlm::ve {
namespace {

/// How far an axis may pass the centre of mass, m, and how much two may differ, rad.
constexpr double kOffAxis = 1e-6;

bool same_axis(const Vector3& a, const Vector3& b) { return a.cross(b).norm() <= kOffAxis; }

/// Zero for a shape that does not revolve.
Vector3 axis_of_revolution(const Shape& shape) {
  if (std::holds_alternative<Cylinder>(shape) || std::holds_alternative<Capsule>(shape)) {
    return Vector3::UnitZ();
  }
  if (const auto* ellipsoid = std::get_if<Ellipsoid>(&shape)) {
    const Vector3& r = ellipsoid->radii;
    if (r.x() == r.y()) return Vector3::UnitZ();
    if (r.y() == r.z()) return Vector3::UnitX();
    if (r.z() == r.x()) return Vector3::UnitY();
  }
  return Vector3::Zero();
}

/// The roundness of one collision about the body's origin, its centre of mass.
BodyRoundness roundness_of(const CollisionDescription& collision) {
  const Vector3& p = collision.X_BG.p;
  if (std::holds_alternative<Sphere>(collision.shape)) {
    if (p.norm() <= kOffAxis) return {.kind = Roundness::kSphere};
    return {.kind = Roundness::kAxis, .axis_B = p.normalized()};
  }
  const Vector3 axis_G = axis_of_revolution(collision.shape);
  const Vector3 axis_B = collision.X_BG.R * axis_G;
  if (axis_G.isZero(0) || axis_B.cross(p).norm() > kOffAxis) return {};
  return {.kind = Roundness::kAxis, .axis_B = axis_B};
}

}  // namespace

BodyRoundness roundness_of(const WorldDescription& world, int body) {
  const auto limits = [&](const JointDescription& joint) {
    return (joint.child == body || joint.parent == body) &&
           (std::isfinite(joint.lower) || std::isfinite(joint.upper));
  };
  if (std::ranges::any_of(world.joints, limits)) return {};
  std::optional<BodyRoundness> common;
  for (const CollisionDescription& collision :
       world.bodies[static_cast<std::size_t>(body)].collisions) {
    const BodyRoundness own = roundness_of(collision);
    if (own.kind == Roundness::kNone) return {};
    if (!common || common->kind == Roundness::kSphere) {
      common = own;
    } else if (own.kind == Roundness::kAxis && !same_axis(own.axis_B, common->axis_B)) {
      return {};
    }
  }
  return common.value_or(BodyRoundness{});
}

}  // namespace hlm::ve
