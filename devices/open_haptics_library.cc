#include "hlm/devices/open_haptics_library.h"

namespace hlm::server {
namespace {

enum Code : unsigned {
  kSuccess = 0x0000,
  kWarmMotors = 0x0200,
  kExceededMaxForce = 0x0201,
  kExceededMaxImpulse = 0x0202,
  kExceededMaxVelocity = 0x0203,
  kForceError = 0x0204,
  kDeviceFault = 0x0300,
  kAlreadyOpen = 0x0301,
  kCommunication = 0x0302,
  kConfiguration = 0x0303,
  kTimer = 0x0304,
  kIllegalBegin = 0x0400,
  kIllegalEnd = 0x0401,
  kFrameError = 0x0402,
  kLicense = 0x0600,
};

}  // namespace

OpenHapticsLibrary::OpenHapticsLibrary(const std::string& file)
    : library(file, {"libHD.so", "libHD.so.3", "libHD.so.3.4"},
              "https://support.3dsystems.com (OpenHaptics for Linux, and the Touch's driver)") {
  library.bind(init_device, "hdInitDevice");
  library.bind(disable_device, "hdDisableDevice");
  library.bind(make_current, "hdMakeCurrentDevice");
  library.bind(begin_frame, "hdBeginFrame");
  library.bind(end_frame, "hdEndFrame");
  library.bind(get_error, "hdGetError");
  library.bind(enable, "hdEnable");
  library.bind(disable, "hdDisable");
  library.bind(get_doubles, "hdGetDoublev");
  library.bind(get_integers, "hdGetIntegerv");
  library.bind(set_doubles, "hdSetDoublev");
  library.bind(get_string, "hdGetString");
  library.bind_if_any(check_calibration, "hdCheckCalibration");
  library.bind_if_any(update_calibration, "hdUpdateCalibration");
  library.bind(schedule, "hdScheduleAsynchronous");
  library.bind(unschedule, "hdUnschedule");
  library.bind(start_scheduler, "hdStartScheduler");
  library.bind(stop_scheduler, "hdStopScheduler");
  library.bind(set_scheduler_rate, "hdSetSchedulerRate");
}

const char* cause_of_error(unsigned code) noexcept {
  switch (code) {
    case kSuccess:
    case kExceededMaxForce:
    case kExceededMaxImpulse:
    case kWarmMotors:
      return nullptr;
    case kExceededMaxVelocity:
      return "it was faster than its own limit";
    case kForceError:
      return "its force could not be set";
    case kDeviceFault:
      return "it reports a fault of its own";
    case kAlreadyOpen:
      return "it is open already, in this program or another";
    case kCommunication:
      return "it does not answer: its cable or its power is off";
    case kConfiguration:
      return "it is not configured: use the vendor's setup";
    case kTimer:
      return "its scheduler missed its time";
    case kIllegalBegin:
    case kIllegalEnd:
    case kFrameError:
      return "its scheduler gives no frames";
    case kLicense:
      return "the vendor's library has no license";
    default:
      return "the vendor's library reports an error";
  }
}

bool says_saturated(unsigned code) noexcept {
  return code == kExceededMaxForce || code == kExceededMaxImpulse;
}

bool says_warm(unsigned code) noexcept { return code == kWarmMotors; }

bool says_no_frame(unsigned code) noexcept {
  return code == kIllegalBegin || code == kIllegalEnd || code == kFrameError;
}

}  // namespace hlm::server
