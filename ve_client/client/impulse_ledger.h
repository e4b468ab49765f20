// What of the tool's impulses on movable bodies the simulator has still to apply.
#pragma once

#include <cstdint>
#include <map>

#include "protocol/messages.h"

namespace hlm {

using BodyImpulses = StaticVector<protocol::BodyImpulse, kMaxBodies>;

/// The server reports totals since the session began, so that a lost datagram loses nothing. This
/// keeps what of them was taken.
class ImpulseLedger {
 public:
  /// A session begins: the totals do.
  void reset();
  /// What came since the totals that were taken before: for each body of `totals` its part of them,
  /// in their order.
  BodyImpulses take(const protocol::Impulses& totals);
  /// Step of the local model of the latest totals taken, 0 before.
  std::uint64_t step() const noexcept { return step_; }

 private:
  std::uint64_t step_ = 0;
  std::map<std::uint32_t, Vector6> taken_;  ///< Total of each body.
};

}  // namespace hlm
