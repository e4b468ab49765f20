#include "hlm/client/acceleration_trend.h"

#include <cmath>
#include <utility>

namespace hlm {
namespace {

/// Of what the protocol takes, 1/s of m/s² and rad/s².
constexpr double kLargestRate = 1e8;

/// Of each component the smaller one; none where they differ in sign.
Vector6 common_part(const Vector6& a, const Vector6& b) {
  Vector6 common = Vector6::Zero();
  for (Eigen::Index i = 0; i < 6; ++i) {
    if (a[i] * b[i] > 0) common[i] = std::abs(a[i]) < std::abs(b[i]) ? a[i] : b[i];
  }
  return common;
}

}  // namespace

AccelerationRates AccelerationTrend::rates(const MovableBodies& bodies, double time) {
  AccelerationRates rates;
  std::map<std::uint32_t, Past> present;
  for (const MovableBody& body : bodies) {
    Past now{.time = time, .A_W = body.A_W};
    const auto past = past_.find(body.id);
    if (past != past_.end() && time > past->second.time) {
      const Past& before = past->second;
      now.rate_W = (now.A_W - before.A_W) / (time - before.time);
      const Vector6 rate_W =
          common_part(now.rate_W, before.rate_W).cwiseMax(-kLargestRate).cwiseMin(kLargestRate);
      if (!rate_W.isZero(0)) rates.push_back({body.id, rate_W});
    }
    present[body.id] = now;
  }
  past_ = std::move(present);
  return rates;
}

}  // namespace hlm
