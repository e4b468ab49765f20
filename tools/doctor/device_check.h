// haptic_doctor device: a person's first minutes with a device.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "hlm/haptic_server/device/device_choice.h"
#include "hlm/tools/doctor/finding.h"
#include "hlm/tools/doctor/push_examination.h"
#include "hlm/tools/doctor/running_server.h"

namespace hlm::server {

struct DeviceCheckOptions {
  double rate = 1000;                        ///< Hz.
  int priority = 40;                         ///< SCHED_FIFO, where it is granted.
  double max_gap = 0.25;                     ///< Between two ticks, s.
  std::string world_axes = "right away up";  ///< Axes as Outlook takes them; must be valid.
  std::optional<double> push{};       ///< Largest force of a push, N; empty: a tenth of the rating.
  double force_limit = kPushes.most;  ///< No push has more, N: the server's own.
};

/// Opens the device as the server does, motors off, and examines in this order: what it says of
/// itself; a handle that rests; its frame, as a person moves it; its force, by small pushes, after
/// that person's consent. What is wrong, or was not done, ends it before the next step, and is
/// said. Answers come from standard input; without any, the handle at rest is all. Throws
/// settings::UsageError for a recording, and std::runtime_error while a server runs.
std::vector<Examination> check_device(const DeviceChoice& choice, const DeviceCheckOptions& options,
                                      const std::optional<RunningServer>& running);

}  // namespace hlm::server
