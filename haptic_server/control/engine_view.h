// What the environment's engine and the server know of each other, late by the network.
#pragma once

#include <array>
#include <cstdint>

#include "hlm/haptic_server/control/controller.h"

namespace hlm::server {

/// The engine's tool of the latest update, and the device as the engine knew it then: the one in
/// the proxy state that the update echoes.
class EngineView {
 public:
  /// A session begins, everything at rest at X_WH.
  void begin(const Pose& X_WH) noexcept {
    acknowledged_.fill({});
    tool_ = {X_WH, Twist::Zero()};
    device_ = {};
    device_.X_WD = X_WH;
  }

  /// The proxy state of `step` leaves for the engine.
  void acknowledge(std::uint64_t step, const Pose& X_WD, const Twist& V_WD) noexcept {
    acknowledged_[next_] = {step, X_WD, V_WD};
    next_ = (next_ + 1) % acknowledged_.size();
  }

  /// An update arrives that echoes the proxy state of `echo_step`. Where that has been forgotten,
  /// the device stays as it was.
  void update(std::uint64_t echo_step, const HandMotion& tool) noexcept {
    tool_ = tool;
    for (const Acknowledged& sent : acknowledged_) {
      if (sent.step == 0 || sent.step != echo_step) continue;
      device_.X_WD = sent.X_WD;
      device_.V_WD = sent.V_WD;
    }
  }

  const HandMotion& tool() const noexcept { return tool_; }
  const DeviceState& device() const noexcept { return device_; }

 private:
  struct Acknowledged {
    std::uint64_t step = 0;
    Pose X_WD;
    Twist V_WD = Twist::Zero();
  };

  /// More than are under way at once: 64 frames are 1 s at 60 Hz.
  std::array<Acknowledged, 64> acknowledged_;
  std::size_t next_ = 0;
  HandMotion tool_;
  DeviceState device_;
};

}  // namespace hlm::server
