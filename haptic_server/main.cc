// haptic_server: the local model and the device control as a process.
#include <csignal>
#include <iostream>
#include <optional>
#include <random>
#include <stdexcept>
#include <thread>

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "haptic_server/loop/run_summary.h"
#include "haptic_server/loop/status_line.h"
#include "haptic_server/loop/tick_log.h"
#include "haptic_server/options.h"
#include "protocol/transport/capture.h"
#include "protocol/transport/recording_link.h"
#include "protocol/transport/udp_socket.h"

namespace hlm::server {
namespace {

PeriodicLoop* running_loop = nullptr;

void request_stop(int) {
  if (running_loop != nullptr) running_loop->stop();
}

void install_signal_handlers(PeriodicLoop& loop) {
  running_loop = &loop;
  struct sigaction action {};
  action.sa_handler = request_stop;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

void configure_logging(const std::string& level) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("haptic_server"));
  // On a terminal the status line makes way.
  const std::string clear = isatty(STDERR_FILENO) != 0 ? "\r\x1b[K" : "";
  spdlog::set_pattern(clear + "%H:%M:%S.%e haptic_server %^%l%$: %v");
  spdlog::set_level(spdlog::level::from_str(level == "warn" ? "warning" : level));
}

/// Tells of what changes between ticks: sessions and faults.
class EventLog {
 public:
  void observe(const TickRecord& record) {
    if (record.server == state_ && record.session == session_) return;
    if (record.server == ServerState::kRunning && record.session != session_) {
      spdlog::info("session {:016x} begins", record.session);
    } else if (record.server == ServerState::kSilent) {
      spdlog::warn("no news of the client, or its goodbye: force fades to zero");
    } else if (record.server == ServerState::kRunning) {
      spdlog::info("the client is back");
    } else if (record.server == ServerState::kFault) {
      spdlog::error("fault: {}; force is off until a client starts a new session",
                    meaning_of(record.fault));
    } else {
      spdlog::info("session {:016x} is over", record.session);
    }
    state_ = record.server;
    session_ = record.session;
  }

 private:
  ServerState state_ = ServerState::kIdle;
  std::uint64_t session_ = 0;
};

/// A capture file, the link whose datagrams it gets, and the thread that writes it.
class Recording {
 public:
  Recording(const std::string& path, protocol::UdpSocket& socket)
      : file_(path), link_(socket, socket.local()), thread_([this](const std::stop_token& stop) {
          while (!stop.stop_requested()) {
            drain();
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
          }
        }) {}
  ~Recording() {
    thread_.request_stop();
    thread_.join();
    drain();
    if (link_.lost() > 0) spdlog::warn("{} datagrams are missing in the capture", link_.lost());
  }

  protocol::DatagramLink& link() { return link_; }

 private:
  void drain() {
    if (failed_) return;
    try {
      link_.drain(file_);
    } catch (const std::exception& error) {
      failed_ = true;
      spdlog::error("the capture ends here: {}", error.what());
    }
  }

  protocol::CaptureWriter file_;
  protocol::RecordingLink link_;
  bool failed_ = false;
  std::jthread thread_;
};

std::uint64_t random_session_id() {
  std::random_device random;
  return (static_cast<std::uint64_t>(random()) << 32) | random() | 1;
}

void warn_of_doubts(const PhysicsOptions& physics, const Device& device) {
  for (const std::string& doubt : check_against_device(
           physics.servo.controller, physics.servo.gains, physics.servo.local_model,
           device.ratings(), device.measures_hand_wrench(), 1 / physics.servo.rate)) {
    spdlog::warn("{}", doubt);
  }
}

/// Ticks until the end is asked for.
void run_loop(PeriodicLoop& loop, Servo& servo, TickLog& log, double duration) {
  loop.run([&](const Timing& timing) noexcept {
    TickRecord record = servo.tick(timing);
    record.execution = loop.elapsed() - timing.begin;
    log.record(record);
    if (duration > 0 && timing.begin >= duration) loop.stop();
  });
  servo.shut_down(loop.elapsed());
}

void run_server(const ServerOptions& options) {
  configure_logging(options.log_level);
  PeriodicLoopOptions loop_options = options.loop;
  loop_options.rate = options.physics.servo.rate;
  PeriodicLoop loop(loop_options);
  install_signal_handlers(loop);

  const std::unique_ptr<Device> device = make_device(options.physics);
  warn_of_doubts(options.physics, *device);
  protocol::UdpSocket socket(protocol::resolve(options.listen));
  std::optional<Recording> recording;
  if (!options.record.empty()) recording.emplace(options.record, socket);
  protocol::DatagramLink& link =
      recording ? recording->link() : static_cast<protocol::DatagramLink&>(socket);
  protocol::ServerSession session(link, {.first_session_id = random_session_id()});
  const auto servo = std::make_unique<Servo>(options.physics.servo, fingerprint(options.physics),
                                             session, *device);

  EventLog events;
  StatusLine status(std::cerr, isatty(STDERR_FILENO) != 0);
  RunSummary summary;
  TickLog log(options.log, static_cast<std::size_t>(TickLog::kRingTime * loop_options.rate),
              [&](const TickRecord& record) {
                events.observe(record);
                if (options.status) status.observe(record);
                summary.observe(record);
              });
  {
    TickLogThread writer(log);
    spdlog::info("listening on {}, {} Hz", protocol::to_string(socket.local()), loop_options.rate);
    const RealtimeGrant grant = enter_realtime(options.realtime);
    if (!grant.warning.empty()) spdlog::warn("{}", grant.warning);
    run_loop(loop, *servo, log, options.duration);
  }
  log.close();
  if (options.status) status.close();
  std::cout << summary.text(log.lost());
}

}  // namespace
}  // namespace hlm::server

int main(int argc, char** argv) {
  using namespace hlm::server;
  ServerOptions options;
  bool print_config = false;
  CLI::App app("Haptic server: the local model of interaction and the device control.");
  add_configuration_file(app, print_config);
  add_options(app, options);
  try {
    app.parse(argc, argv);
    if (const auto error = find_error(options)) throw std::runtime_error(*error);
    if (print_config) {
      std::cout << app.config_to_str(true, true);
      return 0;
    }
    run_server(options);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    std::cerr << "haptic_server: " << error.what() << '\n';
    return error.get_exit_code();
  } catch (const std::exception& error) {
    std::cerr << "haptic_server: " << error.what() << '\n';
    return 1;
  }
  return 0;
}
