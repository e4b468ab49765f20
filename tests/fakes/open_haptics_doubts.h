// The sentences about libHD that can be read in two ways. The sources' short names are explained at
// the top of open_haptics_fake.cc.
#pragma once

#include <array>

#include "doubts.h"

namespace {

enum Doubt {
  kUnit,
  kHandle,
  kStartFrames,
  kFirstPose,
  kErrors,
  kSecondFrame,
  kGetOutside,
  kSetOutside,
  kCurrentDevice,
  kClampingDefault,
  kForceLimit,
  kRampingDefault,
  kWarmMotors,
  kTemperatures,
  kRateType,
  kSetRate,
  kCalibrationThread,
  kCalibrationBefore,
  kCalibrationUpdate,
  kUnplug,
  kDoubts
};

constexpr std::array<Sentence, kDoubts> kSentences{{
    {"unit", "device", "phantom", "the driver's unit is 'Default Device'",
     "it is 'Default PHANToM', as older drivers have it", "setup; callers"},
    {"handle", "zero", "one", "the first device's handle is 0", "it is 1",
     "hdDefines: only 0xFFFFFFFF is invalid"},
    {"start_frames", "errors", "intermittent",
     "every frame of the first milliseconds ends in HD_ILLEGAL_END",
     "every other one does: a clean frame may be followed by an error", "touchpy"},
    {"first_pose", "default", "zero", "the first frames give (0, -110, -35) mm",
     "they give zeros: 'uninitialised state'", "touchpy"},
    {"errors", "process", "thread", "one error stack for the process",
     "each thread has its own: what a callback caused stays with the scheduler's thread",
     "reference, hdGetError; pyoh"},
    {"second_frame", "error", "allowed",
     "a second frame within a tick is HD_ILLEGAL_BEGIN: the one frame limit is on by default",
     "it is accepted: frames of several callbacks are common", "reference, hdBeginFrame; touchpy"},
    {"get_outside", "last", "error", "a getter outside a frame gives the last frame's state",
     "it is HD_FRAME_ERROR", "guide, section 5"},
    {"set_outside", "error", "ignored", "a force set outside a frame is HD_FRAME_ERROR",
     "nothing happens: it 'typically' is an error", "guide, section 5"},
    {"current_device", "process", "thread", "the current device is the process's",
     "it is the thread's: only a frame or hdMakeCurrentDevice makes one current",
     "reference, hdMakeCurrentDevice"},
    {"clamping_default", "on", "off",
     "forces are clamped from the start: most capabilities are on by default",
     "not before hdEnable, as callers have it", "reference, hdEnable; callers"},
    {"force_limit", "clamped", "commanded",
     "the software limit looks at the force after clamping, so clamping avoids errors",
     "it looks at what was commanded: HD_EXCEEDED_MAX_FORCE, no force, then the ramp",
     "reference, table of capabilities"},
    {"ramping_default", "on", "off", "forces ramp up after the scheduler's start",
     "not before hdEnable(HD_FORCE_RAMPING), as callers have it",
     "reference, table of capabilities; callers"},
    {"warm_motors", "reported", "off", "warm motors are reported in each frame and go on",
     "they are reported and give no force until they have cooled", "errors"},
    {"temperatures", "3", "6", "a device of three motors has three temperatures",
     "six are written: '3 or 6'", "reference, table of safety parameters"},
    {"rate_type", "any", "int", "the update rate is read as a double, too",
     "only as an integer: HD_INVALID_INPUT_TYPE otherwise", "touchpy; reference, table of rates"},
    {"set_rate", "three", "fixed", "500, 1000 and 2000 Hz can be set",
     "none can, not even 1000: 'some devices need the latest firmware'",
     "reference, hdSetSchedulerRate"},
    {"calibration_thread", "any", "servo", "calibration is asked and updated on any thread",
     "an update takes effect on the scheduler's thread alone", "touchpy"},
    {"calibration_before", "answers", "fault", "it is known before the scheduler runs",
     "it is not: HD_DEVICE_FAULT", "reference, hdCheckCalibration; premium"},
    {"calibration_update", "suffices", "inkwell", "an update calibrates a device that needs one",
     "only while the stylus is in its well", "touchpy"},
    {"unplug", "errors", "silence", "frames of an unplugged device end in HD_COMM_ERROR",
     "the scheduler calls nobody any more", "errors, hduIsSchedulerError"},
}};

}  // namespace
