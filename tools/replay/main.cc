// haptic_replay: plays a recorded stream of contact packets, into a running server or offline.
#include <algorithm>
#include <cmath>
#include <csignal>
#include <deque>
#include <iostream>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include <spdlog/fmt/fmt.h>

#include "hlm/haptic_server/options.h"
#include "hlm/haptic_server/program.h"
#include "hlm/haptic_server/report/tick_log.h"
#include "hlm/protocol/sealing/sealed_client_link.h"
#include "hlm/protocol/transport/udp_socket.h"
#include "hlm/tools/replay/energy_receipt.h"
#include "hlm/tools/replay/live_replay.h"
#include "hlm/tools/replay/offline_replay.h"
#include "hlm/tools/replay/recorded_session.h"
#include "hlm/tools/replay/signal_stream.h"

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
  int session = 0;  ///< Number of the session, from 1; 0: all of them.
  bool offline = false;
  bool receipt = false;   ///< Offline too.
  bool simulate = false;  ///< Offline, the configured device instead of the recorded one.
  std::string ticks;      ///< Tick log to write, CSV; empty: none.
  std::string
      signals;  ///< Stream of signals and contacts to write; empty: none; "-": to standard output.
  double late = 0;  ///< Offline, by how much later everything comes from the client, s.
  PhysicsOptions physics;
};

settings::UsageError no_such_session(const ReplayOptions& options, std::size_t count) {
  return settings::UsageError("--session " + std::to_string(options.session) + " must be 1 to " +
                              std::to_string(count) + ": " + options.capture + " holds " +
                              std::to_string(count));
}

std::vector<RecordedSession> chosen_sessions(const ReplayOptions& options) {
  std::vector<RecordedSession> sessions = read_sessions(options.capture);
  if (options.session == 0) return sessions;
  const auto index = static_cast<std::size_t>(options.session - 1);
  if (index >= sessions.size()) throw no_such_session(options, sessions.size());
  return {sessions[index]};
}

/// Throws settings::UsageError.
void refuse_without_offline(const ReplayOptions& options) {
  if (options.offline || options.receipt) return;
  if (!options.signals.empty())
    throw settings::UsageError("--signals " + options.signals + " needs --offline");
  if (options.late > 0) throw settings::UsageError("--late needs --offline");
}

void warn(const std::string& text) { std::cerr << "haptic_replay: warning: " << text << '\n'; }

/// Where an offline replay's ticks go.
class OfflineOutput {
 public:
  explicit OfflineOutput(const ReplayOptions& options)
      // Nobody else drains the log, so it must hold what comes between two drains.
      : log_(options.ticks, 2, [](const TickRecord&) {}),
        with_receipt_(options.receipt),
        takes_output_(options.receipt || options.signals == "-") {
    if (!options.signals.empty()) signals_.emplace(options.signals, 1 / options.physics.servo.rate);
  }

  void observe(const TickRecord& record, const Servo& servo) {
    if (stop_requested != 0) throw std::runtime_error("stopped by a signal");
    log_.record(record);
    log_.drain();
    if (signals_) signals_->observe(record, servo);
    if (!with_receipt_ || record.step == 0) return;
    if (receipts_.empty() || receipts_.back().first != record.session) {
      receipts_.emplace_back(record.session, std::cout);
    }
    receipts_.back().second.observe(record);
  }

  void report(const OfflineResult& result) const {
    std::ostream& report = takes_output_ ? std::cerr : std::cout;
    report << "replay of session " << std::hex << result.session << std::dec << ": " << result.steps
           << " steps, " << result.equal << " of " << result.compared
           << " acknowledged states equal bit for bit";
    if (result.first_difference)
      report << ", first difference at step " << *result.first_difference;
    if (result.incomplete > 0)
      report << ", the capture lacks " << result.incomplete << " datagrams";
    report << '\n';
    if (!result.missing_scene.empty()) report << "cannot be made: " << result.missing_scene << '\n';
    for (const auto& [session, receipt] : receipts_) {
      if (session == result.session) report << receipt.total();
    }
  }

  void close() {
    log_.close();
    if (signals_) signals_->close();
  }

 private:
  TickLog log_;
  std::optional<SignalStream> signals_;
  bool with_receipt_;
  bool takes_output_;  ///< Standard output is not for reports.
  std::deque<std::pair<std::uint64_t, EnergyReceipt>> receipts_;  ///< Receipts by session.
};

void warn_of_other_options(std::uint64_t recorded, std::uint64_t own) {
  if (recorded == own) return;
  warn("the session was recorded with other options than these: give the server's with --config");
}

/// Throws settings::UsageError.
std::uint64_t late_periods(const ReplayOptions& options) {
  const double periods = options.late * options.physics.servo.rate;
  const double whole = std::round(periods);
  if (std::abs(periods - whole) < 1e-6) return static_cast<std::uint64_t>(whole);
  throw settings::UsageError(fmt::format("--late {} must be whole periods of the loop, {} s each",
                                         options.late, 1 / options.physics.servo.rate));
}

