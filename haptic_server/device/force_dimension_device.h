// Force Dimension's devices: omega, delta, sigma, lambda.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "hlm/common/range.h"
#include "hlm/device/device.h"
#include "hlm/device/force_dimension_library.h"
#include "hlm/device/motion_check.h"
#include "hlm/device/reopener.h"

namespace hlm::server {

struct ForceDimensionOptions {
  std::string library{};  ///< File of the vendor's library; empty: searched.
  int number = 0;  ///< Number of the device among those connected, if it has no serial number here.
  int serial = 0;  ///< Serial number of the device; 0: by `number`.
  /// Time without a wrench after which the device takes its motors off, s. Less ends sessions when
  /// the machine is busy; more lets a force outlive a server that was killed.
  double watchdog = 0.016;
  bool gravity_compensation = true;  ///< Whether the device carries its own weight.
};

/// A byte of the vendor's 125 µs.
inline constexpr Range kForceDimensionWatchdogs{0.001, 0.031875, "s"};
inline constexpr Range kForceDimensionNumbers{0, 15};
inline constexpr Range kForceDimensionSerials{0, 65535};

/// What a device of that name is rated for at its handle, from the vendor's documents; little where
/// these are not known here. torque: whether its wrist has motors.
DeviceRatings force_dimension_ratings(std::string_view name, bool torque) noexcept;

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
  void align(const Pose&) noexcept override {}
  void enable() noexcept override;
  void disable() noexcept override;
  std::optional<DeviceState> read() noexcept override;
  bool write(const Wrench& F) noexcept override;
  const char* cause() const noexcept override {
    const char* const refused = refused_.load();
    return *refused != '\0' ? refused : cause_;
  }

 private:
  void open();
  std::string model() const;
  int serial() const noexcept;
  bool prepare() noexcept;
  bool reopen();
  const char* prepare_again();
  bool done(int result) noexcept;
  bool fail(const char* cause) noexcept;
  bool read_motion(DeviceState& state) noexcept;
  bool read_buttons(DeviceState& state) noexcept;
  bool observe_status() noexcept;

  std::shared_ptr<const ForceDimensionLibrary> library_;
  ForceDimensionOptions options_;
  double dt_;
  MotionCheck motion_;
  std::string name_;
  int serial_ = 0;  ///< Serial number as the device says; 0: the library does not.
  DeviceRatings ratings_;
  bool has_wrist_ = false;
  bool has_watchdog_ = false;

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
