// Force Dimension's devices: omega, delta, sigma, lambda.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "hlm/common/range.h"
#include "hlm/devices/force_dimension_library.h"
#include "hlm/devices/motion_check.h"
#include "hlm/devices/reopener.h"
#include "hlm/devices/speed_filter.h"
#include "hlm/haptic_server/device/device.h"
#include "hlm/haptic_server/device/device_model.h"

namespace hlm::server {

struct ForceDimensionOptions {
  std::string library{};   ///< File of the vendor's library; empty: searched.
  bool simulator = false;  ///< Whether the vendor's simulator on this machine is found, too.
  int number = 0;  ///< Number of the device among those connected, if it has no serial number here.
  int serial = 0;  ///< Serial number of the device; 0: by `number`.
  /// Time without a wrench after which the device takes its motors off, s. Less ends sessions when
  /// the machine is busy; more lets a force outlive a server that was killed.
  double watchdog = 0.016;
  bool gravity_compensation = true;  ///< Whether the device carries its own weight.
  /// Whether the library calibrates a device that is not: its motors then move it, with nobody's
  /// hand on it.
  bool auto_init = false;
  /// Cut-off of the low-pass on the change of pose, Hz, which is the speed that is reported; unset:
  /// that of the model; 0: the library's own.
  std::optional<double> velocity_cutoff{};
  /// Time over which the library takes its own speed as the mean, s. The vendor's 20 ms lag by 10
  /// ms, in which a damping pushes; less lets more of the encoders' steps through, and may be
  /// shorter than the time between two positions.
  double velocity_window = 0.02;
};

/// A byte of the vendor's 125 µs.
inline constexpr Range kForceDimensionWatchdogs{0.001, 0.031875, "s"};
/// The vendor's unit is 1 ms.
inline constexpr Range kForceDimensionWindows{0.001, 0.05, "s"};
inline constexpr Range kForceDimensionCutOffs{0, 500, "Hz"};
inline constexpr Range kForceDimensionNumbers{0, 15};
inline constexpr Range kForceDimensionSerials{0, 65535};

/// From the vendor's documents.
std::span<const DeviceModel> force_dimension_models() noexcept;

/// What a device of that model is rated for at its handle. active_wrist: whether its wrist has
/// motors. dt: servo period, s.
DeviceRatings force_dimension_ratings(const DeviceModel& model, bool active_wrist,
                                      const ForceDimensionOptions& options, double dt) noexcept;

/// What the vendor's number of a reason says.
const char* cause_of_force_off(int cause) noexcept;

/// Exchanges with the device in the servo thread, by the vendor's own calls and no others. The
/// device's velocity threshold stays as it is. What is wrong is found within 20 ms: a call that
/// fails, values that are not new or not possible, motors that are off.
class ForceDimensionDevice final : public Device {
 public:
  /// dt: servo period, s. Opens the device, motors off. Throws std::runtime_error.
  ForceDimensionDevice(std::shared_ptr<const ForceDimensionLibrary> library,
                       const ForceDimensionOptions& options, double dt);
  ~ForceDimensionDevice() override;

  std::string_view name() const noexcept override { return name_; }
  const DeviceRatings& ratings() const noexcept override { return ratings_; }
  bool measures_hand_wrench() const noexcept override { return false; }
  /// Throws std::runtime_error that says what has to be done where the device has no power or is
  /// not calibrated.
  void calibrate() override;
  void align(const Pose&) noexcept override {}
  void enable() noexcept override;
  void disable() noexcept override;
  std::optional<DeviceState> read() noexcept override;
  bool write(const Wrench& F) noexcept override;
  void grip(double force) noexcept override;
  const char* cause() const noexcept override {
    const char* const refused = refused_.load();
    return *refused != '\0' ? refused : cause_;
  }

 private:
  void open();
  int open_number(int number) noexcept;
  int open_serial() noexcept;
  void close() noexcept;
  void auto_init();
  const char* find_unready() noexcept;
  bool is_reset(const ForceDimensionLibrary::StatusValues& status) const noexcept;
  std::string model() const;
  int serial() const noexcept;
  bool prepare() noexcept;
  void configure_speed() noexcept;
  void read_inertia() noexcept;
  bool reopen();
  const char* prepare_again();
  bool done(int result) noexcept;
  bool fail(const char* cause) noexcept;
  int read_pose(Vector3& p, Matrix3& R) noexcept;
  bool read_motion(DeviceState& state) noexcept;
  Twist read_speed(const Twist& own) noexcept;
  void read_gripper(DeviceState& state) noexcept;
  bool observe_status() noexcept;

  std::shared_ptr<const ForceDimensionLibrary> library_;
  ForceDimensionOptions options_;
  double dt_;
  MotionCheck motion_;
  std::string name_;
  int serial_ = 0;  ///< Serial number as the device says; 0: the library does not.
  DeviceRatings ratings_;
  const DeviceModel* model_ = nullptr;  ///< Its row.
  bool has_wrist_ = false;
  bool is_robot_ = false;  ///< Opened by libdrd.so's own call.
  bool has_watchdog_ = false;
  double window_ = 0;  ///< Window of the library's speed, s.
  double cutoff_ = 0;  ///< Cut-off of the speed that is reported, Hz; 0: the library's own.
  SpeedFilter speed_;  ///< Speed of the poses.
  Vector3 p_ = Vector3::Zero();  ///< Latest pose.
  Matrix3 R_ = Matrix3::Identity();
  double grip_ = 0;  ///< Commanded force of the gripper, N.

  char id_ = 0;
  bool enabled_ = false;
  bool failed_ = false;     ///< A failure since enable().
  bool saturated_ = false;  ///< The latest write() was saturated.
  DeviceHealth health_ = DeviceHealth::kGood;
  const char* cause_ = "";
  /// Why the device that was opened last is not used; empty: there is none such.
  std::atomic<const char*> refused_ = "";
  std::uint64_t ticks_ = 0;  ///< Ticks since enable().
  std::optional<Reopener> reopener_;
};

}  // namespace hlm::server
