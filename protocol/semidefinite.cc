#include "hlm/protocol/semidefinite.h"

#include <algorithm>
#include <cmath>

namespace hlm::protocol {
namespace {

/// Both blocks of the diagonal with entries of at most 1: 1/kg and 1/(kg·m²) do not compare.
Matrix6 without_units(const Matrix6& W) noexcept {
  Vector6 scale;
  for (int block = 0; block < 6; block += 3) {
    const double largest = W.diagonal().segment<3>(block).maxCoeff();
    scale.segment<3>(block).setConstant(largest > 0 ? 1 / std::sqrt(largest) : 1);
  }
  return scale.asDiagonal() * W * scale.asDiagonal();
}

}  // namespace

bool is_mobility(const Matrix6& W) noexcept {
  // Cholesky's factorisation, the largest pivot first.
  Matrix6 rest = without_units(W);
  for (int size = 6; size > 0; --size) {
    auto left = rest.topLeftCorner(size, size);
    int pivot = 0;
    const double largest = left.diagonal().maxCoeff(&pivot);
    if (left.diagonal().minCoeff() < -kMobilityTolerance) return false;
    if (!(largest > kMobilityTolerance)) {
      return left.cwiseAbs().maxCoeff() <= 2 * kMobilityTolerance;
    }
    const int last = size - 1;
    left.row(pivot).swap(left.row(last));
    left.col(pivot).swap(left.col(last));
    const Vector6 column = rest.col(last);
    rest.topLeftCorner(last, last).noalias() -=
        column.head(last) * column.head(last).transpose() / largest;
  }
  return true;
}

}  // namespace hlm::protocol
