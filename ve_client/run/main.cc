// ve_client: the virtual environment as a process.
#include <csignal>
#include <iostream>
#include <stdexcept>
#include <string>

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include "hlm/common/one_line.h"
#include "hlm/common/settings/table.h"
#include "hlm/ve_client/run/check.h"
#include "hlm/ve_client/run/client_run.h"
#include "hlm/ve_client/run/settings.h"

namespace hlm::ve {
namespace {

volatile std::sig_atomic_t stop_requested = 0;

void request_stop(int) { stop_requested = 1; }

void install_signal_handlers() {
  struct sigaction action {};
  action.sa_handler = request_stop;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  // A terminal that closes; under nohup it stays ignored.
  struct sigaction before {};
  sigaction(SIGHUP, nullptr, &before);
  if (before.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);
}

void configure_logging(const std::string& level) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("ve_client"));
  spdlog::set_pattern("%H:%M:%S.%e ve_client %^%l%$: %v");
  spdlog::set_level(spdlog::level::from_str(level == "warn" ? "warning" : level));
}

/// Exit codes as the help's footer has them, with settings::kUsageError.
enum ExitCode { kFinished = 0, kFailed = 1, kServerNeverAnswered = 3 };

int failure(const std::exception& error, int exit_code) {
  std::cerr << "ve_client: " << one_line(error.what()) << '\n';
  return exit_code;
}

}  // namespace
}  // namespace hlm::ve

int main(int argc, char** argv) {
  using namespace hlm::ve;
  const ParsedArguments arguments = parse_arguments(argc, argv);
  if (!arguments.settings) return arguments.exit_code;
  try {
    configure_logging(arguments.settings->log_level);
    if (arguments.settings->check) {
      return check_scene(*arguments.settings, std::cout) ? kFinished : hlm::settings::kUsageError;
    }
    // Until then a signal ends the program at once: there is no session that it would close.
    ClientRun run(*arguments.settings);
    install_signal_handlers();
    run.go([] { return stop_requested != 0; });
  } catch (const hlm::settings::UsageError& error) {
    return failure(error, hlm::settings::kUsageError);
  } catch (const NeverAnswered& error) {
    return failure(error, kServerNeverAnswered);
  } catch (const std::exception& error) {
    return failure(error, kFailed);
  }
  return kFinished;
}
