// A server without a process: its own tick on its simulated device, a network in memory, and a
// clock that goes on when it is told to.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hlm/haptic_server/device/device.h"
#include "hlm/haptic_server/loop/servo.h"
#include "hlm/haptic_server/options.h"
#include "hlm/haptic_server/report/tick_record.h"
#include "hlm/haptic_server/scene/loader.h"
#include "hlm/protocol/server_session.h"
#include "hlm/protocol/transport/capture.h"
#include "hlm/protocol/transport/memory_network.h"
#include "hlm/protocol/transport/recording_link.h"

namespace hlm::server {

struct VirtualServerOptions {
  std::vector<std::string> arguments;  ///< haptic_server's, of physics and device, and --record.
  protocol::LinkConditions network;
  std::uint64_t seed = 1;  ///< Of what the network does.
};

/// Everything in it happens in virtual time: bit for bit the same each time, on any machine, beside
/// any load. Scenes are in force in the tick that follows their last part.
class VirtualServer {
 public:
  /// Throws std::runtime_error or settings::UsageError, which name the option.
  explicit VirtualServer(const VirtualServerOptions& options);
  ~VirtualServer() { write_recording(); }
  VirtualServer(const VirtualServer&) = delete;
  VirtualServer& operator=(const VirtualServer&) = delete;

  /// s, from 0.
  double now() const noexcept { return now_; }
  /// The time goes on to `time`, s, with all ticks that are due before it.
  void pass(double time);

  /// Zero force, device off, goodbye to the client; no ticks from here on.
  void stop();

  /// The client's end of the network.
  protocol::DatagramLink& link() noexcept { return network_.client(); }
  protocol::MemoryNetwork& network() noexcept { return network_; }
  /// What the server would warn of as it starts, and a recording that it could not go on with.
  const std::vector<std::string>& warnings() const noexcept { return warnings_; }

  /// The latest kMostTicks ticks, of which the first is number first_tick().
  const std::deque<TickRecord>& ticks() const noexcept { return ticks_; }
  std::uint64_t first_tick() const noexcept { return count_ - ticks_.size(); }

  static constexpr std::size_t kMostTicks = 120'000;

 private:
  struct Arguments {
    explicit Arguments(const std::vector<std::string>& given);
    PhysicsOptions physics;
    std::string record;
  };
  VirtualServer(const VirtualServerOptions& options, Arguments&& arguments);

  protocol::DatagramLink& open_link(const std::string& record);
  void tick();
  void write_recording();

  protocol::MemoryNetwork network_;
  std::vector<std::string> warnings_;
  std::optional<protocol::CaptureWriter> recording_;  ///< Empty: none, or it has failed.
  std::optional<protocol::RecordingLink> recorded_;   ///< Empty: none.
  std::unique_ptr<Device> device_;
  protocol::ServerSession session_;
  SceneLoader loader_;
  std::unique_ptr<Servo> servo_;  ///< Null: it has ended.
  double dt_ = 0.001;             ///< s.
  double now_ = 0;                ///< s.
  std::uint64_t count_ = 0;
  std::deque<TickRecord> ticks_;
};

}  // namespace hlm::server
