// How a link moves that a mechanism guides, such as a gripper's finger on its linkage: along a
// curve, by one coordinate that several links may share (docs/method.md 22).
#pragma once

#include <cstdint>

#include "hlm/common/spatial.h"

namespace hlm {

/// Factors of a curve's polynomials.
inline constexpr int kCurveTerms = 10;

/// Pose of the link in its joint's frame J. It depends on x = (2 q - lower - upper) / (upper -
/// lower), which is -1 at the lower limit of the coordinate and 1 at the upper one; beyond them it
/// goes on straight.
struct JointCurve {
  std::uint8_t link = 0;    ///< A link whose joint is kGuided or kFollowing.
  std::uint8_t leader = 0;  ///< Whose coordinate q is: a kGuided link, itself or one before it.
  double armature = 0;      ///< What a motor adds to the coordinate's inertia, kg or kg·m², >= 0.
  /// Rows: p_JL (m), R_JL (w, x, y, z, of any length but 0). Columns: factors of 1, x, x², …
  Eigen::Matrix<double, 7, kCurveTerms> terms = Eigen::Matrix<double, 7, kCurveTerms>::Zero();

  bool operator==(const JointCurve&) const = default;
};

/// Where the curve is, and how it goes on: first and second derivatives by q, in J.
struct CurvePoint {
  Pose X_JL;
  Vector3 v_J = Vector3::Zero();      ///< Of the link's origin, m,
  Vector3 omega_J = Vector3::Zero();  ///< of its rotation, rad,
  Vector3 a_J = Vector3::Zero();      ///< and how these change.
  Vector3 alpha_J = Vector3::Zero();
};

/// lower < upper: limits of the coordinate q.
CurvePoint point_of(const JointCurve& curve, double lower, double upper, double q) noexcept;

/// Of its quaternion, at 33 places between the limits: the least and the largest length, and how
/// much it changes by x at most, as a multiple of its length.
struct CurveLengths {
  double least = 0;
  double largest = 0;
  double change = 0;
};
CurveLengths lengths_of(const JointCurve& curve) noexcept;

}  // namespace hlm
