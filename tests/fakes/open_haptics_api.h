// The C interface of OpenHaptics' device library (libHD) as public callers use it, and what the
// fake adds. Written from texts: hdDefines.h of OpenHaptics 3.0 in public repositories, the types
// in pyOpenHaptics 1.0.1, and the prototypes and parameter tables that OpenHaptics4CSharp quotes
// from the API reference 3.5.
// Lengths in mm, speeds in mm/s, forces in N, angles in rad; x to the right, y up, z to the user.
#pragma once

extern "C" {

using HDuint = unsigned int;
using HDenum = unsigned int;
using HDerror = unsigned int;
using HHD = unsigned int;
using HDboolean = unsigned char;
using HDSchedulerHandle = unsigned long;
using HDCallbackCode = unsigned int;
using HDSchedulerCallback = HDCallbackCode (*)(void*);

struct HDErrorInfo {
  HDerror errorCode;
  int internalErrorCode;
  HHD hHD;
};

HHD hdInitDevice(const char* name);
void hdDisableDevice(HHD device);
void hdMakeCurrentDevice(HHD device);
HHD hdGetCurrentDevice();
void hdBeginFrame(HHD device);
void hdEndFrame(HHD device);
HDErrorInfo hdGetError();
const char* hdGetErrorString(HDerror code);
void hdEnable(HDenum capability);
void hdDisable(HDenum capability);
HDboolean hdIsEnabled(HDenum capability);
void hdGetBooleanv(HDenum name, HDboolean* values);
void hdGetIntegerv(HDenum name, int* values);
void hdGetFloatv(HDenum name, float* values);
void hdGetDoublev(HDenum name, double* values);
void hdGetLongv(HDenum name, long* values);
void hdSetFloatv(HDenum name, const float* values);
void hdSetDoublev(HDenum name, const double* values);
const char* hdGetString(HDenum name);
HDenum hdCheckCalibration();
HDenum hdCheckCalibrationStyle();
void hdUpdateCalibration(HDenum style);
void hdStartScheduler();
void hdStopScheduler();
void hdSetSchedulerRate(unsigned long hz);
double hdGetSchedulerTimeStamp();
void hdScheduleSynchronous(HDSchedulerCallback callback, void* data, unsigned short priority);
HDSchedulerHandle hdScheduleAsynchronous(HDSchedulerCallback callback, void* data,
                                         unsigned short priority);
void hdUnschedule(HDSchedulerHandle handle);
HDboolean hdWaitForCompletion(HDSchedulerHandle handle, HDenum mode);

// What no vendor has.
// Everything as after loading, with these readings (NAME:ANSWER,…, or "first" or "second" for all).
// The scheduler must be stopped. False, with a line on stderr, for an unknown word.
bool fake_configure(const char* readings);
// Doubtful sentence number i as "NAME:FIRST|SECOND", nullptr past the last.
const char* fake_doubt(int i);
// From the first call on (or with FAKE_HD_CLOCK=virtual) until fake_configure the scheduler's
// thread ticks only when it is told to: this call returns after the ticks of so many seconds.
void fake_advance(double seconds);
// The hand: a spring (N/m) with damping (N·s/m) to an anchor (m).
void fake_set_hand(double x, double y, double z, double stiffness, double damping);
void fake_press(int button, bool down);
void fake_inkwell(bool in);
void fake_set_calibration(HDenum state);
void fake_unplug();
// The true position (m), velocity (m/s) and force of the motors (N).
void fake_truth(double position[3], double velocity[3], double force[3]);

}  // extern "C"
