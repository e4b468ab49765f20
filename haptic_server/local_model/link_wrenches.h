// External wrenches on the links of the tool, in the step of the proxy (docs/method.md 19).
#pragma once

#include <limits>

#include "hlm/common/static_vector.h"
#include "hlm/haptic_server/local_model/model_update.h"
#include "hlm/haptic_server/local_model/wrench_field.h"

namespace hlm::server {

class LinkWrenches {
 public:
  explicit LinkWrenches(const ToolDescription& tool) noexcept
      : fields_(tool.links.size(), WrenchField(tool.length)) {}

  /// They act with this force at most, N.
  void bound(double most) noexcept { most_ = most; }
  /// What an update reports, of a link without a wrench, too: what the first one changes by tells
  /// how it depends on the motion. tool: at the update's configuration.
  void adopt(const ModelUpdate& update, const ToolModel& tool) noexcept;
  /// A step of dt, s, begins with the proxy's velocity v: adds what acts on it to E v⁺ = r.
  void begin_step(const ToolModel& proxy, const Velocity& v, double dt, MassMatrix& E,
                  GeneralisedForce& r) noexcept;
  /// What acted in it, on the proxy that has its velocity of the step's end and is still where it
  /// began.
  GeneralisedForce end_step(const ToolModel& proxy, const Velocity& v, double dt) noexcept;

 private:
  StaticVector<WrenchField, kMaxLinks> fields_;  ///< Of each link.
  double most_ = std::numeric_limits<double>::infinity();
};

}  // namespace hlm::server
