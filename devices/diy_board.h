// The line to the Haply 2DIY's board: a serial port.
#pragma once

#include <atomic>
#include <string>

#include "hlm/devices/device_lock.h"
#include "hlm/devices/diy_frames.h"
#include "hlm/devices/exchange_device.h"

namespace hlm::server {

struct DiyBoardOptions {
  std::string port{};      ///< "/dev/ttyACM0"; empty: the only one in kSerialPorts.
  std::uint8_t board = 5;  ///< Number of the board, in every frame.
  Pantograph pantograph{};
  DiySetup setup{};
  /// Cut-off of the low-pass on the velocity from the encoders' steps, Hz. Less lags, more lets
  /// steps through: at 1 kHz an unfiltered step of the kit's encoders is 0.1 m/s.
  double velocity_cutoff = 20;
  /// What each motor can give, N·m: the kit's firmware cuts each one off there by itself, which
  /// would turn the force. 1.6 N need 0.12 in the middle of the kit's workspace.
  double max_torque = 0.123;
};

/// Where the system lists serial ports by their devices' names.
inline constexpr const char* kSerialPorts = "/dev/serial/by-id";

/// The names in kSerialPorts, whole paths.
std::vector<std::string> serial_ports();

/// A pantograph in its x-y plane. The first open() sets the board up: its arms must be as the
/// offsets say. A later one takes the same port, and fails where the board was reset since: its
/// encoders would count from another posture. Forces that need more than the motors' torque are
/// given in their direction, as far as it goes. No two processes have one port.
class DiyBoard final : public DeviceLine {
 public:
  explicit DiyBoard(DiyBoardOptions options) : options_(std::move(options)) {}
  ~DiyBoard() override { close(); }

  void open() override;
  void close() noexcept override;
  void send(const std::optional<Vector3>& force) override;
  void expect_silence() override;
  std::optional<HandleState> receive(SteadyTime deadline) override;
  /// Its board counts angles and nothing else.
  MotionCheck::SpeedSource speed_source() const noexcept override {
    return MotionCheck::SpeedSource::kDriver;
  }
  /// Writes torques of zero to the port, which a forked process inherits; to the port of the same
  /// name where that one is gone, as after plugging in again.
  void halt() noexcept override;

 private:
  void expect_same_setup();
  void write(const std::uint8_t* bytes, std::size_t size) const;
  bool waits_for_input(SteadyTime deadline) const;
  HandleState state_at(const Vector2& theta);
  [[noreturn]] void fail(const std::string& what) const;

  DiyBoardOptions options_;
  std::string port_;  ///< Port as opened first.
  DeviceLock lock_;
  bool is_set_up_ = false;
  std::atomic<int> descriptor_ = -1;
  DiyAngleFrame frame_{};        ///< The reply that is coming,
  std::size_t received_ = 0;     ///< bytes of it so far.
  Matrix2 J_ = Matrix2::Zero();  ///< Jacobian at the latest angles.
  bool is_saturated_ = false;    ///< The latest request was for more than its motors give.
  Vector2 theta_ = Vector2::Zero();
  Vector2 rate_ = Vector2::Zero();  ///< Filtered, rad/s.
  SteadyTime theta_at_{};
};

}  // namespace hlm::server
