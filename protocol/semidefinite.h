// Whether an inverse inertia is one.
#pragma once

#include "hlm/common/spatial.h"

namespace hlm::protocol {

/// Allowed negative eigenvalue of an inverse inertia, relative to the largest entry of its
/// translation and of its rotation: what single precision leaves. More takes matrices that push a
/// body towards the tool; less refuses engines that calculate in single precision.
inline constexpr double kMobilityTolerance = 1e-5;

/// Whether a symmetric matrix has no negative eigenvalue, within the tolerance. Rows and columns
/// as in a twist. Some 100 multiplications, no allocation.
bool is_mobility(const Matrix6& W) noexcept;

}  // namespace hlm::protocol
