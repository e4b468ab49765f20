// What drives a joint of the tool, such as the servo of a gripper (docs/method.md 22).
#pragma once

#include <cstdint>
#include <optional>

#include "hlm/common/static_vector.h"
#include "hlm/common/tool_description.h"

namespace hlm {

/// A spring and damper to `target`, of limited force, on the coordinate q of a joint that has one.
/// In rad and N·m, or m and N, as q is.
struct JointDrive {
  std::uint8_t link = 0;        ///< Whose joint: revolute, prismatic or guided.
  bool follows_device = false;  ///< The gripper of the device leads, between closed and open.
  double target = 0;            ///< q that it goes to otherwise, or where the device has none.
  double closed = 0;            ///< q of the closed gripper,
  double open = 0;              ///< and of the open one.
  double stiffness = 0;         ///< >= 0.
  double damping = 0;           ///< >= 0.
  double most = 0;              ///< Largest force, >= 0.

  bool operator==(const JointDrive&) const = default;
};

/// At most one for each coordinate.
using JointDrives = StaticVector<JointDrive, kMaxDof>;

/// Of stiffness, damping and force, with m or rad, N or N·m.
inline constexpr double kLargestDrive = 1e9;

/// Why drives cannot be those of a tool, naming the link, the value and what is allowed; empty if
/// they can. Allocates nothing.
std::optional<Sentence> find_error(const JointDrives& drives, const ToolDescription& tool);

}  // namespace hlm
