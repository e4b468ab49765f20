// How a hand script is read from a TOML file.
//
//   after = "hold"                # "release" (default), "hold" or "repeat"
//
//   [grip]                        # of every move_to below that does not say otherwise
//   stiffness = 200               # N/m
//
//   [[segment]]
//   duration = 2.0                # s
//   move_to = { position = [0.1, 0, 0], rotation = [0, 0, 1.57] }   # m; rotation vector, rad
//   grip = { stiffness = 400 }    # the other keys as in the file's [grip]
//
//   [[segment]]
//   duration = 8.0
//   opening = 0.2                 # of the device's gripper, 0 closed to 1 open; it stays otherwise
//   wrench = { force = [0, 0.5, 0], force_amplitude = [1, 0, 0], frequency = 2.5 }   # N, Hz
#pragma once

#include <string>

#include "hlm/haptic_server/device/hand.h"

namespace hlm::server {

/// Reads a script. Throws std::runtime_error with one line that names the file, its line, the
/// segment (from 1), the key, its value and what is allowed.
HandScript read_hand_script(const std::string& path);

}  // namespace hlm::server
