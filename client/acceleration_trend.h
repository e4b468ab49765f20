// How the forces on bodies change from report to report.
#pragma once

#include <cstdint>
#include <map>

#include "hlm/common/contact.h"

namespace hlm {

/// Reports tell what accelerates a body, except contacts, and the server moves the body by it for
/// as long as the loop takes. A body on a spring, or one that an engine drives to and fro,
/// accelerates otherwise by then, and would be found wrong at each report.
class AccelerationTrend {
 public:
  /// The rates at which the accelerations of `bodies`, those at `time` (s), change: of the changes
  /// between the latest three calls the smaller one, where they agree in sign.
  AccelerationRates rates(const MovableBodies& bodies, double time);

 private:
  struct Past {
    double time = 0;                   ///< s.
    Vector6 A_W = Vector6::Zero();     ///< m/s², rad/s².
    Vector6 rate_W = Vector6::Zero();  ///< Since the call before, 1/s.
  };
  std::map<std::uint32_t, Past> past_;  ///< By body, of the latest call.
};

}  // namespace hlm
