// 3D Systems' Touch and Phantom devices, through OpenHaptics.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "hlm/common/range.h"
#include "hlm/device/device.h"
#include "hlm/device/motion_check.h"
#include "hlm/device/newest.h"
#include "hlm/device/open_haptics_library.h"
#include "hlm/device/reopener.h"

namespace hlm::server {

struct OpenHapticsOptions {
  std::string library{};                 ///< File of the vendor's library; empty: searched.
  std::string unit = "Default PHANToM";  ///< Name in the vendor's setup.
  double rate = 1000;                    ///< Rate of the vendor's scheduler, Hz.
  /// Oldest state and oldest command that are used, s. Less ends sessions when the machine is busy;
  /// more lets a force outlive what it answers.
  double oldest = 0.015;
};

inline constexpr Range kOpenHapticsRates{500, 2000, "Hz"};
inline constexpr Range kOpenHapticsAges{0.005, 0.1, "s"};

/// The vendor's scheduler exchanges with the device in a thread of its own: it reads a state and
/// gives the latest command. The servo thread reads the latest state and leaves a command; it calls
/// nothing of the vendor's and never waits. A state or a command that is too old counts as none.
/// Force only: the torques of a 6-DOF stylus are those of its joints, and stay zero.
class OpenHapticsDevice final : public Device {
 public:
  /// dt: servo period, s. Opens the device, motors off. Throws std::runtime_error.
  OpenHapticsDevice(std::shared_ptr<const OpenHapticsLibrary> library,
                    const OpenHapticsOptions& options, double dt);
  ~OpenHapticsDevice() override;

  std::string_view name() const noexcept override { return name_; }
  const DeviceRatings& ratings() const noexcept override { return ratings_; }
  bool measures_hand_wrench() const noexcept override { return false; }
  /// Waits for the first state.
  void calibrate() override;
  void align(const Pose&) noexcept override {}
  void enable() noexcept override;
  void disable() noexcept override;
  std::optional<DeviceState> read() noexcept override;
  bool write(const Wrench& F) noexcept override;
  const char* cause() const noexcept override { return cause_; }

 private:
  using Clock = std::chrono::steady_clock;

  struct Reading {
    Clock::time_point time{};
    Vector3 p = Vector3::Zero();  ///< m.
    Matrix3 R = Matrix3::Identity();
    Twist V = Twist::Zero();
    std::uint32_t buttons = 0;
    bool saturated = false;
  };
  struct Command {
    Clock::time_point time{};
    Vector3 force = Vector3::Zero();  ///< N.
  };

  /// Opens nothing. When a constructor that begins with this one throws, the destructor runs.
  OpenHapticsDevice(const OpenHapticsOptions& options, double dt,
                    std::shared_ptr<const OpenHapticsLibrary> library)
      : library_(std::move(library)), options_(options), motion_(dt) {}

  /// Null if the device is open, its motors off and its scheduler at rest; otherwise why not.
  const char* open() noexcept;
  /// Null if the scheduler runs, otherwise why not.
  const char* start() noexcept;
  void close() noexcept;
  void throw_if(const char* why) const;
  static unsigned exchange(void* device) noexcept;
  void exchange() noexcept;
  std::optional<DeviceState> fail(const char* cause) noexcept;

  std::shared_ptr<const OpenHapticsLibrary> library_;
  OpenHapticsOptions options_;
  std::string name_;
  DeviceRatings ratings_;
  OpenHapticsLibrary::Handle handle_ = OpenHapticsLibrary::kNoDevice;
  unsigned long callback_ = 0;

  // Between the servo's thread and the scheduler's.
  Newest<Reading> readings_;
  Newest<Command> commands_;
  std::atomic<bool> enabled_ = false;
  std::atomic<unsigned> error_ = 0;  ///< The library's code of the first failure since enable().

  bool gives_force_ = false;  ///< The motors are on; used by the scheduler's thread.

  // Used by the servo thread.
  MotionCheck motion_;
  Clock::time_point enabled_at_{};
  bool failed_ = false;  ///< A failure since enable().
  const char* cause_ = "";
  std::optional<Reopener> reopener_;
};

}  // namespace hlm::server
