#include "hlm/devices/pantograph.h"

#include <cmath>
#include <numbers>

namespace hlm::server {
namespace {

/// Sine of the angle between the forearms: below, forces along the base's normal need large torques
/// that the motors do not have.
constexpr double kLeastSine = 0.05;

}  // namespace

std::optional<Pantograph::Handle> Pantograph::handle(const Vector2& theta) const noexcept {
  const Vector2 elbow0 = upper_arm * Vector2(std::cos(theta[0]), std::sin(theta[0]));
  const Vector2 elbow1 =
      Vector2(base, 0) + upper_arm * Vector2(std::cos(theta[1]), std::sin(theta[1]));
  const Vector2 between = elbow1 - elbow0;
  const double half = between.norm() / 2;
  const double height_squared = forearm * forearm - half * half;
  if (!(half > 0) || !(height_squared > 0)) return std::nullopt;
  const Vector2 left = Vector2(-between.y(), between.x()) / (2 * half);
  Handle result;
  result.p = elbow0 + between / 2 + std::sqrt(height_squared) * left;

  // Each forearm keeps its length: a_i · v = a_i · e_i', with a_i the forearm and e_i' the elbow's
  // velocity.
  const Vector2 a0 = result.p - elbow0;
  const Vector2 a1 = result.p - elbow1;
  Matrix2 A;
  A << a0.transpose(), a1.transpose();
  if (std::abs(A.determinant()) < kLeastSine * forearm * forearm) return std::nullopt;
  const Vector2 arm1 = elbow1 - Vector2(base, 0);
  const Vector2 turned0(-elbow0.y(), elbow0.x());
  const Vector2 turned1(-arm1.y(), arm1.x());
  result.J = A.inverse() * Vector2(a0.dot(turned0), a1.dot(turned1)).asDiagonal();
  return result;
}

std::optional<Vector2> Pantograph::angles(const Vector2& p) const noexcept {
  Vector2 theta;
  for (int i = 0; i < 2; ++i) {
    const Vector2 to_handle = p - Vector2(i * base, 0);
    const double distance = to_handle.norm();
    const double cosine = (upper_arm * upper_arm + distance * distance - forearm * forearm) /
                          (2 * upper_arm * distance);
    if (!(std::abs(cosine) < 1)) return std::nullopt;
    const double outwards = i == 0 ? 1 : -1;
    theta[i] = std::atan2(to_handle.y(), to_handle.x()) + outwards * std::acos(cosine);
  }
  return theta;
}

}  // namespace hlm::server