/// What haptic_server --record has written, with the device as it was.
std::vector<OfflineResult> replay(Recording& recording, ReplayOptions& options,
                                  OfflineOutput& output) {
  PhysicsOptions& physics = options.physics;
  const RecordedDevice recorded(recording.device());
  std::unique_ptr<Device> instead;
  if (options.simulate) instead = physics.device.open(1 / physics.servo.rate);
  const Device& device = instead ? *instead : static_cast<const Device&>(recorded);
  suit_to(device, physics);  // The server did so, and said it.
  const std::uint64_t own = fingerprint(physics, device);
  std::vector<OfflineResult> results = replay_offline(
      recording, physics.servo, own, instead.get(),
      [&](const TickRecord& record, const Servo& servo) { output.observe(record, servo); },
      late_periods(options));
  for (const OfflineResult& result : results) warn_of_other_options(result.fingerprint, own);
  if (options.session == 0) return results;
  const auto index = static_cast<std::size_t>(options.session - 1);
  if (index >= results.size()) throw no_such_session(options, results.size());
  return {results[index]};
}

/// What others have captured, with the configured device.
std::vector<OfflineResult> replay_capture(ReplayOptions& options, OfflineOutput& output) {
  PhysicsOptions& physics = options.physics;
  const std::vector<RecordedSession> sessions = chosen_sessions(options);
  if (options.late > 0) {
    throw settings::UsageError("--late must be 0 with a capture that no server has recorded");
  }
  warn(
      "no server has recorded this, so that only updates come as they came: a fade or a missed "
      "tick is not played. haptic_server --record keeps all");
  const std::unique_ptr<Device> device = physics.device.open(1 / physics.servo.rate);
  if (const auto lowered = suit_to(*device, physics)) warn(*lowered);
  const std::uint64_t own = fingerprint(physics, *device);
  std::vector<OfflineResult> results;
  for (const RecordedSession& session : sessions) {
    warn_of_other_options(session.welcome.fingerprint, own);
    results.push_back(replay_offline(
        session, physics.servo, own, *device,
        [&](const TickRecord& record, const Servo& servo) { output.observe(record, servo); }));
  }
  return results;
}

/// Whether all came back bit for bit.
bool run_offline(ReplayOptions& options) {
  OfflineOutput output(options);
  std::optional<Recording> recording;
  if (options.capture != "-") recording = Recording::open(options.capture);
  const std::vector<OfflineResult> results =
      recording ? replay(*recording, options, output) : replay_capture(options, output);
  for (const OfflineResult& result : results) output.report(result);
  output.close();
  return std::ranges::all_of(
      results, [](const OfflineResult& result) { return result.equal == result.compared; });
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
  if (!result.scene_fault.empty()) {
    warn("the server has not the recorded scenes: " + result.scene_fault);
  } else if (result.other_scene > 0) {
    warn(fmt::format("{} of these answers are from another scene than the recorded",
                     result.other_scene));
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
  haptic_replay run.pcap --receipt --config server.toml    what the device gave to the hand and took

Exit codes: 0 played, and the answers are the recorded ones (offline bit for bit, otherwise the
proxy within {} mm and {} deg); 1 failed; 2 wrong usage or configuration; 3 other answers than
recorded.
)",
      1e3 * kSameDistance, 180 / std::numbers::pi * kSameAngle);
}

void add_replay_options(settings::CommandLine& command_line, ReplayOptions& options) {
  command_line.positional("CAPTURE", options.capture,
                          "Capture file, pcap or pcapng, packed by gzip or not");
  settings::Table& table = command_line.table();
  table.group("Replay");
  table.flag("offline", options.offline,
             "Run the server's tick here and compare with the recorded proxy states");
  table.flag("receipt", options.receipt,
             "Offline: write what the device port gave and took between updates to standard "
             "output, CSV, and the total to standard error");
  table.flag("simulate", options.simulate,
             "Offline: with the configured device, simulated anew, instead of the recorded one");
  table.text("server", options.server, "HOST:PORT", "Running server");
  table.file("key-file", options.key_file, "The server's key, if it has one");
  table.number("speed", options.speed, {1e-3, 1e3}, "Times the original pace");
  table.whole("session", options.session, {0, 1e6},
              "Which session of the capture, from 1; 0 is all");
  table.file("ticks", options.ticks, "Offline: write every tick's signals here, CSV");
  table.file("signals", options.signals,
             "Offline: write every tick's signals and contacts here for programs to read; - is "
             "standard output");
  table.number(
      "late", options.late, {0, 10, "s"},
      "Offline, of a server's recording: all that came from the client comes so much later");
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
       .footer = server::footer(),
       .usual = {"offline", "server", "key-file", "session", "speed", "simulate", "receipt",
                 "ticks"}});
  server::add_replay_options(command_line, options);
  return server::run_program(
      "haptic_replay", command_line, options.physics, argc, argv,
      [&] {
        server::check(options.physics);
        server::refuse_without_offline(options);
      },
      [&] {
        server::handle_signals([](int) { server::stop_requested = 1; });
        const bool same = options.offline || options.receipt ? server::run_offline(options)
                                                             : server::run_live(options);
        return same ? server::kOk : server::kDiffers;
      });
}
