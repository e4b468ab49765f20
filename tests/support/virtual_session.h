// A whole session in virtual time: the server's own tick and the client's own frame, joined by a
// network in memory.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "haptic_server/device/observed_device.h"
#include "haptic_server/device/simulated_device.h"
#include "haptic_server/loop/servo.h"
#include "protocol/server_session.h"
#include "protocol/transport/recording_link.h"
#include "tests/support/memory_link.h"
#include "tests/support/virtual_clock.h"
#include "tests/support/worlds.h"
#include "ve_client/frame.h"

namespace hlm::test {

struct VirtualSessionOptions {
  ve::WorldDescription world = repository_world("testbed.sdf");
  std::string tool = "peg";
  server::ServoOptions servo;
  server::SimulatedDeviceOptions device;
  server::ObserverOptions observer;  ///< Where the device does not measure the hand's wrench.
  server::HandScript hand;
  LinkConditions link{.delay = 0.005};
  double rate_low = 30;   // Hz
  double rate_high = 60;  // Hz
  ve::FrameOptions frame;
  ve::FollowOptions follow;
  /// A frame begins only when the update of the one before has been acknowledged, or this long
  /// after it, s; 0: without waiting.
  double acknowledgement_timeout = 0;
  std::uint64_t seed = 1;
  protocol::TelemetryObserver* telemetry = nullptr;
};

class VirtualSession {
 public:
  using Observer = std::function<void(const server::TickRecord&)>;

  explicit VirtualSession(const VirtualSessionOptions& options, Observer observe = {})
      : options_(options),
        observe_(std::move(observe)),
        network_(options.link, options.seed),
        server_link_(network_.server(), MemoryNetwork::kServer,
                     [this] { return static_cast<std::int64_t>(1e9 * network_.time()); }),
        device_(server::with_hand_observer(
            std::make_unique<server::SimulatedDevice>(options.device, options.hand,
                                                      1 / options.servo.rate),
            options.observer, 1 / options.servo.rate)),
        session_(server_link_, {.first_session_id = 1}),
        servo_(std::make_unique<server::Servo>(options.servo, 0, session_, *device_)),
        environment_(options.world, options.tool, options.follow),
        client_(network_.client(), {.server = MemoryNetwork::kServer,
                                    .tool = environment_.assembly.description,
                                    .q = environment_.assembly.q,
                                    .epsilon = options.frame.epsilon,
                                    .nonce = 1,
                                    .telemetry = options.telemetry}),
        periods_(options.rate_low, options.rate_high, options.seed),
        clock_([this](double now) { tick(now); }, 1 / options.servo.rate) {}

  /// Both sides go on for `duration` seconds.
  void run(double duration) {
    const double end = clock_.now() + duration;
    while (clock_.now() < end) {
      const double period = periods_.next();
      const double next = clock_.now() + period;
      ve::run_frame(environment_, client_, clock_, period, options_.frame);
      const double patience = clock_.now() + options_.acknowledgement_timeout;
      clock_.sleep_until(next);
      while (clock_.now() < patience && !network_.client_has_mail()) {
        clock_.sleep_until(clock_.now() + 1 / options_.servo.rate);
      }
    }
  }

  /// The client dies: only the server goes on.
  void run_server_alone(double duration) { clock_.sleep_until(clock_.now() + duration); }

  const server::TickRecord& last() const { return last_; }
  server::Servo& servo() { return *servo_; }
  ve::VirtualEnvironment& environment() { return environment_; }
  HapticClient& client() { return client_; }
  protocol::RecordingLink& server_link() { return server_link_; }
  MemoryNetwork& network() { return network_; }
  const protocol::ServerSession& session() const { return session_; }
  double now() { return clock_.now(); }

 private:
  void tick(double now) {
    network_.set_time(now);
    server::Timing timing;
    timing.tick = ticks_++;
    timing.scheduled = timing.begin = now;
    last_ = servo_->tick(timing);
    if (observe_) observe_(last_);
  }

  VirtualSessionOptions options_;
  Observer observe_;
  MemoryNetwork network_;
  protocol::RecordingLink server_link_;
  std::unique_ptr<server::Device> device_;
  protocol::ServerSession session_;
  std::unique_ptr<server::Servo> servo_;
  ve::VirtualEnvironment environment_;
  HapticClient client_;
  ve::FramePeriods periods_;
  VirtualClock clock_;
  std::uint64_t ticks_ = 0;
  server::TickRecord last_;
};

/// A hand that pushes with a constant wrench from the start.
inline server::HandScript constant_push(const Wrench& F) {
  server::Push push;
  push.constant = F;
  return {{{1.0, push}}, server::AfterLastSegment::kHold};
}

inline Wrench force(double x, double y, double z = 0) {
  Wrench F = Wrench::Zero();
  F.head<3>() << x, y, z;
  return F;
}

}  // namespace hlm::test
