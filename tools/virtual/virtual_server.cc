#include "hlm/tools/virtual/virtual_server.h"

#include <algorithm>

#include "hlm/common/settings/command_line.h"

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

/// Throws settings::UsageError.
void read(const std::vector<std::string>& arguments, PhysicsOptions& options) {
  settings::CommandLine command_line({.name = "haptic_server", .purpose = "", .footer = ""});
  add_options(command_line, options);
  refuse_real_devices(arguments);
  command_line.take(arguments);
  check(options);
}

}  // namespace

VirtualServer::VirtualServer(const VirtualServerOptions& given)
    : network_(given.network, given.seed), session_(network_.server(), {.first_session_id = 1}) {
  PhysicsOptions options;
  read(given.arguments, options);
  dt_ = 1 / options.servo.rate;
  device_ = options.device.open(dt_);
  if (const auto lowered = suit_to(*device_, options)) warnings_.push_back(*lowered);
  for (const std::string& doubt : doubts_about(options, *device_)) warnings_.push_back(doubt);
  servo_ = std::make_unique<Servo>(options.servo, fingerprint(options, *device_), session_,
                                   *device_, &loader_);
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
}

void VirtualServer::tick() {
  now_ = static_cast<double>(count_) * dt_;
  network_.set_time(now_);
  loader_.work();
  ticks_.push_back(servo_->tick({.tick = count_, .scheduled = now_, .begin = now_}));
  ++count_;
  if (ticks_.size() > kMostTicks) ticks_.pop_front();
}

}  // namespace hlm::server
