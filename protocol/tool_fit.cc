#include "protocol/tool_fit.h"

#include <algorithm>
#include <cmath>

#include "common/range.h"
#include "protocol/wire.h"

namespace hlm::protocol {

bool fits(const ToolDescription& tool, const Configuration& q) noexcept {
  if (q.size() != tool.configuration_size() || !q.allFinite()) return false;
  if (tool.links.front().joint != JointType::kFree) return true;
  constexpr int kQuaternion = 3;  // After the position.
  return std::abs(q.segment<4>(kQuaternion).norm() - 1) <= kUnitTolerance;
}

bool fits(const ToolDescription& tool, const ContactUpdate& update) noexcept {
  if (!fits(tool, update.q_VE) || update.v_VE.size() != tool.dof()) return false;
  return std::ranges::all_of(update.contacts, [&](const ReportedContact& contact) {
    return contact.key.link < tool.links.size();
  });
}

bool fits(const ToolDescription& tool, const ProxyState& state) noexcept {
  return fits(tool, state.q) && state.v.size() == tool.dof();
}

std::optional<std::string> find_error(const Hello& hello) {
  if (auto error = find_error(hello.tool)) return error;
  if (hello.q.size() != hello.tool.configuration_size()) {
    return "initial configuration has " + std::to_string(hello.q.size()) +
           " coordinates; the tool has " + std::to_string(hello.tool.configuration_size());
  }
  if (!fits(hello.tool, hello.q)) {
    return "initial configuration must be finite and its quaternion of length 1";
  }
  if (auto error = find_error("VE rate", hello.ve_rate, above_zero("Hz"))) return error;
  return find_error("epsilon", hello.epsilon, from_zero("m"));
}

}  // namespace hlm::protocol
