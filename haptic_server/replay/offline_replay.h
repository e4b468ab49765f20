// A recorded session on the server's own tick, in virtual time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>

#include "hlm/device/device.h"
#include "hlm/loop/servo.h"
#include "hlm/replay/recorded_session.h"

namespace hlm::server {

struct OfflineResult {
  std::uint64_t steps = 0;   ///< Of the session.
  std::size_t compared = 0;  ///< Acknowledged states.
  std::size_t equal = 0;     ///< Of these, bit for bit as recorded.
  /// Acknowledged updates that the capture does not hold whole: not played.
  std::size_t incomplete = 0;
  /// Step of the first state that differs.
  std::optional<std::uint64_t> first_difference;
};

/// Plays each update at the step that adopted it when it was recorded, and compares the proxy's
/// state in each acknowledgement. `options`, `fingerprint` and `device` must be as in the
/// recording. observe: called with every tick's record.
OfflineResult replay_offline(const RecordedSession& session, const ServoOptions& options,
                             std::uint64_t fingerprint, Device& device,
                             const std::function<void(const TickRecord&)>& observe);

}  // namespace hlm::server
