// The functions of Force Dimension's library that are called here.
#pragma once

#include <array>
#include <string>

#include "hlm/devices/vendor_library.h"

namespace hlm::server {

/// Declared from the vendor's documents. Lengths in m, angles in rad, forces in N and N·m. Below 0
/// is an error, except where it says otherwise. The last char is always the device's number.
struct ForceDimensionLibrary {
  /// Opens libdrd.so, which contains libdhd.so, or that one alone. Throws std::runtime_error.
  /// simulator: also find the vendor's simulator on this machine.
  explicit ForceDimensionLibrary(const std::string& file, bool simulator = false);

  /// What getters and the wrench return that is no error.
  enum Result { kDone = 0, kTimeGuard = 1, kMotorSaturated = 2 };
  /// What dhdGetStatus tells, and how much of it.
  enum Status { kPower = 0, kReset = 3, kForceOn = 5, kForceOffCause = 14, kStatusCount = 17 };
  /// How a speed is estimated.
  enum Estimate { kMeanOverWindow = 0 };
  static constexpr std::size_t kJoints = 8;
  /// Room for libraries that tell more.
  using StatusValues = std::array<int, 2 * kStatusCount>;

  VendorLibrary library;

  /// Lets the vendor's simulator on this machine count as a device. May be null.
  void (*enable_simulator)(bool on);
  int (*device_count)();
  /// The number of the device to use.
  int (*open_id)(char index);
  int (*open_serial)(int serial);
  /// Those of libdrd.so; null in libdhd.so. What the others of these ask was opened so.
  int (*robot_open_id)(char index);
  int (*robot_close)(char id);
  /// Whether it is calibrated.
  bool (*is_initialized)(char id);
  /// Calibrates it: moves it by its motors, which takes seconds.
  int (*auto_init)(char id);
  /// Ends the library's own control of it.
  int (*robot_stop)(bool keeps_force_on, char id);
  int (*close)(char id);
  /// Motors off, brakes on.
  int (*stop)(char id);
  int (*system_type)(char id);
  const char* (*system_name)(char id);
  /// May be null.
  int (*serial_number)(unsigned short* serial, char id);
  /// May be null: then only active wrists are known.
  bool (*has_wrist)(char id);
  bool (*has_active_wrist)(char id);
  /// Whether it has a gripper at all; may be null: then only those with motors are known.
  bool (*has_gripper)(char id);
  bool (*has_active_gripper)(char id);
  /// A closed gripper then counts as a pressed button 0. May be null.
  int (*emulate_button)(unsigned char on, char id);
  int (*position)(double* x, double* y, double* z, char id);
  /// Of devices with a wrist only.
  int (*pose)(double* x, double* y, double* z, double rotation[3][3], char id);
  /// These fail, too, as long as fewer than two positions fell into the window of the mean.
  int (*linear_velocity)(double* x, double* y, double* z, char id);
  int (*angular_velocity)(double* x, double* y, double* z, char id);
  /// Set how the speeds are estimated; window in ms. May be null.
  int (*config_linear_velocity)(int window, int mode, char id);
  int (*config_angular_velocity)(int window, int mode, char id);
  int (*gripper_angle)(double* angle, char id);
  unsigned (*button_mask)(char id);
  int (*set_wrench)(double fx, double fy, double fz, double tx, double ty, double tz,
                    double gripper, char id);
  int (*enable_force)(unsigned char on, char id);
  int (*set_brakes)(int on, char id);
  int (*set_gravity_compensation)(int on, char id);
  int (*set_max_force)(double most, char id);
  int (*set_max_torque)(double most, char id);
  int (*status)(int values[], char id);
  /// kHz.
  double (*communication_rate)(char id);
  /// A constant text.
  const char* (*last_error)();
  /// May be null: older libraries have none.
  int (*enable_expert_mode)();
  /// Sets the watchdog, in units of 125 µs. May be null.
  int (*set_watchdog)(unsigned char time, char id);
  /// In expert mode; may be null, both. Angles: kJoints of them, rad.
  int (*joint_angles)(double* angles, char id);
  /// Inertia at the handle in the device's frame: kg, kg·m and kg·m².
  int (*inertia_matrix)(const double* angles, double inertia[6][6], char id);
};

}  // namespace hlm::server
