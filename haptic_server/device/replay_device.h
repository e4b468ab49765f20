// A device that plays back a recorded session.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hlm/device/device.h"

namespace hlm::server {

/// One step of a recorded session.
struct RecordedStep {
  std::uint64_t session = 0;
  std::uint64_t step = 0;  ///< From 1.
  DeviceState state;       ///< As the servo read it, bit for bit.
};

/// The steps in a tick log, in order. Ticks without a session are left out.
/// Throws std::runtime_error naming the file, line and column if it cannot be opened, a column is
/// missing, a value is not a finite number, an orientation is not a unit quaternion, a session's
/// steps are not 1, 2, 3, … or there are none at all.
std::vector<RecordedStep> read_recorded_steps(const std::string& path);

/// Each align() begins the next recorded session, each write() goes on to its next step; wrenches
/// have no effect. The poses are the recorded ones, wherever the handle is aligned to. After the
/// last step of a session the device fails until the next align(), after the last session for good.
/// Before the first align() it stays at the first step.
class ReplayDevice final : public Device {
 public:
  /// `steps` must not be empty. `ratings`: those of the recorded device.
  ReplayDevice(std::vector<RecordedStep> steps, const DeviceRatings& ratings);

  std::string_view name() const noexcept override { return "recorded device"; }
  const DeviceRatings& ratings() const noexcept override { return ratings_; }
  /// Whether the first step has the hand's wrench.
  bool measures_hand_wrench() const noexcept override {
    return steps_.front().state.F_hand.has_value();
  }
  bool observes_hand_wrench() const noexcept override { return steps_.front().state.hand_observed; }
  void align(const Pose& X_WH) noexcept override;
  void enable() noexcept override {}
  void disable() noexcept override {}
  std::optional<DeviceState> read() noexcept override;
  bool write(const Wrench& F) noexcept override;

 private:
  std::vector<RecordedStep> steps_;
  DeviceRatings ratings_;
  bool aligned_ = false;
  std::size_t present_ = 0;
  std::size_t session_end_ = 0;  ///< One past the last step of the present session.
};

}  // namespace hlm::server
