#include "hlm/tools/virtual/virtual_server.h"

#include <algorithm>
#include <functional>

#include "hlm/common/settings/command_line.h"
#include "hlm/haptic_server/journal.h"

namespace hlm::server {
namespace {

/// The list of devices, which has one here, would not say why. Throws settings::UsageError.
void refuse_real_devices(const std::vector<std::string>& arguments) {
  const auto device = std::ranges::find(arguments, "--device");
  if (device == arguments.end() || device + 1 == arguments.end()) return;
  const std::string& name = *(device + 1);
  if (name == "simulated") return;
  throw settings::UsageError("--device " + name +
                             " must be simulated: no other device has a virtual time");
}

/// A recording is written as often, in ticks; the link holds what comes in between.
constexpr std::uint64_t kTicksHeld = 64;
constexpr std::size_t kDatagramsHeld = 8192;

/// The same each time, and another for each file.
std::uint64_t session_id(const std::string& record) {
  return record.empty() ? 1 : std::max<std::uint64_t>(1, std::hash<std::string>()(record));
}

}  // namespace

VirtualServer::Arguments::Arguments(const std::vector<std::string>& given) {
  settings::CommandLine command_line({.name = "haptic_server", .purpose = "", .footer = ""});
  add_options(command_line, physics);
  command_line.table().file("record", record, "What haptic_replay plays");
  refuse_real_devices(given);
  command_line.take(given);
  check(physics);
}

VirtualServer::VirtualServer(const VirtualServerOptions& options)
    : VirtualServer(options, Arguments(options.arguments)) {}

VirtualServer::VirtualServer(const VirtualServerOptions& given, Arguments&& arguments)
    : network_(given.network, given.seed),
      session_(open_link(arguments.record), {.first_session_id = session_id(arguments.record)}) {
  PhysicsOptions& options = arguments.physics;
  dt_ = 1 / options.servo.rate;
  device_ = options.device.open(dt_);
  if (const auto lowered = suit_to(*device_, options)) warnings_.push_back(*lowered);
  for (const std::string& doubt : doubts_about(options, *device_)) warnings_.push_back(doubt);
  servo_ = std::make_unique<Servo>(options.servo, fingerprint(options, *device_), session_,
                                   *device_, &loader_);
  if (recorded_) note_device(*recorded_, *device_);
}

protocol::DatagramLink& VirtualServer::open_link(const std::string& record) {
  if (record.empty()) return network_.server();
  recording_.emplace(record);
  const auto clock = [this] { return static_cast<std::int64_t>(1e9 * now_); };
  return recorded_.emplace(network_.server(), protocol::MemoryNetwork::kServer, clock,
                           kDatagramsHeld);
}

void VirtualServer::pass(double time) {
  while (servo_ && static_cast<double>(count_) * dt_ <= time) tick();
  now_ = std::max(now_, time);
  network_.set_time(now_);
}

void VirtualServer::stop() {
  if (servo_) servo_->shut_down(now_);
  servo_.reset();
  network_.end_server();
  write_recording();
}

void VirtualServer::write_recording() {
  if (!recording_) return;
  try {
    recorded_->drain(*recording_);
  } catch (const std::exception& error) {
    warnings_.push_back(std::string(error.what()) + "; the recording ends here");
    recording_.reset();
  }
}

void VirtualServer::tick() {
  now_ = static_cast<double>(count_) * dt_;
  network_.set_time(now_);
  loader_.work();
  const Timing timing{.tick = count_, .scheduled = now_, .begin = now_};
  ticks_.push_back(servo_->tick(timing));
  if (recording_) {
    note_tick(*recorded_, timing, Intervention::kNone, *servo_);
    if (count_ % kTicksHeld == 0) write_recording();
  }
  ++count_;
  if (ticks_.size() > kMostTicks) ticks_.pop_front();
}

}  // namespace hlm::server
