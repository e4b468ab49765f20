// haptic_server: the local model and the device control as a process.
#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <thread>

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/prctl.h>
#include <unistd.h>

#include "hlm/haptic_server/device/motor_guard.h"
#include "hlm/haptic_server/journal.h"
#include "hlm/haptic_server/loop/cpu_latency.h"
#include "hlm/haptic_server/operation.h"
#include "hlm/haptic_server/options.h"
#include "hlm/haptic_server/program.h"
#include "hlm/haptic_server/report/event_log.h"
#include "hlm/haptic_server/report/run_summary.h"
#include "hlm/haptic_server/report/status_line.h"
#include "hlm/haptic_server/report/tick_log.h"
#include "hlm/haptic_server/scene/loader_thread.h"
#include "hlm/protocol/sealing/sealed_server_link.h"
#include "hlm/protocol/transport/capture.h"
#include "hlm/protocol/transport/recording_link.h"
#include "hlm/protocol/transport/udp_socket.h"

namespace hlm::server {
namespace {

std::atomic<int> stop_signal = 0;  ///< Any thread may be the one that handles it.
static_assert(std::atomic<int>::is_always_lock_free);

void request_stop(int signal) { stop_signal = signal; }

std::atomic<bool> force_stop = false;
std::atomic<bool> fault_release = false;
static_assert(std::atomic<bool>::is_always_lock_free);

/// What a person at this machine does to force, in the next tick: SIGUSR2 stops it, SIGRTMIN lets a
/// fault end, as haptic_doctor clear does through the server's socket.
void handle_operator() {
  struct sigaction action {};
  action.sa_flags = SA_RESTART;
  action.sa_handler = [](int) { force_stop = true; };
  sigaction(SIGUSR2, &action, nullptr);
  action.sa_handler = [](int) { fault_release = true; };
  sigaction(SIGRTMIN, &action, nullptr);
}

/// Time for which the loop may stand still, s, until the guard takes the motors off: with what it
/// waits more they are off within 50 ms. They are on again when the loop goes on.
constexpr double kLongestStall = 0.03;

/// Since it was last asked. A stop beside a release is a stop; a release waits for a guard.
Intervention take_intervention(MotorGuard& guard, double now) noexcept {
  const bool watched = guard.is_watching(now);
  const bool stops = force_stop.exchange(false, std::memory_order_relaxed);
  const bool releases = fault_release.exchange(false, std::memory_order_relaxed);
  if (stops) return Intervention::kStop;
  if (guard.has_halted()) return Intervention::kHalted;
  if (!watched) return Intervention::kUnguarded;
  return releases ? Intervention::kClear : Intervention::kNone;
}

/// SIGTERM comes when the process that started this one ends. Throws UsageError if that is another,
/// or has ended.
void end_with(pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() == parent) return;
  throw settings::UsageError(
      "--parent " + std::to_string(parent) +
      " must be the process that started the server: " + std::to_string(getppid()));
}

void configure_logging(const std::string& level) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("haptic_server"));
  // The status line on a terminal makes way.
  const std::string clear = isatty(STDERR_FILENO) != 0 ? "\r\x1b[K" : "";
  spdlog::set_pattern(clear + "%H:%M:%S.%e haptic_server %^%l%$: %v");
  spdlog::set_level(spdlog::level::from_str(level == "warn" ? "warning" : level));
}

/// A capture file, the link whose datagrams it gets, and the thread that writes it.
class Recording {
 public:
  Recording(const std::string& path, protocol::DatagramLink& link, const protocol::Endpoint& local)
      : file_(path), link_(link, local), thread_([this](const std::stop_token& stop) {
          while (!stop.stop_requested()) {
            drain();
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
          }
        }) {}

  protocol::RecordingLink& link() { return link_; }

  /// Writes what is left. Throws std::runtime_error if any of it could not be written.
  void close() {
    thread_.request_stop();
    thread_.join();
    drain();
    if (link_.lost() > 0) spdlog::warn("{} datagrams are missing in the capture", link_.lost());
    if (!failure_.empty()) throw std::runtime_error(failure_);
  }

 private:
  void drain() {
    if (!failure_.empty()) return;
    try {
      link_.drain(file_);
    } catch (const std::exception& error) {
      failure_ = error.what();
      spdlog::error("{}; the capture ends here, the session goes on", failure_);
    }
  }

  protocol::CaptureWriter file_;
  protocol::RecordingLink link_;
  std::string failure_;
  std::jthread thread_;
};

