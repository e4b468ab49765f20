// Can this machine tick at the wanted rate?
#pragma once

#include <optional>

#include "hlm/tools/doctor/finding.h"
#include "hlm/tools/doctor/running_server.h"

namespace hlm::server {

struct MachineOptions {
  double rate = 1000;    ///< Hz.
  int priority = 40;     ///< SCHED_FIFO priority.
  double loop_time = 3;  ///< How long the loop is tested, s.
};

/// Rights, kernel, clocks and idle states, and a loop at the wanted rate; while a server has a
/// session, in place of that its own loop, which nothing must disturb.
Examination examine_machine(const MachineOptions& options,
                            const std::optional<RunningServer>& running);

}  // namespace hlm::server
