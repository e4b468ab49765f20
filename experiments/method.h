// The methods that are compared, by name.
#pragma once

#include <limits>
#include <optional>
#include <string_view>

#include "hlm/common/methods.h"
#include "hlm/haptic_server/report/tick_record.h"

namespace hlm::protocol {
struct LinkConditions;
}  // namespace hlm::protocol
namespace hlm::test {
class VirtualSession;
struct VirtualSessionOptions;
}  // namespace hlm::test

namespace hlm::experiments {

/// Throws std::runtime_error naming the methods there are.
const Method& method(std::string_view name);

/// Whether the hand feels the engine's own tool by a spring, and no contacts.
bool couples_engine(const Method& method);

/// What server and client do with this method. Contacts, or without them the spring to the engine's
/// tool, have this stiffness (N/m) and damping (N·s/m).
void use(const Method& method, double stiffness, double damping,
         test::VirtualSessionOptions& options);

/// What a hand feels of the world: of the contacts or of the spring to the engine's tool. Without a
/// method: of the contacts.
const Wrench& felt(const std::optional<Method>& method, const server::TickRecord& record);

/// A time in which all that is sent is lost.
struct Outage {
  double begin = std::numeric_limits<double>::infinity();  ///< s, of the hand's time.
  double duration = 0.3;                                   ///< s.
};
/// Begins and ends an outage. After each tick.
void cut(const Outage& outage, const server::TickRecord& record,
         const protocol::LinkConditions& otherwise, test::VirtualSession& session);

}  // namespace hlm::experiments
