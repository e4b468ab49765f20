// haptic_replay: plays a recorded stream of contact packets, into a running server or offline.
#include <algorithm>
#include <csignal>
#include <iostream>
#include <numbers>
#include <optional>
#include <stdexcept>

#include <spdlog/fmt/fmt.h>

#include "hlm/loop/tick_log.h"
#include "hlm/replay/energy_receipt.h"
#include "hlm/replay/live_replay.h"
#include "hlm/replay/offline_replay.h"
#include "hlm/replay/recorded_session.h"
#include "hlm/sealing/sealed_client_link.h"
#include "hlm/server/options.h"
#include "hlm/server/program.h"
#include "hlm/transport/udp_socket.h"

namespace hlm::server {
namespace {

volatile std::sig_atomic_t stop_requested = 0;

/// Live, an answer within these of the recorded one is the same: the updates arrive a step earlier
/// or later than they did.
constexpr double kSameDistance = 2e-3;                     // m.
constexpr double kSameAngle = 2 * std::numbers::pi / 180;  // rad.

struct ReplayOptions {
  std::string capture;
  std::string server = "127.0.0.1:47800";
  std::string key_file;  ///< The server's; empty: none.
  double speed = 1;
  int session = 0;  ///< From 1; 0: all of them.
  bool offline = false;
  bool receipt = false;  ///< Offline too.
  std::string ticks;     ///< Tick log to write, CSV; empty: none.
  PhysicsOptions physics;
};

std::vector<RecordedSession> chosen_sessions(const ReplayOptions& options) {
  std::vector<RecordedSession> sessions = read_sessions(options.capture);
  if (options.session == 0) return sessions;
  const auto count = static_cast<int>(sessions.size());
  if (options.session < 1 || options.session > count) {
    throw settings::UsageError("--session " + std::to_string(options.session) + " must be 1 to " +
                               std::to_string(count) + ": " + options.capture + " holds " +
                               std::to_string(count));
  }
  return {sessions[static_cast<std::size_t>(options.session - 1)]};
}

void warn(const std::string& text) { std::cerr << "haptic_replay: warning: " << text << '\n'; }

/// Whether all came back bit for bit.
bool run_offline(ReplayOptions& options) {
  PhysicsOptions& physics = options.physics;
  const std::unique_ptr<Device> device = physics.device.open(1 / physics.servo.rate);
  if (const auto lowered = suit_to(*device, physics)) warn(*lowered);
  const std::uint64_t own = fingerprint(physics, *device);
  // Nobody else drains the log, so it must hold what comes between two drains.
  TickLog log(options.ticks, 2, [](const TickRecord&) {});
  std::ostream& report = options.receipt ? std::cerr : std::cout;
  bool all_equal = true;
  for (const RecordedSession& session : chosen_sessions(options)) {
    if (!made_with(session.welcome.fingerprint, physics, *device)) {
      warn(
          "the session was recorded with other options than these: give the server's with "
          "--config");
    }
    std::optional<EnergyReceipt> receipt;
    if (options.receipt) receipt.emplace(std::cout);
    const OfflineResult result =
        replay_offline(session, physics.servo, own, *device, [&](const TickRecord& record) {
          if (stop_requested != 0) throw std::runtime_error("stopped by a signal");
          log.record(record);
          log.drain();
          if (receipt) receipt->observe(record);
        });
    report << "replay of session " << std::hex << session.id << std::dec << ": " << result.steps
           << " steps, " << result.equal << " of " << result.compared
           << " acknowledged states equal bit for bit";
    if (result.first_difference)
      report << ", first difference at step " << *result.first_difference;
    if (result.incomplete > 0) {
      report << ", " << result.incomplete << " updates not whole in the capture";
    }
    report << '\n';
    if (receipt) report << receipt->total();
    all_equal &= result.equal == result.compared;
  }
  log.close();
  return all_equal;
}

/// What must make the answers differ, known before the first of them.
void warn_of_differences(const RecordedSession& session, const protocol::Welcome& server,
                         double speed) {
  if (server.servo_rate != session.welcome.servo_rate) {
    warn(fmt::format("the server runs at {} Hz, the recorded one ran at {} Hz", server.servo_rate,
                     session.welcome.servo_rate));
  } else if (server.fingerprint != session.welcome.fingerprint) {
    warn("the server runs with other options or another hand than the recorded one");
  }
  if (speed != 1) {
    warn(
        fmt::format("at --speed {} the updates are not in step with the server's device and hand, "
                    "which keep their own pace",
                    speed));
  }
  if (!session.controls.empty()) {
    warn("what the live page asked for in this session is not sent");
  }
}

/// Reports one session's replay; whether its answers are the recorded ones.
bool report(const RecordedSession& session, const LiveResult& result) {
  std::cout << fmt::format(
      "{} of {} updates sent, {} states received, {} not whole in the capture, round trip {:.3f} "
      "ms\nproxy against the recorded one in {} states: {}; up to {} steps apart\n",
      result.sent, session.updates.size(), result.acknowledged, result.incomplete,
      1e3 * result.round_trip, result.compared, describe(result.proxy), result.steps_apart);
  if (result.compared == 0) {
    warn("no answer could be compared: neither capture nor server has any to the same update");
    return false;
  }
  const Drift& largest = result.proxy.largest;
  const bool same = largest.distance <= kSameDistance && largest.angle <= kSameAngle;
  if (!same) {
    warn(
        fmt::format("the server's answers are not the recorded ones: its proxy is up to {} away, "
                    "its steps up to {}",
                    describe(largest), result.steps_apart));
  }
  return same;
}

/// Whether the answers are the recorded ones.
bool run_live(const ReplayOptions& options) {
  const LiveOptions live{.server = resolve_option("--server", options.server),
                         .speed = options.speed};
  const std::optional<protocol::noise::Key> key = read_key_option(options.key_file);
  bool all_same = true;
  for (const RecordedSession& session : chosen_sessions(options)) {
    if (stop_requested != 0) break;
    protocol::UdpSocket socket(protocol::Endpoint{});
    protocol::DatagramLink* link = &socket;
    std::optional<protocol::SealedClientLink> sealed;
    if (key) link = &sealed.emplace(socket, live.server, *key);
    const auto compare_servers = [&](const protocol::Welcome& server) {
      warn_of_differences(session, server, options.speed);
    };
    const LiveResult result =
        replay_live(session, *link, live, compare_servers, [] { return stop_requested != 0; });
    all_same &= report(session, result);
    if (result.lost)
      throw std::runtime_error("server " + options.server + " ended the session or fell silent");
  }
  return all_same;
}

std::string footer() {
  return fmt::format(
      R"(Examples:
  haptic_replay run.pcap --server HOST:47800 --speed 2     into a running server
  haptic_replay run.pcap --offline --config server.toml    on the local model, here
  haptic_replay run.pcap --offline --config server.toml --device replay --device-option log=t.csv
                                                           the same, with the device of a tick log
  haptic_replay run.pcap --receipt --config server.toml    what the device gave to the hand and took

Exit codes: 0 played, and the answers are the recorded ones (offline bit for bit, otherwise the
proxy within {} mm and {} deg); 1 failed; 2 wrong usage or configuration; 3 other answers than
recorded.
)",
      1e3 * kSameDistance, 180 / std::numbers::pi * kSameAngle);
}

void add_replay_options(settings::CommandLine& command_line, ReplayOptions& options) {
  command_line.positional("CAPTURE", options.capture, "Capture file, pcap or pcapng");
  settings::Table& table = command_line.table();
  table.group("Replay");
  table.flag("offline", options.offline,
             "Run the server's tick here and compare with the recorded proxy states");
  table.flag("receipt", options.receipt,
             "Offline: write what the device port gave and took between updates to standard "
             "output, CSV, and the total to standard error");
  table.text("server", options.server, "HOST:PORT", "Running server");
  table.file("key-file", options.key_file, "The server's key, if it has one");
  table.number("speed", options.speed, {1e-3, 1e3}, "Times the original pace");
  table.whole("session", options.session, {0, 1e6},
              "Which session of the capture, from 1; 0 is all");
  table.file("ticks", options.ticks, "Offline: write every tick's signals here, CSV");
  add_options(command_line, options.physics);
  // The server's own file says more than what shapes the physics.
  command_line.ignore_unknown_keys();
}

}  // namespace
}  // namespace hlm::server

int main(int argc, char** argv) {
  using namespace hlm;
  server::ReplayOptions options;
  settings::CommandLine command_line(
      {.name = "haptic_replay",
       .purpose = "Plays a recorded stream of contact packets into a running server, or, with "
                  "--offline, on the local model in virtual time.",
       .footer = server::footer()});
  server::add_replay_options(command_line, options);
  return server::run_program(
      "haptic_replay", command_line, options.physics, argc, argv,
      [&] { server::check(options.physics); },
      [&] {
        server::handle_signals([](int) { server::stop_requested = 1; });
        const bool same = options.offline || options.receipt ? server::run_offline(options)
                                                             : server::run_live(options);
        return same ? server::kOk : server::kDiffers;
      });
}
