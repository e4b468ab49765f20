// How far two frames that should agree are apart.
#pragma once

#include <string>

#include "hlm/common/spatial.h"

namespace hlm::server {

struct Drift {
  double distance = 0;  ///< m.
  double angle = 0;     ///< rad.
};

/// The drift as text, for example "0.250 mm, 2.000 deg".
std::string describe(const Drift& drift);

/// The drift of two frames over time.
struct DriftRecord {
  Drift largest;  ///< Largest distance, and largest angle.
  Drift last;

  void observe(const Pose& X_WA, const Pose& X_WB) noexcept;
};

/// The drifts as text, for example "largest 3.000 mm, 2.000 deg; last 0.250 mm, 0.000 deg".
std::string describe(const DriftRecord& record);

}  // namespace hlm::server
