// The sentences of the vendor's texts that can be read in two ways. The sources' short names are
// explained at the top of force_dimension_fake.cc.
#pragma once

#include <array>

namespace {  // Each fake is one source: two of them in a process share nothing.

enum Doubt {
  kVelocityUpdates,
  kVelocityMissing,
  kOpen,
  kAutoInit,
  kDrdStop,
  kEnableForce,
  kBrakesOff,
  kOpenForce,
  kForceOffSet,
  kForceOffCause,
  kWatchdogFeed,
  kWatchdogDefault,
  kTimeGuardDefault,
  kTimeGuardData,
  kFrameWithoutWrist,
  kAngularWithoutWrist,
  kTorqueWithoutMotors,
  kGripperWithout,
  kEmulateWithoutGripper,
  kEmulatedButton,
  kGripperForceLeft,
  kGripperForceSign,
  kMaxForce,
  kInertia,
  kNames,
  kIds,
  kLastError,
  kStatusFields,
  kOmega6Frame,
  kUncalibrated,
  kClose,
  kDoubts
};

struct Sentence {
  const char* name;
  const char* first;
  const char* second;
  const char* first_means;
  const char* second_means;
  const char* source;
};

constexpr std::array<Sentence, kDoubts> kSentences{{
    {"velocity_updates", "any", "named", "every call that reads the encoders is a position update",
     "only dhdGetPosition and the speed getter itself are: the text names no other",
     "core, getLinearVelocity"},
    {"velocity_missing", "timeout", "zero", "fewer than two updates within the window: -1, TIMEOUT",
     "success and speed zero, as where no such sentence stands", "core, getLinearVelocity; dhdc32"},
    {"open", "shared", "drd_only",
     "drd calls work however the device was opened ('shares some resources')",
     "only after drdOpen or drdOpenID, which all public callers of drd use", "core, DRD reference"},
    {"auto_init", "released", "regulating", "drdAutoInit ends without regulation",
     "it leaves the robot held: forces have no effect until drdStop(true)", "chai3d, saw"},
    {"drd_stop", "ok", "error", "drdStop without regulation succeeds",
     "it fails: no regulation is running (error 22)", "core, ErrorNum; saw ignores it"},
    {"enable_force", "standard", "expert", "dhdEnableForce is a standard call",
     "it is an expert call", "dhdc37; dhdc32, chai3d"},
    {"brakes_off", "kept", "idle", "dhdSetBrakes(off) takes the brakes off",
     "the device is 'forced into IDLE mode': forces are off, too", "core, device modes"},
    {"open_force", "off", "on", "forces are off after opening",
     "they are on: some callers enable them for sigma.7 alone", "core; callers of chai3d"},
    {"force_off_set", "accepted", "refused",
     "a force while forces are off is accepted without effect", "-1, NOT_ENABLED",
     "core, ErrorNum"},
    {"force_off_cause", "current", "last", "status 14 is 0 while forces are on",
     "it keeps the cause of 'the last time forces were turned off'", "core, ForceOffCause"},
    {"watchdog_feed", "communication", "force", "any communication feeds the watchdog",
     "a force command alone does", "core, glossary; setWatchdog"},
    {"watchdog_default", "off", "on", "no watchdog before dhdSetWatchdog",
     "255 units of 125 us: firmware 3.0 'features' it", "core, glossary"},
    {"timeguard_default", "off", "1ms", "no time guard before dhdSetTimeGuard",
     "the 'default recommended value' is in force, here 1 ms", "core, setTimeGuard"},
    {"timeguard_data", "filled", "untouched", "a getter that returns 1 writes the last data",
     "it writes nothing", "core, TimeGuard"},
    {"frame_without_wrist", "error", "identity",
     "pose and frame of a device without wrist: -1, NOT_AVAILABLE",
     "position and identity: saw asks a Falcon so", "core, getPositionAndOrientationFrame; saw"},
    {"angular_without_wrist", "zero", "error", "angular speed without a wrist is zero",
     "-1, NOT_AVAILABLE", "core, getAngularVelocityRad"},
    {"torque_without_motors", "ignored", "error", "a torque that no motor can give is ignored",
     "-1, NOT_AVAILABLE unless it is zero", "core says nothing; icube"},
    {"gripper_without", "error", "zero", "angle of no gripper: -1, NOT_AVAILABLE", "0",
     "core, getGripperAngleRad; saw"},
    {"emulate_without_gripper", "error", "accepted",
     "dhdEmulateButton without gripper: -1, NOT_AVAILABLE", "accepted without effect",
     "core, emulateButton; icube"},
    {"emulated_button", "always", "forces_on", "a gripper's button is emulated at any time",
     "only while forces are on (omega.7, firmware 2.x)", "core, emulateButton"},
    {"gripper_force_left", "reversed", "same",
     "left-handed models reverse the sign of the gripper's force, as that of its angle",
     "they do not", "chai3d, saw; lambda"},
    {"gripper_force_sign", "opens", "closes", "a positive gripper force opens",
     "it closes: 'grasping force'", "chai3d; core, setForceAndGripperForce"},
    {"max_force", "silent", "saturated", "a force cut by dhdSetMaxForce returns 0",
     "it returns MOTOR_SATURATED", "core, setMaxForce"},
    {"inertia", "cartesian", "joint", "the inertia matrix is that of the handle (kg)",
     "it is that of the joints (kg m^2)", "core, jointAnglesToInertiaMatrix; icube"},
    {"names", "plain", "suffixed", "right-handed models have the plain name",
     "'(right-hand)' follows it, as '(left-hand)' does", "a public caller; core, util"},
    {"ids", "index", "other", "the id is the index by which the device was opened",
     "a device 'receives an ID' that differs", "core, openID, multiple devices"},
    {"last_error", "sticky", "cleared", "the last error stays after a success",
     "a success clears it", "core, errorGetLast"},
    {"status_fields", "17", "16", "dhdGetStatus writes 17 fields", "it writes 16", "core; dhdc37"},
    {"omega6_frame", "base", "turned", "the frame of an omega.6 is that of the base",
     "it is turned by 45 degrees about y, as the note says",
     "core, getPositionAndOrientationFrame"},
    {"uncalibrated", "reads", "not_ready", "before calibration positions are read, 20 mm wrong",
     "-1, DEVICE_NOT_READY", "core, RESET mode"},
    {"close", "any", "own", "dhdClose closes what drdOpenID opened", "it refuses", "saw; core"},
}};

}  // namespace