/// Ticks until a signal or the duration ends it.
void run_loop(PeriodicLoop& loop, Servo& servo, MotorGuard& guard, TickLog& log,
              protocol::RecordingLink* recording, double duration) {
  loop.run([&](const Timing& timing) noexcept {
    guard.beat();
    const Intervention intervention = take_intervention(guard, timing.begin);
    servo.obey(intervention);
    TickRecord record = servo.tick(timing);
    if (recording != nullptr) note_tick(*recording, timing, intervention, servo);
    record.execution = loop.elapsed() - timing.begin;
    log.record(record);
    if (stop_signal != 0 || (duration > 0 && timing.begin >= duration)) loop.stop();
  });
  servo.shut_down(loop.elapsed());
}

/// Where this instance waits for its client. Throws UsageError.
protocol::Endpoint address_of(const ServerOptions& options) {
  constexpr int kLastPort = 65535;
  protocol::Endpoint address = resolve_option("--listen", options.listen);
  const int port = address.port + options.instance;
  if (port > kLastPort) {
    throw settings::UsageError("--instance " + std::to_string(options.instance) +
                               " leaves no port: --listen " + options.listen + " and it make " +
                               std::to_string(port) + ", and the last one is " +
                               std::to_string(kLastPort));
  }
  address.port = static_cast<std::uint16_t>(port);
  return address;
}

/// Without a key nobody but this machine may reach the device. Throws UsageError.
void check_is_loopback(const std::string& listen, const protocol::Endpoint& address) {
  if (protocol::is_loopback(address)) return;
  throw settings::UsageError("--listen " + listen +
                             " is not loopback, and without a key anybody there could move the "
                             "device: give --key-file FILE (haptic_keygen FILE makes one), or, on "
                             "a closed network, --insecure");
}

/// What --insecure exposes.
void warn_of_insecurity(const protocol::Endpoint& address) {
  if (protocol::is_loopback(address)) return;
  spdlog::warn(
      "--insecure: no key: whoever reaches {} can start a session, move the device and read "
      "what is said",
      protocol::to_string(address));
}

/// Real-time rights for this thread; what is missing is logged.
void prepare_thread(const RealtimeOptions& options) {
  const RealtimeGrant grant = enter_realtime(options);
  if (!grant.warning.empty()) spdlog::warn("{}", grant.warning);
  if (options.policy == RealtimePolicy::kOff) return;
  const std::string refusal = CpuLatencyLimit::find_refusal();
  if (!refusal.empty()) spdlog::warn("{}", refusal);
}

void print(const std::string& summary) {
  std::cout << summary << std::flush;
  if (!std::cout) throw std::runtime_error("standard output takes no summary");
}

/// What datagrams go through: the socket, the seal around each if there is a key, and the capture.
class Wire {
 public:
  Wire(const protocol::Endpoint& address, const std::optional<protocol::noise::Key>& key,
       const std::string& capture)
      : socket_(address) {
    if (key) link_ = &sealed_.emplace(*link_, *key);
    if (capture.empty()) return;
    link_ = &recording_.emplace(capture, *link_, socket_.local()).link();
  }

  protocol::DatagramLink& link() { return *link_; }
  protocol::Endpoint local() const { return socket_.local(); }
  /// Null: nothing is recorded.
  protocol::RecordingLink* recording() { return recording_ ? &recording_->link() : nullptr; }
  /// Writes what is left of the capture. Throws std::runtime_error if not all could be written.
  void close() {
    if (recording_) recording_->close();
  }

 private:
  protocol::UdpSocket socket_;
  protocol::DatagramLink* link_ = &socket_;
  std::optional<protocol::SealedServerLink> sealed_;
  std::optional<Recording> recording_;
};

/// All that sees each tick, beside the loop.
class Reports {
 public:
  Reports(const ServerOptions& options, const PeriodicLoop& loop, Operation& operation)
      : events_([&loop] { return loop.elapsed(); }),
        operation_(operation),
        shows_status_(options.status),
        limits_latency_(options.realtime.policy != RealtimePolicy::kOff) {}

  void observe(const TickRecord& record) {
    events_.observe(record);
    if (shows_status_) status_.observe(record);
    summary_.observe(record);
    operation_.observe(record);
    latency_.set(limits_latency_ && renders_force(record.server));
  }
  /// The last word; `lost`: ticks that were not seen.
  void close(std::uint64_t lost) {
    if (shows_status_) status_.close();
    if (stop_signal != 0) spdlog::info("stopped by a signal: {}", strsignal(stop_signal));
    print(summary_.text(lost));
  }

 private:
  EventLog events_;
  StatusLine status_{std::cerr, isatty(STDERR_FILENO) != 0};
  RunSummary summary_;
  CpuLatencyLimit latency_;
  Operation& operation_;
  bool shows_status_;
  bool limits_latency_;
};

