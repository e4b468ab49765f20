// 3D Systems' Touch and Phantom devices, through OpenHaptics.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "hlm/common/latest_value.h"
#include "hlm/common/range.h"
#include "hlm/devices/motion_check.h"
#include "hlm/devices/open_haptics_library.h"
#include "hlm/devices/reopener.h"
#include "hlm/devices/speed_filter.h"
#include "hlm/haptic_server/device/device.h"
#include "hlm/haptic_server/device/device_model.h"

namespace hlm::server {

struct OpenHapticsOptions {
  std::string library{};  ///< File of the vendor's library; empty: searched.
  std::string unit{};     ///< Name in the vendor's setup; empty: the first of kOpenHapticsUnits.
  double rate = 1000;     ///< Rate of the vendor's scheduler, Hz.
  /// Cut-off of the low-pass on the change of position, Hz, which is the speed that is reported;
  /// unset: that of the model; 0: the library's own, which is smoothed by some 20 Hz. Less lags,
  /// and a stiff wall shakes; more lets the encoders' steps through, so that the coupling may damp
  /// less.
  std::optional<double> velocity_cutoff{};
  /// Oldest state and oldest command that are used, s. Less ends sessions when the machine is busy;
  /// more lets a force outlive what it answers.
  double oldest = 0.015;
};

/// What the vendor's setup calls a device unless it is told otherwise: current drivers, older ones.
inline constexpr std::array<const char*, 2> kOpenHapticsUnits{"Default Device", "Default PHANToM"};
/// Of these the library takes 500, 1000 and 2000.
inline constexpr Range kOpenHapticsRates{500, 2000, "Hz"};
inline constexpr Range kOpenHapticsCutOffs{0, 500, "Hz"};
inline constexpr Range kOpenHapticsAges{0.005, 0.1, "s"};

/// From the vendor's data sheets.
std::span<const DeviceModel> open_haptics_models() noexcept;

/// What a device of that model is rated for with these options.
DeviceRatings open_haptics_ratings(const DeviceModel& model, const OpenHapticsOptions& options);

/// The vendor's scheduler exchanges with the device in a thread of its own: it reads a state and
/// gives the latest command. The servo thread reads the latest state and leaves a command; it calls
/// nothing of the vendor's and never waits. A state or a command that is too old counts as none.
/// Force only: the torques of a 6-DOF stylus are those of its joints, and stay zero.
class OpenHapticsDevice final : public Device {
 public:
  /// Opens the device, motors off. Throws std::runtime_error.
  OpenHapticsDevice(std::shared_ptr<const OpenHapticsLibrary> library,
                    const OpenHapticsOptions& options);
  ~OpenHapticsDevice() override;

  std::string_view name() const noexcept override { return name_; }
  const DeviceRatings& ratings() const noexcept override { return ratings_; }
  bool measures_hand_wrench() const noexcept override { return false; }
  /// Waits for the first state and for its calibration. Throws std::runtime_error that says what a
  /// person has to do.
  void calibrate() override;
  void align(const Pose&) noexcept override {}
  void enable() noexcept override;
  void disable() noexcept override;
  std::optional<DeviceState> read() noexcept override;
  bool write(const Wrench& F) noexcept override;
  const char* cause() const noexcept override { return cause_; }
  /// Its name in the vendor's setup.
  const std::string& unit() const noexcept { return options_.unit; }

 private:
  using Clock = std::chrono::steady_clock;

  /// What the library reported since it was asked last.
  struct Errors {
    unsigned failure = 0;  ///< Code of the first that is a failure; 0: none is.
    bool saturated = false;
    bool warm = false;
    bool no_frame = false;
  };
  struct Reading {
    Clock::time_point time{};
    Vector3 p = Vector3::Zero();  ///< m.
    Matrix3 R = Matrix3::Identity();
    Twist V = Twist::Zero();      ///< As the library says, m/s and rad/s.
    Vector3 v = Vector3::Zero();  ///< Speed that is reported, m/s.
    std::uint32_t buttons = 0;
    bool saturated = false;
    bool warm = false;
  };
  struct Command {
    Clock::time_point time{};
    Vector3 force = Vector3::Zero();  ///< N.
  };

  /// Opens nothing. When a constructor that begins with this one throws, the destructor runs.
  OpenHapticsDevice(const OpenHapticsOptions& options,
                    std::shared_ptr<const OpenHapticsLibrary> library)
      : library_(std::move(library)), options_(options) {}

  /// Null if the device is open, its motors off and its scheduler at rest; otherwise why not.
  const char* open() noexcept;
  void open_first();
  void update_calibration() noexcept;
  /// Null if the scheduler runs, otherwise why not.
  const char* start() noexcept;
  void close() noexcept;
  void throw_if(const char* why) const;
  [[noreturn]] void refuse(const std::string& unit, const std::string& why) const;
  static Errors errors(const OpenHapticsLibrary& hd) noexcept;
  static unsigned exchange(void* device) noexcept;
  void exchange() noexcept;
  Reading read_frame() noexcept;
  void observe_temperature() noexcept;
  bool is_real(const Reading& reading, const Errors& reported) noexcept;
  std::optional<DeviceState> fail(const char* cause) noexcept;

  std::shared_ptr<const OpenHapticsLibrary> library_;
  OpenHapticsOptions options_;
  std::string name_;
  DeviceRatings ratings_;
  OpenHapticsLibrary::Handle handle_ = OpenHapticsLibrary::kNoDevice;
  unsigned long callback_ = 0;

  // Between the servo's thread and the scheduler's.
  LatestValue<Reading> readings_;
  LatestValue<Command> commands_;
  std::atomic<bool> enabled_ = false;
  std::atomic<unsigned> calibration_ = OpenHapticsLibrary::kCalibrated;
  std::atomic<unsigned> error_ = 0;  ///< The library's code of the first failure since enable().

  // Used by the scheduler's thread.
  SpeedFilter speed_;
  double cutoff_ = 0;            ///< Cut-off of the speed that is reported, Hz.
  Clock::time_point started_{};  ///< When the scheduler was started.
  bool gives_frames_ = false;    ///< A real one has come since.
  bool warm_ = false;            ///< Its motors say that they get warm.
  bool says_temperature_ = true;
  std::uint64_t frames_ = 0;
  bool gives_force_ = false;  ///< The motors are on; used by the scheduler's thread.

  // Used by the servo thread.
  MotionCheck motion_;
  bool failed_ = false;  ///< A failure since enable().
  const char* cause_ = "";
  std::optional<Reopener> reopener_;
};

}  // namespace hlm::server
