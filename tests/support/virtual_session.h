// A whole session in virtual time: the server's own tick and the client's own frame, joined by a
// network in memory. Several servers may share the client.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hlm/haptic_server/device/observed_device.h"
#include "hlm/haptic_server/device/simulated_device.h"
#include "hlm/haptic_server/journal.h"
#include "hlm/haptic_server/loop/servo.h"
#include "hlm/haptic_server/scene/loader.h"
#include "hlm/protocol/server_session.h"
#include "hlm/protocol/transport/memory_network.h"
#include "hlm/protocol/transport/recording_link.h"
#include "hlm/ve_client/run/frame.h"
#include "hlm/ve_client/world/scene_shapes.h"
#include "tests/support/virtual_clock.h"
#include "tests/support/worlds.h"

namespace hlm::test {

using protocol::LinkConditions;
using protocol::MemoryNetwork;

/// A tool, and the hand at the device of its server.
struct ToolAndHand {
  std::string tool;
  server::HandScript hand;
};

struct VirtualSessionOptions {
  ve::WorldDescription world = repository_world("testbed.sdf");
  std::string tool = "peg";
  server::ServoOptions servo;
  server::SimulatedDeviceOptions device;
  server::ObserverOptions observer;  ///< Where the device does not measure the hand's wrench.
  server::HandScript hand;
  std::vector<ToolAndHand> others;  ///< Of further tools, each with a server of its own.
  LinkConditions link{.delay = 0.005};
  double rate_low = 30;   // Hz
  double rate_high = 60;  // Hz
  ve::FrameOptions frame;
  ve::FollowOptions follow;
  /// A frame begins only when the update of the one before has been acknowledged, or this long
  /// after it, s; 0: without waiting.
  double acknowledgement_timeout = 0;
  bool server_holds = true;  ///< The server gets what it must know to move bodies.
  std::uint64_t seed = 1;
  /// What stands between the simulated device and the server; empty: nothing.
  std::function<std::unique_ptr<server::Device>(std::unique_ptr<server::Device>)> wrap_device;
  bool takes_scenes = true;  ///< Servers do.
  bool recorded = false;     ///< Servers note each tick for a replay.
  protocol::TelemetryObserver* telemetry = nullptr;
};

/// A server with its device, and the network between it and the client.
class VirtualServer {
 public:
  VirtualServer(const VirtualSessionOptions& options, const server::HandScript& hand,
                std::uint64_t seed)
      : options_(options),
        hand_(hand),
        network_(options.link, seed),
        link_(
            network_.server(), MemoryNetwork::kServer,
            [this] { return static_cast<std::int64_t>(1e9 * network_.time()); }, 4096) {
    start();
  }

  /// Begins anew, with another session.
  void start() {
    servo_.reset();
    const double dt = 1 / options_.servo.rate;
    device_ = server::with_hand_observer(
        std::make_unique<server::SimulatedDevice>(options_.device, hand_, dt), options_.observer,
        dt);
    if (options_.wrap_device) device_ = options_.wrap_device(std::move(device_));
    if (options_.recorded) server::note_device(link_, *device_);
    session_.emplace(link_, protocol::ServerSessionOptions{.first_session_id = ++starts_});
    loader_ = std::make_unique<server::SceneLoader>();
    servo_ = std::make_unique<server::Servo>(options_.servo, 0, *session_, *device_,
                                             options_.takes_scenes ? loader_.get() : nullptr);
  }
  /// Dies without a word.
  void stop() { servo_.reset(); }

  const server::TickRecord* tick(double now) {
    network_.set_time(now);
    if (!servo_) return nullptr;
    server::Timing timing;
    timing.tick = ticks_++;
    timing.scheduled = timing.begin = now;
    if (stalls_ > 0) {
      --stalls_;
      ++missed_;
      return nullptr;
    }
    timing.missed = std::exchange(missed_, 0);
    timing.previous_execution = execution_;
    const Intervention act = act_ticks_ > 0 ? act_ : Intervention::kNone;
    act_ticks_ = std::max(0, act_ticks_ - 1);
    servo_->obey(act);
    if (idle_ > 0) {
      --idle_;
    } else {
      loader_->work();
    }
    last_ = servo_->tick(timing);
    if (options_.recorded) server::note_tick(link_, timing, act, *servo_);
    return &last_;
  }

  /// Misses so many periods.
  void stall(std::uint64_t periods) { stalls_ += periods; }
  /// No scenes are made for so many ticks.
  void idle(std::uint64_t ticks) { idle_ += ticks; }
  /// Each tick takes so long, s, as its loop says.
  void take(double execution) { execution_ = execution; }
  /// What comes from the device's machine before each of the next ticks.
  void intervene(Intervention act, int ticks = 1) {
    act_ = act;
    act_ticks_ = ticks;
  }

