// How does a device measure a handle that rests? And at what rate one that moves?
#pragma once

#include <vector>

#include "hlm/tools/doctor/device_bench.h"
#include "hlm/tools/doctor/finding.h"

namespace hlm::server {

/// What a handle at rest shows.
struct RestFigures {
  double noise = 0;  ///< Noise of the position, rms of its distance from the mean, m.
  std::vector<Finding> findings;
};

/// Watches the handle for two seconds without force. Throws BenchEnded.
RestFigures examine_rest(DeviceBench& bench, Person& person);

/// What all runs together showed: rate of new states, missed ticks, health, buttons, gripper.
std::vector<Finding> examine_exchange(const DeviceBench& bench);

}  // namespace hlm::server
