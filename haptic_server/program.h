// What the server's programs have in common: how they end.
#pragma once

#include <functional>
#include <string>

#include <CLI/CLI.hpp>

#include "protocol/datagram_link.h"

namespace hlm::server {

/// Exit status of a program.
enum ExitStatus {
  kOk = 0,
  kFailed = 1,   ///< A file, a socket or a right was refused, or the program could not go on.
  kUsage = 2,    ///< An option or the configuration file is wrong; nothing was begun.
  kDiffers = 3,  ///< A replay came to its end, and its answers are not the recorded ones.
};

/// Parses the command line and returns what `body` returns. Errors become one line on standard
/// error and their exit status; `body` throws CLI::ValidationError for those of the options.
int run_program(const char* name, CLI::App& app, int argc, char** argv,
                const std::function<int()>& body);

/// The endpoint that an option names. Throws CLI::ValidationError with what is wrong.
protocol::Endpoint resolve_option(const std::string& host_port);

/// SIGHUP, SIGINT, SIGQUIT and SIGTERM call `stop`, which must be async-signal-safe; except that a
/// hang-up stays ignored where it was (nohup). A closed pipe and a file at its size limit become
/// errors of the write concerned.
void handle_signals(void (*stop)(int));

}  // namespace hlm::server
