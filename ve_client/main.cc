// ve_client: the virtual environment as a process.
#include <csignal>
#include <iostream>
#include <stdexcept>
#include <string>

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include "ve_client/client_run.h"
#include "ve_client/settings.h"

namespace hlm::ve {
namespace {

volatile std::sig_atomic_t stop_requested = 0;

void request_stop(int) { stop_requested = 1; }

void install_signal_handlers() {
  struct sigaction action {};
  action.sa_handler = request_stop;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

void configure_logging(const std::string& level) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("ve_client"));
  spdlog::set_pattern("%H:%M:%S.%e ve_client %^%l%$: %v");
  spdlog::set_level(spdlog::level::from_str(level == "warn" ? "warning" : level));
}

}  // namespace
}  // namespace hlm::ve

int main(int argc, char** argv) {
  const hlm::ve::ParsedArguments arguments = hlm::ve::parse_arguments(argc, argv);
  if (!arguments.settings) return arguments.exit_code;
  try {
    hlm::ve::configure_logging(arguments.settings->log_level);
    hlm::ve::install_signal_handlers();
    hlm::ve::ClientRun(*arguments.settings).go([] { return hlm::ve::stop_requested != 0; });
  } catch (const std::exception& error) {
    std::cerr << "ve_client: " << error.what() << '\n';
    return 1;
  }
  return 0;
}