/// Opens the device and says what is doubtful about it. Lowers stiffness that it does not support.
std::unique_ptr<Device> open_device(ServerOptions& options) {
  std::unique_ptr<Device> device = options.physics.device.open(1 / options.physics.servo.rate);
  check_time_guard(*device, options);
  if (const auto lowered = suit_to(*device, options.physics)) spdlog::warn("{}", *lowered);
  for (const std::string& doubt : doubts_about(options.physics, *device)) {
    spdlog::warn("{}", doubt);
  }
  return device;
}

/// What signals, a parent that ends, and an operator at this machine do. Throws UsageError.
void listen_to_this_machine(const ServerOptions& options) {
  handle_signals(request_stop);
  if (options.parent != 0) end_with(options.parent);
  handle_operator();
}

void run_server(ServerOptions& options) {
  configure_logging(options.log_level);
  PeriodicLoopOptions loop_options = options.loop;
  loop_options.rate = options.physics.servo.rate;
  PeriodicLoop loop(loop_options);
  // They go last: a large scene that is being made keeps nothing else waiting.
  SceneLoader loader;
  SceneLoaderThread loading(loader);
  listen_to_this_machine(options);
  const std::optional<protocol::noise::Key> key = read_key_option(options.key_file);
  const protocol::Endpoint address = address_of(options);
  if (!key && !options.insecure) check_is_loopback(options.listen, address);

  const std::unique_ptr<Device> device = open_device(options);
  MotorGuard guard(*device, std::min(kLongestStall, options.physics.servo.max_gap));
  Wire wire(address, key, options.record);
  if (wire.recording() != nullptr) note_device(*wire.recording(), *device);
  protocol::ServerSession session(wire.link(), {});
  const auto servo = std::make_unique<Servo>(
      options.physics.servo, fingerprint(options.physics, *device), session, *device, &loader);

  Operation operation(options, wire.local(), *device, guard, [] { fault_release = true; });
  Reports reports(options, loop, operation);
  TickLog log(
      options.log, static_cast<std::size_t>(TickLog::kRingTime * loop_options.rate),
      [&reports](const TickRecord& record) { reports.observe(record); },
      [](const std::string& failure) {
        spdlog::error("{}; the log ends here, the session goes on", failure);
      });
  {
    TickLogThread writer(log);
    spdlog::info("listening on {}, {} Hz{}", protocol::to_string(wire.local()), loop_options.rate,
                 key ? ", for clients with the key" : "");
    if (options.insecure) warn_of_insecurity(wire.local());
    prepare_thread(options.realtime);
    run_loop(loop, *servo, guard, log, wire.recording(), options.duration);
  }
  operation.stopping();
  log.drain();
  reports.close(log.lost());
  wire.close();
  log.close();
}

const char* const kFooter =
    R"(Examples:
  haptic_server --hand worlds/hands/session.toml          a scripted hand on a simulated device
  haptic_server --listen 0.0.0.0:47800 --key-file haptic.key
                                                          for a client elsewhere with the key
  haptic_server --device-option freedom=spatial           the simulated device in space
  haptic_server --device list                             what is connected
  haptic_server --print-config > server.toml              a file to change and give with --config

SIGUSR2 stops the force: a fault. It ends as those of device, loop and energy do: a person at this
machine says so, by haptic_doctor clear or SIGRTMIN, and then a person asks for a new session.
SIGHUP, SIGINT, SIGQUIT and SIGTERM end it: zero force, device off, goodbye to the client.
SIGUSR1 has the last 10 s of every tick written, see --recordings.

Exit codes: 0 finished; 1 failed, or could not write all of --log or --record; 2 wrong usage or
configuration.
)";

}  // namespace
}  // namespace hlm::server

int main(int argc, char** argv) {
  using namespace hlm;
  server::ServerOptions options;
  settings::CommandLine command_line(
      {.name = "haptic_server",
       .purpose = "Runs the local model of interaction with a haptic device at a fixed rate, on "
                  "contacts that a client sends over UDP.",
       .footer = server::kFooter,
       .usual = {"listen", "key-file", "stiffness", "force-limit", "record", "log", "realtime"}});
  add_options(command_line, options);
  const int status = server::run_program(
      "haptic_server", command_line, options.physics, argc, argv, [&] { check(options); },
      [&] {
        server::run_server(options);
        return server::kOk;
      });
  // All is written and the device is off: a scene that is being made keeps nobody waiting.
  if (server::SceneLoaderThread::leaves_any()) std::_Exit(status);
  return status;
}
