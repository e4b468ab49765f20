// The C interface of Force Dimension's library as public callers use it, and what the fake adds.
// Written from texts: the header dhdc.h of SDK 3.7.0-pre and 3.2 in public repositories, and the
// argument types of the Python binding forcedimension_core 1.0.0 (SDK 3.16).
// Lengths in m, forces in N, torques in N·m, angles in rad; frame of the device: x to the user,
// y to the right, z up. Default arguments do not exist here: the id is always given, -1 is the
// default device.
#pragma once

extern "C" {

int dhdErrorGetLast();
const char* dhdErrorGetLastStr();
const char* dhdErrorGetStr(int error);
void dhdEnableSimulator(bool on);
int dhdGetDeviceCount();
int dhdGetAvailableCount();
int dhdSetDevice(char id);
int dhdGetDeviceID();
int dhdGetSerialNumber(unsigned short* number, char id);
int dhdOpen();
int dhdOpenType(int type);
int dhdOpenSerial(int serial);
int dhdOpenID(char index);
int dhdClose(char id);
int dhdStop(char id);
int dhdGetComMode(char id);
int dhdEnableForce(unsigned char on, char id);
int dhdEnableGripperForce(unsigned char on, char id);
int dhdGetSystemType(char id);
const char* dhdGetSystemName(char id);
int dhdGetVersion(double* version, char id);
void dhdGetSDKVersion(int* major, int* minor, int* release, int* revision);
int dhdGetStatus(int* status, char id);
int dhdGetEffectorMass(double* mass, char id);
int dhdSetEffectorMass(double mass, char id);
int dhdGetButton(int index, char id);
unsigned int dhdGetButtonMask(char id);
bool dhdIsLeftHanded(char id);
bool dhdHasBase(char id);
bool dhdHasWrist(char id);
bool dhdHasActiveWrist(char id);
bool dhdHasGripper(char id);
bool dhdHasActiveGripper(char id);
int dhdReset(char id);
int dhdWaitForReset(int timeout_ms, char id);
int dhdSetStandardGravity(double g, char id);
int dhdSetGravityCompensation(int on, char id);
int dhdSetBrakes(int on, char id);
int dhdSetDeviceAngleRad(double angle, char id);
int dhdGetPosition(double* x, double* y, double* z, char id);
int dhdGetOrientationRad(double* a, double* b, double* c, char id);
int dhdGetOrientationFrame(double matrix[3][3], char id);
int dhdGetPositionAndOrientationRad(double* x, double* y, double* z, double* a, double* b,
                                    double* c, char id);
int dhdGetPositionAndOrientationFrame(double* x, double* y, double* z, double matrix[3][3],
                                      char id);
int dhdGetGripperAngleRad(double* angle, char id);
int dhdGetGripperAngleDeg(double* angle, char id);
int dhdGetGripperGap(double* gap, char id);
double dhdGetComFreq(char id);
int dhdConfigLinearVelocity(int ms, int mode, char id);
int dhdConfigAngularVelocity(int ms, int mode, char id);
int dhdConfigGripperVelocity(int ms, int mode, char id);
int dhdGetLinearVelocity(double* x, double* y, double* z, char id);
int dhdGetAngularVelocityRad(double* x, double* y, double* z, char id);
int dhdGetGripperAngularVelocityRad(double* speed, char id);
int dhdSetForce(double x, double y, double z, char id);
int dhdSetForceAndTorque(double x, double y, double z, double a, double b, double c, char id);
int dhdSetForceAndGripperForce(double x, double y, double z, double gripper, char id);
int dhdSetForceAndTorqueAndGripperForce(double x, double y, double z, double a, double b, double c,
                                        double gripper, char id);
int dhdGetForce(double* x, double* y, double* z, char id);
int dhdGetForceAndTorqueAndGripperForce(double* x, double* y, double* z, double* a, double* b,
                                        double* c, double* gripper, char id);
int dhdEmulateButton(unsigned char on, char id);
int dhdSetMaxForce(double limit, char id);
int dhdSetMaxTorque(double limit, char id);
int dhdSetMaxGripperForce(double limit, char id);
double dhdGetMaxForce(char id);
double dhdGetMaxTorque(char id);
double dhdGetMaxGripperForce(char id);
int dhdSetVibration(double hz, double amplitude, int type, char id);
// Expert calls.
int dhdEnableExpertMode();
int dhdDisableExpertMode();
int dhdSetTimeGuard(int us, char id);
int dhdSetVelocityThreshold(unsigned int value, char id);
int dhdGetVelocityThreshold(unsigned int* value, char id);
int dhdSetWatchdog(unsigned char units, char id);
int dhdGetWatchdog(unsigned char* units, char id);
int dhdUpdateEncoders(char id);
int dhdGetJointAngles(double* joints, char id);
int dhdGetJointAngleRange(double* low, double* high, char id);
int dhdJointAnglesToInertiaMatrix(double* joints, double inertia[6][6], char id);
int dhdSetComMode(int mode, char id);
// Independent of a device.
bool dhdKbHit();
double dhdGetTime();
void dhdSleep(double seconds);
// The robotic library; absent from libdhd.
int drdOpen();
int drdOpenID(char index);
int drdSetDevice(char id);
int drdGetDeviceID();
int drdClose(char id);
bool drdIsSupported(char id);
bool drdIsInitialized(char id);
bool drdIsRunning(char id);
bool drdIsMoving(char id);
int drdAutoInit(char id);
int drdCheckInit(char id);
int drdStart(char id);
int drdStop(bool force_on, char id);
int drdRegulatePos(bool on, char id);
int drdRegulateRot(bool on, char id);
int drdRegulateGrip(bool on, char id);

// What no vendor has. The clock is the machine's until fake_advance is called once (or
// FAKE_DHD_CLOCK=virtual is set); from then on it moves by fake_advance and dhdSleep alone.
// Everything as after loading, with this model and these readings (comma-separated NAME:ANSWER,
// or "first" or "second" for all; later entries win). False, with a line on stderr, if one of them
// is unknown.
bool fake_configure(const char* model, const char* readings);
// Doubtful sentence number i as "NAME:FIRST|SECOND", nullptr past the last.
const char* fake_doubt(int i);
void fake_advance(double seconds);
// The hand: a spring (N/m) with damping (N·s/m) to an anchor (m) in the device frame.
void fake_set_hand(double x, double y, double z, double stiffness, double damping);
// Rotation vector (rad) to which the hand turns a wrist.
void fake_set_hand_rotation(double x, double y, double z);
void fake_set_gripper_hand(double angle);  // Opening (rad, not negative) at which fingers hold it.
void fake_press(int button, bool down);
void fake_force_button();  // Somebody presses the force button on the base: forces off.
void fake_calibrate();     // Somebody puts the handle into the calibration pit.
void fake_unplug();
// The true state of the first device: position (m), velocity (m/s), force of the motors (N),
// gripper opening (rad, not negative), force on the gripper in the direction of opening (N).
void fake_truth(double position[3], double velocity[3], double force[3], double* gripper,
                double* gripper_force);

}  // extern "C"
