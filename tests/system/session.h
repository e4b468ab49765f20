// Real programs in a session, for tests of how they are operated.
#pragma once

#include <string>
#include <vector>

#include "tests/system/process.h"

namespace hlm::test {

using Arguments = std::vector<std::string>;
Arguments operator+(Arguments a, const Arguments& b);

/// A vendor's device. A sigma.7 has about the longest watchdog that it takes: a machine that stalls
/// for 16 ms is no matter here.
Arguments device_of(const std::string& name);

std::string loopback(int port);
/// haptic_server there at 500 Hz, which endures pauses of the machine of up to 1 s.
Arguments server_command(int port);
/// ve_client there with the paper's testbed.
Arguments client_command(int port);
/// Writes a hand script that pushes with `force` N along +y for ever, which is against the
/// testbed's wall, and returns the server's options for it.
Arguments pushing_hand(const TemporaryDirectory& directory, double force);

}  // namespace hlm::test
