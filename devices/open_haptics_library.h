// The functions of 3D Systems' OpenHaptics, its HDAPI, that are called here.
#pragma once

#include <string>

#include "hlm/devices/vendor_library.h"

namespace hlm::server {

/// Declared from the vendor's documents. Lengths in mm, forces in N, angles in rad. What goes wrong
/// is reported by get_error() alone.
struct OpenHapticsLibrary {
  /// Opens libHD.so. Throws std::runtime_error.
  explicit OpenHapticsLibrary(const std::string& file);

  using Handle = unsigned;
  static constexpr Handle kNoDevice = 0xFFFFFFFF;
  struct Error {
    unsigned code;
    int internal;
    Handle device;
  };
  /// Called by the vendor's scheduler in each of its periods, as long as it returns kContinue.
  using Callback = unsigned (*)(void* data);
  static constexpr unsigned kContinue = 1;
  static constexpr unsigned short kHighestPriority = 0xFFFF;

  enum Parameter : unsigned {
    kButtons = 0x2000,
    kVelocity = 0x2051,
    kTransform = 0x2052,  ///< 16 numbers, by columns.
    kAngularVelocity = 0x2053,
    kModel = 0x2501,
    kCalibrationStyle = 0x2555,  ///< Bits of CalibrationStyle.
    kMaxStiffness = 0x2602,      ///< N/mm.
    kMaxForce = 0x2603,
    kMaxContinuousForce = 0x2604,
    kMotorTemperature = 0x2605,  ///< 3 or 6 numbers, 0 coldest to 1 warmest.
    kForce = 0x2700,
    kForceOutput = 0x4000,
    kForceClamping = 0x4001,
  };

  enum Calibration : unsigned { kCalibrated = 0x5000, kNeedsUpdate, kNeedsManualInput };
  /// How a device is calibrated: held in its reset posture, while it is moved, in its inkwell.
  enum CalibrationStyle { kEncoderReset = 1, kAuto = 2, kInkwell = 4 };

  VendorLibrary library;

  Handle (*init_device)(const char* name);
  void (*disable_device)(Handle device);
  void (*make_current)(Handle device);
  void (*begin_frame)(Handle device);
  void (*end_frame)(Handle device);
  /// The latest error of a stack, which it takes off; code 0: the stack is empty.
  Error (*get_error)();
  void (*enable)(unsigned capability);
  void (*disable)(unsigned capability);
  void (*get_doubles)(unsigned parameter, double* values);
  void (*get_integers)(unsigned parameter, int* values);
  void (*set_doubles)(unsigned parameter, const double* values);
  const char* (*get_string)(unsigned parameter);
  /// May be null, both.
  unsigned (*check_calibration)();
  void (*update_calibration)(unsigned style);
  unsigned long (*schedule)(Callback callback, void* data, unsigned short priority);
  void (*unschedule)(unsigned long callback);
  void (*start_scheduler)();
  void (*stop_scheduler)();
  void (*set_scheduler_rate)(unsigned long rate);
};

/// What an error of the library says; null for none, and for what is no failure.
const char* cause_of_error(unsigned code) noexcept;
/// Whether it says that the motors give less than was commanded.
bool says_saturated(unsigned code) noexcept;
/// Whether it says that the motors get warm.
bool says_warm(unsigned code) noexcept;
/// Whether it says that what was read is no frame of the device: so for some milliseconds after the
/// scheduler started.
bool says_no_frame(unsigned code) noexcept;

}  // namespace hlm::server
