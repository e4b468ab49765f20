// A contact of the tool while its bodies move on.
#pragma once

#include "hlm/common/spatial.h"

namespace hlm::ve {

/// A contact of the tool, present or within reach of the next step.
struct ToolContact {
  int tool_body = 0;
  int body = 0;
  Vector3 p_W = Vector3::Zero();   ///< m.
  Vector3 n_W = Vector3::UnitZ();  ///< Unit, from `body` to the tool.
  double separation = 0;           ///< σ, m.
  double friction = 0;             ///< μ.
};

/// A contact of the tool that stays with the surfaces of its two bodies, and keeps its normal in
/// that of the other body.
class CarriedContact {
 public:
  /// The bodies' poses when the contact is as given.
  CarriedContact(const ToolContact& contact, const Pose& X_WTool, const Pose& X_WB)
      : contact_(contact),
        p_tool_(X_WTool.inverse() * (contact.p_W + contact.separation * contact.n_W)),
        p_B_(X_WB.inverse() * contact.p_W),
        n_B_(X_WB.R.conjugate() * contact.n_W) {}

  /// The contact in other poses.
  ToolContact at(const Pose& X_WTool, const Pose& X_WB) const {
    ToolContact present = contact_;
    present.p_W = X_WB * p_B_;
    present.n_W = X_WB.R * n_B_;
    present.separation = present.n_W.dot(X_WTool * p_tool_ - present.p_W);
    return present;
  }

  int tool_body() const { return contact_.tool_body; }
  int body() const { return contact_.body; }

 private:
  ToolContact contact_;
  Vector3 p_tool_;  ///< The tool's point, in its body.
  Vector3 p_B_;     ///< The other body's, in that.
  Vector3 n_B_;
};

}  // namespace hlm::ve
