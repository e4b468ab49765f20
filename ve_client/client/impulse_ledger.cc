#include "ve_client/client/impulse_ledger.h"

namespace hlm {

void ImpulseLedger::reset() {
  step_ = 0;
  taken_.clear();
}

BodyImpulses ImpulseLedger::take(const protocol::Impulses& totals) {
  step_ = totals.step;
  BodyImpulses impulses;
  for (const auto& [body, P_W] : totals.bodies) {
    Vector6& taken = taken_.try_emplace(body, Vector6::Zero()).first->second;
    impulses.push_back({body, P_W - taken});
    taken = P_W;
  }
  return impulses;
}

}  // namespace hlm
