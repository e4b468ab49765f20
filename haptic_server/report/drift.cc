#include "hlm/haptic_server/report/drift.h"

#include <algorithm>
#include <numbers>

#include <spdlog/fmt/fmt.h>

namespace hlm::server {

std::string describe(const Drift& drift) {
  constexpr double kMillimetres = 1e3;
  constexpr double kDegrees = 180 / std::numbers::pi;
  return fmt::format("{:.3f} mm, {:.3f} deg", kMillimetres * drift.distance,
                     kDegrees * drift.angle);
}

void DriftRecord::observe(const Pose& X_WA, const Pose& X_WB) noexcept {
  const Vector6 e = displacement(X_WA, X_WB);
  last = {e.head<3>().norm(), e.tail<3>().norm()};
  largest.distance = std::max(largest.distance, last.distance);
  largest.angle = std::max(largest.angle, last.angle);
}

std::string describe(const DriftRecord& record) {
  return fmt::format("largest {}; last {}", describe(record.largest), describe(record.last));
}

}  // namespace hlm::server
