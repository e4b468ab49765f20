// ve_client: the virtual environment as a process.
#include <algorithm>
#include <csignal>
#include <iostream>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include "protocol/capture.h"
#include "protocol/recording_link.h"
#include "protocol/udp_socket.h"
#include "ve_client/frame.h"
#include "ve_client/settings.h"
#include "ve_client/status.h"
#include "ve_client/world/sdf_loader.h"

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

HapticClientOptions client_options(const Settings& settings, const VirtualEnvironment& environment,
                                   const protocol::Endpoint& server) {
  std::random_device random;
  HapticClientOptions options;
  options.server = server;
  options.tool = environment.assembly.description;
  options.q = environment.assembly.q;
  options.ve_rate = (settings.rate_low + settings.rate_high) / 2;
  options.epsilon = settings.frame.epsilon;
  options.nonce = (static_cast<std::uint64_t>(random()) << 32) | random();
  return options;
}

/// A capture file and the link whose datagrams it gets.
struct Recording {
  Recording(const std::string& path, protocol::UdpSocket& socket)
      : file(path), link(socket, socket.local()) {}

  protocol::CaptureWriter file;
  protocol::RecordingLink link;
};

/// Frames at their rate until the end is asked for.
void run(const Settings& settings, VirtualEnvironment& environment, HapticClient& client,
         Recording* recording) {
  SteadyClock clock;
  FramePeriods periods(settings.rate_low, settings.rate_high, settings.seed);
  Connection connection(settings.server, settings.connect_timeout);
  Status status;
  double next = clock.now();
  while (!stop_requested && (settings.duration == 0 || clock.now() < settings.duration)) {
    const double period = periods.next();
    const FrameResult frame = run_frame(environment, client, clock, period, settings.frame);
    connection.watch(clock.now(), frame.inbox, client.connected());
    status.count(frame);
    status.report(clock.now(), client, environment.proximity.statistics());
    if (recording) recording->link.drain(recording->file);
    // After an overrun the next frame starts at once; what was missed is not made up for.
    next = std::max(next + period, clock.now());
    clock.sleep_until(next);
  }
  client.close(clock.now());
  if (recording) recording->link.drain(recording->file);
}

void run_client(const Settings& settings) {
  configure_logging(settings.log_level);
  install_signal_handlers();
  VirtualEnvironment environment(load_world(settings.world), settings.tool, settings.follow);
  const protocol::Endpoint server = protocol::resolve(settings.server);
  protocol::UdpSocket socket(protocol::Endpoint{});
  std::optional<Recording> recording;
  if (!settings.record.empty()) recording.emplace(settings.record, socket);
  protocol::DatagramLink& link =
      recording ? static_cast<protocol::DatagramLink&>(recording->link) : socket;
  HapticClient client(link, client_options(settings, environment, server));
  run(settings, environment, client, recording ? &*recording : nullptr);
}

}  // namespace
}  // namespace hlm::ve

int main(int argc, char** argv) {
  const hlm::ve::ParsedArguments arguments = hlm::ve::parse_arguments(argc, argv);
  if (!arguments.settings) return arguments.exit_code;
  try {
    hlm::ve::run_client(*arguments.settings);
  } catch (const std::exception& error) {
    std::cerr << "ve_client: " << error.what() << '\n';
    return 1;
  }
  return 0;
}
