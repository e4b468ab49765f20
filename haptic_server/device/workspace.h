// How a device's own space lies in the world: its frame, its scales, its clutch, its limits.
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <string>

#include "hlm/common/settings/table.h"
#include "hlm/haptic_server/device/device.h"

namespace hlm::server {

/// Keys that every [device] table has.
///
/// With s metres and r radians of the world for one of the handle, forces are those of the world
/// and torques r / s times as large: then the world's power is s times the handle's, in translation
/// and in rotation.
struct Workspace {
  /// Where the device's x, y and z point in the world, as "-z x y", or its roll, pitch and yaw
  /// there, degrees, as "0 0 90".
  std::string frame = "x y z";
  double scale = 1;           ///< s.
  double rotation_scale = 1;  ///< r.
  int clutch = 0;             ///< Button that frees the handle, from 1; 0: none.
  double max_force = std::numeric_limits<double>::infinity();   ///< Most at the handle, N.
  double max_torque = std::numeric_limits<double>::infinity();  ///< Most at the handle, N·m.

  bool operator==(const Workspace&) const = default;
};

/// Declares the keys, bound to `workspace`.
void add_keys(settings::Table& table, Workspace& workspace);

/// Why it cannot be used, naming the key, its value and what is allowed; empty if valid.
std::optional<std::string> find_error(const Workspace& workspace);

/// R_WB of its frame: where the axes of the device's base B point in the world. `workspace` must be
/// valid.
Matrix3 rotation_of(const Workspace& workspace);

/// What a device that is rated so at its handle is rated for in the world.
DeviceRatings ratings_in_world(const DeviceRatings& handle, const Workspace& workspace) noexcept;

/// A device that reports its own frame and metres, seen from the world. Its poses count relative to
/// where the handle was when it was aligned, turn by turn: with a rotation scale other than 1 a
/// handle that returns by another way is in the world not quite where it was.
///
/// While the clutch is held, force fades and the handle moves freely: once the device is without
/// force its pose in the world stays. What the handle does before that still counts.
class WorkspaceDevice final : public Device, private GuidedHand {
 public:
  /// `workspace` must be valid (find_error), its clutch a button of the device.
  WorkspaceDevice(std::unique_ptr<Device> raw, const Workspace& workspace);

  std::string_view name() const noexcept override { return raw_->name(); }
  const DeviceRatings& ratings() const noexcept override { return ratings_; }
  bool measures_hand_wrench() const noexcept override { return raw_->measures_hand_wrench(); }
  bool observes_hand_wrench() const noexcept override { return raw_->observes_hand_wrench(); }
  void calibrate() override { raw_->calibrate(); }
  void align(const Pose& X_WH) noexcept override;
  void enable() noexcept override { raw_->enable(); }
  void disable() noexcept override { raw_->disable(); }
  GuidedHand* guided_hand() noexcept override;
  std::optional<DeviceState> read() noexcept override;
  bool write(const Wrench& F) noexcept override;
  void grip(double force) noexcept override { raw_->grip(force); }
  void halt() noexcept override { raw_->halt(); }
  const char* cause() const noexcept override { return raw_->cause(); }

 private:
  void hold(const Pose& X_WTarget) noexcept override;
  void release() noexcept override { raw_->guided_hand()->release(); }
  void follow(const Pose& X_B) noexcept;
  Vector6 to_world(const Vector6& v, double linear, double angular) const noexcept;
  Vector6 to_device(const Vector6& v, double linear, double angular) const noexcept;

  std::unique_ptr<Device> raw_;
  Matrix3 R_WB_;  ///< B: the device's base, its own frame.
  double scale_;
  double rotation_scale_;
  std::uint32_t clutch_;  ///< Mask of its button.
  DeviceRatings ratings_;

  bool aligns_ = true;      ///< The next pose read is where the handle is aligned.
  bool has_force_ = false;  ///< The latest wrench was not zero.
  Pose X_BD_;               ///< Handle in the device's own frame, as read last.
  Pose X_WD_;               ///< The same in the world.
};

}  // namespace hlm::server
