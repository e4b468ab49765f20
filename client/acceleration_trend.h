// How the forces on bodies change from report to report.
#pragma once

#include <cstdint>
#include <map>

#include "hlm/common/contact.h"

namespace hlm {

/// A report gives a body's acceleration by all but contacts, and the server applies it until the
/// next report comes round. Meanwhile the acceleration of a body on a spring, or of one that an
/// engine drives to and fro, has changed: each report would find the body wrong.
class AccelerationTrend {
 public:
  /// The rates at which the accelerations of `bodies`, given for `time` (s), change: the smaller of
  /// the two changes between the latest three calls, where both have the same sign.
  AccelerationRates rates(const MovableBodies& bodies, double time);

 private:
  struct Past {
    double time = 0;                   ///< s.
    Vector6 A_W = Vector6::Zero();     ///< m/s², rad/s².
    Vector6 rate_W = Vector6::Zero();  ///< Since the previous call, 1/s.
  };
  std::map<std::uint32_t, Past> past_;  ///< By body, of the latest call.
};

}  // namespace hlm
