// What the server's programs have in common: how they end.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "hlm/common/settings/command_line.h"
#include "hlm/haptic_server/options.h"
#include "hlm/protocol/datagram_link.h"
#include "hlm/protocol/sealing/noise.h"

namespace hlm::server {

/// Exit status of a program.
enum ExitStatus {
  kOk = 0,
  kFailed = 1,  ///< A file, a socket or a right was refused, or the program could not go on.
  kUsage =
      settings::kUsageError,  ///< An option or the configuration file is wrong; nothing was begun.
  kDiffers = 3,  ///< A replay came to its end, and its answers are not the recorded ones.
  kProblem = 4,  ///< haptic_doctor found one.
};

/// Reads the command line and returns what `body` returns, or prints what --device list and
/// --device-help ask for. Errors become one line on standard error and their exit status. `check`:
/// as for CommandLine::parse().
int run_program(const char* name, settings::CommandLine& command_line,
                const PhysicsOptions& options, int argc, const char* const* argv,
                const std::function<void()>& check, const std::function<int()>& body);

/// The endpoint that an option's value names. Throws UsageError with what is wrong.
protocol::Endpoint resolve_option(const std::string& option, const std::string& host_port);

/// The key in the file of --key-file; none without a file. Throws UsageError.
std::optional<protocol::noise::Key> read_key_option(const std::string& path);

/// SIGHUP, SIGINT, SIGQUIT and SIGTERM call `stop`, which must be async-signal-safe; except that a
/// hang-up stays ignored where it was (nohup). A closed pipe and a file at its size limit become
/// errors of the write concerned.
void handle_signals(void (*stop)(int));

}  // namespace hlm::server
