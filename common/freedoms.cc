#include "hlm/common/freedoms.h"

namespace hlm {
namespace {

/// The axes of three bits, "x, z"; empty for none.
std::string axes(unsigned bits) {
  std::string text;
  for (unsigned i = 0; i < 3; ++i) {
    if ((bits >> i & 1u) != 0) text += (text.empty() ? "" : ", ") + std::string(1, "xyz"[i]);
  }
  return text;
}

}  // namespace

Freedoms freedoms_of(const ToolModel& tool) noexcept {
  /// m or 1: below this a direction is there through rounding alone.
  constexpr double kRounding = 1e-9;
  const Jacobian J_h = tool.hand_jacobian();
  unsigned freedoms = 0;
  for (int i = 0; i < 6; ++i) {
    if (J_h.row(i).cwiseAbs().maxCoeff() > kRounding) freedoms |= 1u << i;
  }
  return static_cast<Freedoms>(freedoms);
}

std::string describe_mismatch(Freedoms missing) {
  const std::string along = axes(missing & 7u);
  const std::string about = axes(missing >> 3u & 7u);
  std::string text = "tool and device do not match: the tool also moves ";
  if (!along.empty()) text += "along " + along;
  if (!along.empty() && !about.empty()) text += " and ";
  if (!about.empty()) text += "about " + about;
  return text + ", the device does not";
}

}  // namespace hlm
