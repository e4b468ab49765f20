#include "hlm/common/joint_curve.h"

#include <algorithm>

namespace hlm {
namespace {

using Row = Eigen::Matrix<double, 7, 1>;

/// Value of the polynomials, and their derivatives by x.
struct Values {
  Row f = Row::Zero();
  Row df = Row::Zero();
  Row ddf = Row::Zero();
};

Values values_at(const JointCurve& curve, double x) noexcept {
  const double inside = std::clamp(x, -1.0, 1.0);
  Values y;
  for (int i = kCurveTerms - 1; i >= 0; --i) {
    y.ddf = inside * y.ddf + 2 * y.df;
    y.df = inside * y.df + y.f;
    y.f = inside * y.f + curve.terms.col(i);
  }
  if (inside != x) {
    y.f += (x - inside) * y.df;
    y.ddf.setZero();
  }
  return y;
}

/// The vector part of a b*, for quaternions w, x, y, z.
Vector3 vector_of_product(const Eigen::Vector4d& a, const Eigen::Vector4d& b) noexcept {
  const Vector3 u = a.tail<3>();
  const Vector3 v = b.tail<3>();
  return b[0] * u - a[0] * v - u.cross(v);
}

}  // namespace

CurvePoint point_of(const JointCurve& curve, double lower, double upper, double q) noexcept {
  const double slope = 2 / (upper - lower);  // dx/dq
  const Values y = values_at(curve, slope * (q - lower) - 1);
  const Eigen::Vector4d R = y.f.tail<4>();
  const Eigen::Vector4d dR = y.df.tail<4>();
  const Eigen::Vector4d ddR = y.ddf.tail<4>();
  const double square = std::max(R.squaredNorm(), 1e-12);
  const Vector3 turns = vector_of_product(dR, R);
  CurvePoint point;
  point.X_JL = {y.f.head<3>(), Quaternion(R[0], R[1], R[2], R[3]).normalized()};
  point.v_J = slope * y.df.head<3>();
  point.omega_J = slope * 2 / square * turns;
  point.a_J = slope * slope * y.ddf.head<3>();
  point.alpha_J =
      slope * slope * 2 / square * (vector_of_product(ddR, R) - 2 * R.dot(dR) / square * turns);
  return point;
}

CurveLengths lengths_of(const JointCurve& curve) noexcept {
  constexpr int kPlaces = 33;
  CurveLengths lengths{curve.terms.block<4, 1>(3, 0).norm(), 0, 0};
  for (int i = 0; i < kPlaces; ++i) {
    const Values y = values_at(curve, 2.0 * i / (kPlaces - 1) - 1);
    const double length = y.f.tail<4>().norm();
    lengths.least = std::min(lengths.least, length);
    lengths.largest = std::max(lengths.largest, length);
    lengths.change = std::max(lengths.change, y.df.tail<4>().norm() / std::max(length, 1e-12));
  }
  return lengths;
}

}  // namespace hlm