  const server::TickRecord& last() const { return last_; }
  server::Servo& servo() { return *servo_; }
  const protocol::ServerSession& session() const { return *session_; }
  MemoryNetwork& network() { return network_; }
  protocol::RecordingLink& link() { return link_; }

 private:
  const VirtualSessionOptions& options_;
  server::HandScript hand_;
  MemoryNetwork network_;
  protocol::RecordingLink link_;
  std::uint64_t starts_ = 0;
  std::unique_ptr<server::Device> device_;
  std::optional<protocol::ServerSession> session_;
  std::unique_ptr<server::SceneLoader> loader_;
  std::unique_ptr<server::Servo> servo_;
  std::uint64_t ticks_ = 0;
  std::uint64_t stalls_ = 0;
  std::uint64_t missed_ = 0;
  std::uint64_t idle_ = 0;
  double execution_ = 0;
  Intervention act_ = Intervention::kNone;
  int act_ticks_ = 0;
  server::TickRecord last_;
};

class VirtualSession {
 public:
  using Observer = std::function<void(const server::TickRecord&)>;

  /// observe: the ticks of the first server.
  explicit VirtualSession(const VirtualSessionOptions& options, Observer observe = {})
      : options_(options),
        observers_{std::move(observe)},
        environment_(options.world, tools(options), options.follow),
        periods_(options.rate_low, options.rate_high, options.seed),
        clock_([this](double now) { tick(now); }, 1 / options.servo.rate) {
    add(options_.hand);
    for (const ToolAndHand& other : options_.others) add(other.hand);
  }

  void observe(std::size_t server, Observer observe) {
    observers_.resize(std::max(observers_.size(), server + 1));
    observers_[server] = std::move(observe);
  }

  /// All sides go on for `duration` seconds.
  void run(double duration) {
    const double end = clock_.now() + duration;
    while (clock_.now() < end) {
      const double period = periods_.next();
      const double next = clock_.now() + period;
      ve::run_frame(environment_, clients_, clock_, period, options_.frame);
      const double patience = clock_.now() + options_.acknowledgement_timeout;
      clock_.sleep_until(next);
      while (clock_.now() < patience && !network().client_has_mail()) {
        clock_.sleep_until(clock_.now() + 1 / options_.servo.rate);
      }
    }
  }

  /// The client dies: only the servers go on.
  void run_server_alone(double duration) { clock_.sleep_until(clock_.now() + duration); }

  VirtualServer& server(std::size_t index) { return servers_[index]; }
  ve::VirtualEnvironment& environment() { return environment_; }
  /// Of the frames from here on.
  ve::FrameOptions& frame() { return options_.frame; }
  double now() { return clock_.now(); }

  // Of the first server.
  const server::TickRecord& last() const { return servers_.front().last(); }
  server::Servo& servo() { return servers_.front().servo(); }
  HapticClient& client() { return *clients_.front(); }
  protocol::RecordingLink& server_link() { return servers_.front().link(); }
  MemoryNetwork& network() { return servers_.front().network(); }
  const protocol::ServerSession& session() const { return servers_.front().session(); }

 private:
  static std::vector<std::string> tools(const VirtualSessionOptions& options) {
    std::vector<std::string> names{options.tool};
    for (const ToolAndHand& other : options.others) names.push_back(other.tool);
    return names;
  }

  void add(const server::HandScript& hand) {
    const std::size_t index = servers_.size();
    VirtualServer& server = servers_.emplace_back(options_, hand, options_.seed + index);
    const ve::ToolAssembly& assembly = environment_.tools[index].assembly;
    owned_.emplace_back(server.network().client(),
                        HapticClientOptions{.server = MemoryNetwork::kServer,
                                            .tool = assembly.description,
                                            .q = assembly.q,
                                            .epsilon = options_.frame.epsilon,
                                            .nonce = 1,
                                            .telemetry = options_.telemetry});
    clients_.push_back(&owned_.back());
    if (!options_.frame.shapes) return;
    protocol::SceneOffer scene =
        ve::scene_of(environment_.world, assembly, options_.frame.report_friction[index]);
    if (!options_.server_holds) {
      scene.inertias.clear();
      scene.joints.clear();
    }
    owned_.back().offer_scene(std::move(scene));
  }

  void tick(double now) {
    for (std::size_t i = 0; i < servers_.size(); ++i) {
      const server::TickRecord* record = servers_[i].tick(now);
      if (record && i < observers_.size() && observers_[i]) observers_[i](*record);
    }
  }

  VirtualSessionOptions options_;
  std::vector<Observer> observers_;
  std::deque<VirtualServer> servers_;
  ve::VirtualEnvironment environment_;
  std::deque<HapticClient> owned_;
  std::vector<HapticClient*> clients_;
  ve::FramePeriods periods_;
  VirtualClock clock_;
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
