#include "hlm/devices/force_dimension_library.h"

#include <stdexcept>

namespace hlm::server {

ForceDimensionLibrary::ForceDimensionLibrary(const std::string& file, bool simulator)
    : library(file, {"libdrd.so", "libdrd.so.3", "libdhd.so", "libdhd.so.3"},
              "https://www.forcedimension.com/software/sdk") {
  library.bind_if_any(enable_simulator, "dhdEnableSimulator");
  library.bind(device_count, "dhdGetDeviceCount");
  library.bind(open_id, "dhdOpenID");
  library.bind(open_serial, "dhdOpenSerial");
  library.bind_if_any(robot_open_id, "drdOpenID");
  library.bind_if_any(robot_close, "drdClose");
  library.bind_if_any(is_initialized, "drdIsInitialized");
  library.bind_if_any(auto_init, "drdAutoInit");
  library.bind_if_any(robot_stop, "drdStop");
  library.bind(close, "dhdClose");
  library.bind(stop, "dhdStop");
  library.bind(system_type, "dhdGetSystemType");
  library.bind(system_name, "dhdGetSystemName");
  library.bind_if_any(has_wrist, "dhdHasWrist");
  library.bind(has_active_wrist, "dhdHasActiveWrist");
  library.bind_if_any(has_gripper, "dhdHasGripper");
  library.bind(has_active_gripper, "dhdHasActiveGripper");
  library.bind_if_any(emulate_button, "dhdEmulateButton");
  library.bind(position, "dhdGetPosition");
  library.bind(pose, "dhdGetPositionAndOrientationFrame");
  library.bind(linear_velocity, "dhdGetLinearVelocity");
  library.bind(angular_velocity, "dhdGetAngularVelocityRad");
  library.bind_if_any(config_linear_velocity, "dhdConfigLinearVelocity");
  library.bind_if_any(config_angular_velocity, "dhdConfigAngularVelocity");
  library.bind(gripper_angle, "dhdGetGripperAngleRad");
  library.bind(button_mask, "dhdGetButtonMask");
  library.bind(set_wrench, "dhdSetForceAndTorqueAndGripperForce");
  library.bind(enable_force, "dhdEnableForce");
  library.bind(set_brakes, "dhdSetBrakes");
  library.bind(set_gravity_compensation, "dhdSetGravityCompensation");
  library.bind(set_max_force, "dhdSetMaxForce");
  library.bind(set_max_torque, "dhdSetMaxTorque");
  library.bind(status, "dhdGetStatus");
  library.bind(communication_rate, "dhdGetComFreq");
  library.bind(last_error, "dhdErrorGetLastStr");
  library.bind_if_any(serial_number, "dhdGetSerialNumber");
  library.bind_if_any(enable_expert_mode, "dhdEnableExpertMode");
  library.bind_if_any(set_watchdog, "dhdSetWatchdog");
  library.bind_if_any(joint_angles, "dhdGetJointAngles");
  library.bind_if_any(inertia_matrix, "dhdJointAnglesToInertiaMatrix");
  if (!simulator) return;
  if (enable_simulator == nullptr) {
    throw std::runtime_error(
        "simulator true needs a library with dhdEnableSimulator: " + library.name() + " has none");
  }
  enable_simulator(true);
}

}  // namespace hlm::server
