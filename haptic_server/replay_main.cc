// haptic_replay: plays a recorded stream of contact packets, into a running server or offline.
#include <algorithm>
#include <csignal>
#include <iostream>
#include <stdexcept>

#include "haptic_server/loop/tick_log.h"
#include "haptic_server/options.h"
#include "haptic_server/replay/live_replay.h"
#include "haptic_server/replay/offline_replay.h"
#include "haptic_server/replay/recorded_session.h"
#include "protocol/transport/udp_socket.h"

namespace hlm::server {
namespace {

volatile std::sig_atomic_t stop_requested = 0;

void request_stop(int) { stop_requested = 1; }

struct ReplayOptions {
  std::string capture;
  std::string server = "127.0.0.1:47800";
  double speed = 1;
  int session = 0;  ///< From 1; 0: all of them.
  bool offline = false;
  std::string ticks;  ///< Tick log to write, CSV; empty: none.
  PhysicsOptions physics;
};

std::vector<RecordedSession> chosen_sessions(const ReplayOptions& options) {
  std::vector<RecordedSession> sessions = read_sessions(options.capture);
  if (options.session == 0) return sessions;
  const auto count = static_cast<int>(sessions.size());
  if (options.session < 1 || options.session > count) {
    throw std::runtime_error("--session " + std::to_string(options.session) + " must be 1 to " +
                             std::to_string(count) + ": " + options.capture + " holds " +
                             std::to_string(count));
  }
  return {sessions[static_cast<std::size_t>(options.session - 1)]};
}

/// Exit code: 0 if all came back bit for bit.
int run_offline(const ReplayOptions& options) {
  const PhysicsOptions& physics = options.physics;
  const std::uint64_t configuration = fingerprint(physics);
  const std::unique_ptr<Device> device = make_device(physics);
  // Nobody else drains the log, so it must hold what comes between two drains.
  TickLog log(options.ticks, 2, [](const TickRecord&) {});
  bool all_equal = true;
  for (const RecordedSession& session : chosen_sessions(options)) {
    if (session.welcome.configuration != configuration) {
      std::cerr << "haptic_replay: warning: the session was recorded with other options than these:"
                   " give the server's with --config\n";
    }
    const OfflineResult result = replay_offline(session, physics.servo, configuration, *device,
                                                [&](const TickRecord& record) {
                                                  log.record(record);
                                                  log.drain();
                                                });
    std::cout << "replay of session " << std::hex << session.id << std::dec << ": " << result.steps
              << " steps, " << result.equal << " of " << result.compared
              << " acknowledged states equal bit for bit";
    if (result.first_difference)
      std::cout << ", first difference at step " << *result.first_difference;
    std::cout << '\n';
    all_equal &= result.equal == result.compared;
  }
  log.close();
  return all_equal ? 0 : 1;
}

int run_live(const ReplayOptions& options) {
  const LiveOptions live{.server = protocol::resolve(options.server), .speed = options.speed};
  for (const RecordedSession& session : chosen_sessions(options)) {
    protocol::UdpSocket socket(protocol::Endpoint{});
    const LiveResult result =
        replay_live(session, socket, live, [] { return stop_requested != 0; });
    std::cout << result.sent << " of " << session.updates.size() << " updates sent, "
              << result.acknowledged << " states received, " << result.incomplete
              << " not whole in the capture, round trip " << 1e3 * result.round_trip << " ms\n";
  }
  return 0;
}

}  // namespace
}  // namespace hlm::server

int main(int argc, char** argv) {
  using namespace hlm::server;
  ReplayOptions options;
  CLI::App app(
      "Plays a recorded stream of contact packets (pcap or pcapng) into a running server, or, with "
      "--offline, on the local model in virtual time.");
  app.add_option("capture", options.capture, "Capture file")->required();
  app.add_flag("--offline", options.offline,
               "Run the server's tick here and compare with the recorded proxy states");
  app.add_option("--server", options.server, "Running server, HOST:PORT")->capture_default_str();
  app.add_option("--speed", options.speed, "Times the original pace")
      ->check(CLI::Range(1e-3, 1e3))
      ->capture_default_str();
  app.add_option("--session", options.session, "Which session of the capture, from 1; 0: all")
      ->capture_default_str();
  app.set_config("--config", "", "The server's configuration file");
  app.add_option("--ticks", options.ticks, "Offline: write every tick's signals here (CSV)");
  add_options(app, options.physics);
  // The server's own file says more than what shapes the physics.
  app.allow_config_extras(CLI::config_extras_mode::ignore_all);
  try {
    app.parse(argc, argv);
    if (const auto error = find_error(options.physics)) throw std::runtime_error(*error);
    struct sigaction action {};
    action.sa_handler = request_stop;
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
    return options.offline ? run_offline(options) : run_live(options);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    std::cerr << "haptic_replay: " << error.what() << '\n';
    return error.get_exit_code();
  } catch (const std::exception& error) {
    std::cerr << "haptic_replay: " << error.what() << '\n';
    return 1;
  }
}
