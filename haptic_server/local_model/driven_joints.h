// The drives of the tool's joints, in the step of the proxy (docs/method.md 22).
#pragma once

#include <optional>

#include "hlm/common/joint_drive.h"
#include "hlm/common/tool_model.h"

namespace hlm::server {

/// Each is implicit, at the end of a step, and one at its largest force is a constant force.
class DrivenJoints {
 public:
  /// What an update says; what drove a coordinate before goes on from where it is.
  void adopt(const JointDrives& drives, const ToolModel& tool) noexcept;
  /// A step of dt, s, begins. opening: of the device's gripper, 0 closed to 1 open, if it has one.
  void begin_step(const ToolModel& proxy, std::optional<double> opening, double dt) noexcept;
  /// Adds what acts to E v⁺ = r.
  void add_to(MassMatrix& E, GeneralisedForce& r) const noexcept;
  /// Whether a drive is at its limit at v⁺ and was not taken so, or the other way round: then the
  /// step is to be solved again. It is at most once in a step.
  bool revise(const Velocity& v) noexcept;
  /// The step ends with v⁺, and contacts alone did tau. What the drives did.
  GeneralisedForce end_step(const Velocity& v, const GeneralisedForce& tau) noexcept;

  /// Force of contacts that opens the gripper, N or N·m of its coordinate, in the latest step; of
  /// several drives their sum.
  double grip() const noexcept { return grip_; }
  /// What they do to the opening of the device's gripper, J for all of it: by virtual work on the
  /// coordinates that it leads.
  double opening_force() const noexcept { return opening_force_; }

 private:
  struct Driven {
    JointDrive drive;
    int coordinate = 0;    ///< Of q̇.
    double at_limit = 0;   ///< Sign of its force, which is at its limit; 0: it is not.
    double constant = 0;   ///< Its force in this step without velocity,
    double impedance = 0;  ///< and what it resists with, N·s/m or N·m·s/rad.

    double force(double v) const noexcept { return constant - impedance * v; }
    double limited(double v) const noexcept;
  };
  StaticVector<Driven, kMaxDof> driven_;
  double dt_ = 0;
  double grip_ = 0;
  double opening_force_ = 0;
};

}  // namespace hlm::server
