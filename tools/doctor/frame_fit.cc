#include "hlm/tools/doctor/frame_fit.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/SVD>
#include <spdlog/fmt/fmt.h>

namespace hlm::server {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
/// Axes that are nearer to the world's than this are those, rad: a hand's movement is off by 10°.
constexpr double kAlongAxis = 25 * kDegree;
/// Volume of three unit vectors, or area of two, below which they are not different directions.
constexpr double kLeastVolume = 0.4;
constexpr double kStep = 5;  // Degrees, of angles that are named.

/// Unit vectors as columns; the third of two is their cross product.
struct Directions {
  Matrix3 told;
  Matrix3 moved;
};

Directions directions_of(const std::vector<ToldMove>& moves) {
  Directions d;
  for (Eigen::Index i = 0; i < 2; ++i) {
    d.told.col(i) = moves[static_cast<std::size_t>(i)].told;
    d.moved.col(i) = moves[static_cast<std::size_t>(i)].moved.normalized();
  }
  const auto third = [&](Matrix3& all, const Vector3* given) {
    all.col(2) = given != nullptr ? given->normalized() : Vector3(all.col(0).cross(all.col(1)));
  };
  third(d.told, moves.size() > 2 ? &moves[2].told : nullptr);
  third(d.moved, moves.size() > 2 ? &moves[2].moved : nullptr);
  return d;
}

/// The signed permutation whose entries are R's largest of each column.
Matrix3 nearest_axes(const Matrix3& R) {
  Matrix3 axes = Matrix3::Zero();
  for (Eigen::Index j = 0; j < 3; ++j) {
    Eigen::Index i = 0;
    R.col(j).cwiseAbs().maxCoeff(&i);
    axes(i, j) = R(i, j) < 0 ? -1 : 1;
  }
  return axes;
}

std::string axes_text(const Matrix3& axes) {
  std::string text;
  for (Eigen::Index j = 0; j < 3; ++j) {
    Eigen::Index i = 0;
    axes.col(j).cwiseAbs().maxCoeff(&i);
    if (j > 0) text += ' ';
    if (axes(i, j) < 0) text += '-';
    text += "xyz"[i];
  }
  return text;
}

double rounded(double angle) {
  const double degrees = kStep * std::round(angle / kDegree / kStep);
  return degrees == 0 ? 0 : degrees;  // No "-0".
}

}  // namespace

double angle_between(const Matrix3& A, const Matrix3& B) {
  const double cosine = ((A.transpose() * B).trace() - 1) / 2;
  return std::acos(std::clamp(cosine, -1.0, 1.0));
}

bool mirrors(const std::vector<ToldMove>& moves) {
  if (moves.size() != 3) return false;
  const Directions d = directions_of(moves);
  return d.moved.determinant() * d.told.determinant() < 0;
}

std::optional<FrameFit> fit_frame(const std::vector<ToldMove>& moves) {
  if (moves.size() != 2 && moves.size() != 3) return std::nullopt;
  const Directions d = directions_of(moves);
  if (std::abs(d.moved.determinant()) < kLeastVolume) return std::nullopt;
  // The rotation nearest to what takes the movements to where they went (Kabsch 1976).
  const Eigen::JacobiSVD<Matrix3> svd(d.told * d.moved.transpose(),
                                      Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3 turns = Matrix3::Identity();
  turns(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  FrameFit fit{svd.matrixU() * turns * svd.matrixV().transpose(), 0};
  for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(moves.size()); ++i) {
    const double cosine = d.told.col(i).dot(fit.R_WB * d.moved.col(i));
    fit.deviation = std::max(fit.deviation, std::acos(std::clamp(cosine, -1.0, 1.0)));
  }
  return fit;
}

std::string frame_text(const Matrix3& R) {
  const Matrix3 axes = nearest_axes(R);
  const bool is_rotation = std::abs(axes.determinant() - 1) < 0.5;
  if (is_rotation && angle_between(axes, R) < kAlongAxis) return axes_text(axes);
  const double roll = std::atan2(R(2, 1), R(2, 2));
  const double pitch = -std::asin(std::clamp(R(2, 0), -1.0, 1.0));
  const double yaw = std::atan2(R(1, 0), R(0, 0));
  return fmt::format("{:.0f} {:.0f} {:.0f}", rounded(roll), rounded(pitch), rounded(yaw));
}

}  // namespace hlm::server
