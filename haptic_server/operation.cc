#include "hlm/haptic_server/operation.h"

#include <atomic>
#include <csignal>
#include <filesystem>
#include <utility>

#include <spdlog/spdlog.h>

#include "hlm/common/settings/directories.h"
#include "hlm/protocol/transport/udp_socket.h"

namespace hlm::server {
namespace {

std::atomic<bool> recording_requested = false;
static_assert(std::atomic<bool>::is_always_lock_free);

void request_recording_on_signal() {
  struct sigaction action {};
  action.sa_handler = [](int) { recording_requested = true; };
  action.sa_flags = SA_RESTART;
  sigaction(SIGUSR1, &action, nullptr);
}

/// Null if none is to be kept.
std::unique_ptr<FlightRecorder> open_recorder(const ServerOptions& options) {
  if (options.keep_recordings == 0) return nullptr;
  FlightRecorderOptions recorder;
  recorder.directory = options.recordings;
  if (recorder.directory.empty()) recorder.directory = settings::state_directory();
  if (recorder.directory.empty()) {
    spdlog::warn("no recordings: neither --recordings, $STATE_DIRECTORY nor $HOME names a place");
    return nullptr;
  }
  recorder.kept = options.keep_recordings;
  recorder.rate = options.physics.servo.rate;
  return std::make_unique<FlightRecorder>(recorder);
}

ServerFacts facts_about(const ServerOptions& options, const protocol::Endpoint& listen,
                        const Device& device) {
  const ServoOptions& servo = options.physics.servo;
  return {
      .listen = protocol::to_string(listen),
      .rate = servo.rate,
      .least_update_rate = 1 / servo.silence_time.value_or(kDefaultSilenceTimes.most),
      .device = std::string(device.name()),
      .ratings = device.ratings(),
      .capture = options.record.empty() ? "" : std::filesystem::absolute(options.record).string()};
}

constexpr double kGuardPeriod = 0.5;  // s.
constexpr const char* kUnguarded =
    "the process that takes the motors off if this one is killed has ended: restart the server";

}  // namespace

Operation::Operation(const ServerOptions& options, const protocol::Endpoint& listen,
                     const Device& device, MotorGuard& guard, std::function<void()> release_fault)
    : state_(settings::runtime_directory(), facts_about(options, listen, device)),
      socket_(settings::runtime_directory(), protocol::to_string(listen), std::move(release_fault)),
      recorder_(open_recorder(options)),
      guard_(guard) {
  request_recording_on_signal();
}

void Operation::observe(const TickRecord& record) {
  manager_.observe(record);
  state_.observe(record);
  if (recorder_) {
    if (recording_requested.exchange(false)) recorder_->request();
    recorder_->observe(record);
  }
  if (record.time - guard_seen_ < kGuardPeriod) return;
  guard_seen_ = record.time;
  if (!guard_.lives()) spdlog::error("{}", kUnguarded);
}

}  // namespace hlm::server
