// A fake of OpenHaptics' libHD with a Touch, written from texts alone: no driver of this project
// was read. The sources, by the short names that open_haptics_doubts.h uses: hdDefines: hdDefines.h
// of OpenHaptics 3.0. pyoh: Python binding pyOpenHaptics 1.0.1. reference: API reference of
// OpenHaptics 3.5, as OpenHaptics4CSharp quotes it function by function. guide: programmer's guide
// of OpenHaptics 3.5, section 5, in a public translation. touchpy: a public ctypes binding of a
// Touch lab that says what its device did at the start. premium: a public wrapper phantom.h.
// errors: the toolkit's example of error handling. setup, callers: names and calls that most public
// callers have.
//
// FAKE_HD_READING chooses readings, FAKE_HD_START_MS says for how long frames fail after the start
// (20), FAKE_HD_CALIBRATION is ok, update or manual, FAKE_HD_HELD=1 is a device that another
// process holds (placeholder state for ever: touchpy), FAKE_HD_WARM_S the time in which 3.3 N warm
// the motors (20), FAKE_HD_CLOCK=virtual leaves the ticks to fake_advance.
//
// Assumed without a text: mass, friction, the ramp's rate, the model of warming, the velocity
// limit.

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include "body.h"
#include "open_haptics_api.h"
#include "open_haptics_doubts.h"

namespace {

// Values of hdDefines.
enum Code : HDenum {
  kSuccess = 0,
  kInvalidEnum = 0x100,
  kInvalidValue = 0x101,
  kInvalidOperation = 0x102,
  kInvalidInputType = 0x103,
  kBadHandle = 0x104,
  kWarm = 0x200,
  kExceededForce = 0x201,
  kExceededVelocity = 0x203,
  kDeviceFault = 0x300,
  kAlreadyInitiated = 0x301,
  kCommError = 0x302,
  kIllegalBegin = 0x400,
  kIllegalEnd = 0x401,
  kFrameError = 0x402,
  kForceOutput = 0x4000,
  kForceClamping = 0x4001,
  kForceRamping = 0x4002,
  kForceLimit_ = 0x4003,
  kOneFrame = 0x4004,
  kVelocityLimit = 0x2606,
  kImpulseLimit = 0x2607,
  kCalibrationOk = 0x5000,
  kNeedsUpdate = 0x5001,
  kNeedsManual = 0x5002
};
constexpr HHD kInvalidHandle = 0xFFFFFFFF;
constexpr HDenum kInkwellStyle = 4;
constexpr HDCallbackCode kContinue = 1;

constexpr double kMass = 0.12;            // kg; assumed.
constexpr double kFriction = 0.4;         // N·s/m; assumed.
constexpr double kPeak = 3.3;             // N; HD_NOMINAL_MAX_FORCE of a Touch in a public caller.
constexpr double kContinuous = 0.88;      // N; the same caller.
constexpr double kEncoderStep = 55e-6;    // m; nominal resolution of a Touch, 450 dpi.
constexpr double kRampRate = 8.0;         // N/s; assumed.
constexpr double kSpeedLimit = 1.5;       // m/s; assumed.
constexpr double kVelocityCutoff = 20.0;  // Hz; assumed: the reference says "smoothed".
constexpr Vec kPlaceholder{0.0, -0.110, -0.035};  // m; touchpy.

struct State {  // Of a frame; SI units.
  Vec position{}, velocity{}, joints{};
  int buttons = 0;
};

struct Operation {
  HDSchedulerHandle handle = 0;
  HDSchedulerCallback callback = nullptr;
  void* data = nullptr;
  unsigned short priority = 0;
  bool waited_for = false;  // hdScheduleSynchronous.
  bool done = false;
};

Readings<kDoubts> g_readings(kSentences);
bool second(Doubt d) { return g_readings.second(d); }

// Guards all below; callbacks run without it.
std::recursive_mutex g_mutex;
std::condition_variable_any g_changed;
Body g_body;
Vec g_motors{}, g_commanded{};
State g_current, g_last;
std::map<HDenum, bool> g_enabled;
std::vector<HDErrorInfo> g_errors;
thread_local std::vector<HDErrorInfo> t_errors;
std::vector<Operation> g_operations;
HDSchedulerHandle g_next_handle = 1;
bool g_initiated = false, g_plugged = true, g_in_frame = false, g_inkwell = false, g_held = false;
bool g_commanded_now = false;
int g_depth = 0, g_frames_in_tick = 0, g_pressed = 0;
HHD g_current_device = kInvalidHandle;
thread_local HHD t_current_device = kInvalidHandle;
HDenum g_calibration = kCalibrationOk;
double g_temperature = 0, g_warm_seconds = 20, g_ramp = 0, g_start_seconds = 0.020;
unsigned long g_rate = 1000;
// The scheduler.
std::thread g_thread;
std::thread::id g_servo;
bool g_running = false, g_virtual = false;
double g_time = 0;  // s since the scheduler started.
long g_due = 0;     // Ticks that fake_advance asked for.

using Lock = std::unique_lock<std::recursive_mutex>;

HHD handle() { return second(kHandle) ? 1 : 0; }

HHD& current_device() { return second(kCurrentDevice) ? t_current_device : g_current_device; }

void error(HDerror code) {
  std::vector<HDErrorInfo>& stack = second(kErrors) ? t_errors : g_errors;
  stack.push_back({code, static_cast<int>(code) + 1, current_device()});
}

bool starting() { return g_time < g_start_seconds; }

// ---------------------------------------------------------------- the device

State measure() {
  State s;
  s.buttons = g_pressed;
  if (g_held || starting()) {
    if (g_held || !second(kFirstPose)) s.position = kPlaceholder;
    return s;
  }
  const double keep =
      std::exp(-2 * std::numbers::pi * kVelocityCutoff / static_cast<double>(g_rate));
  for (std::size_t i = 0; i < 3; ++i) {
    s.position[i] = rounded(g_body.position[i], kEncoderStep);
    const double moved = s.position[i] - g_current.position[i];
    const bool jump = g_current.position == kPlaceholder || g_current.position == Vec{};
    const double speed = jump ? 0.0 : moved * static_cast<double>(g_rate);
    s.velocity[i] = keep * g_current.velocity[i] + (1 - keep) * speed;
    s.joints[i] = 0.3 + s.position[i] / 0.133;
  }
  return s;
}

void warm_up(double force, double dt) {
  // A time constant T warms to (F / continuous)²; kPeak reaches 1 after g_warm_seconds.
  const double level = (force * force) / (kContinuous * kContinuous);
  const double full = (kPeak * kPeak) / (kContinuous * kContinuous);
  const double constant = g_warm_seconds / -std::log(1 - 1 / full);
  g_temperature += (level - g_temperature) * (1 - std::exp(-dt / constant));
}

// The force that the motors give for what a frame commanded.
Vec output() {
  if (!g_enabled[kForceOutput] || g_held || !g_plugged) return {};
  Vec force = g_commanded;
  const bool over = norm(force) > kPeak;
  const bool clamped = g_enabled[kForceClamping];
  if (clamped) cut(&force, kPeak);
  if (over && g_enabled[kForceLimit_] && (!clamped || second(kForceLimit))) {
    error(kExceededForce);
    g_ramp = 0;
    return {};
  }
  if (norm(g_current.velocity) > kSpeedLimit && g_enabled[kVelocityLimit]) {
    error(kExceededVelocity);
    g_ramp = 0;
    return {};
  }
  if (g_temperature >= 1) {
    error(kWarm);
    if (second(kWarmMotors)) return {};
  }
  if (g_enabled[kForceRamping]) cut(&force, g_ramp);
  return force;
}

void simulate(double dt) {
  for (double t = 0; t < dt - 0.5 * kStep; t += kStep) g_body.step(g_motors, kMass, kFriction);
  warm_up(norm(g_motors), dt);
  g_ramp += kRampRate * dt;
}

// ---------------------------------------------------------------- the scheduler

void tick() {
  Lock lock(g_mutex);
  g_frames_in_tick = 0;
  std::vector<Operation> due;
  for (const Operation& o : g_operations)
    if (!o.done) due.push_back(o);
  std::stable_sort(due.begin(), due.end(),
                   [](const Operation& a, const Operation& b) { return a.priority > b.priority; });
  const bool silent = !g_plugged && second(kUnplug);
  lock.unlock();
  for (const Operation& o : due) {
    if (silent) continue;
    const bool again = o.callback(o.data) == kContinue;
    const Lock relock(g_mutex);
    for (Operation& other : g_operations)
      if (other.handle == o.handle && !again) other.done = true;
  }
  lock.lock();
  if (g_frames_in_tick == 0 && !silent) g_motors = {};  // Nobody commanded a force in this tick.
  simulate(1.0 / static_cast<double>(g_rate));
  g_time += 1.0 / static_cast<double>(g_rate);
  g_changed.notify_all();
}

bool scheduled(HDSchedulerHandle handle) {
  return std::any_of(g_operations.begin(), g_operations.end(),
                     [handle](const Operation& o) { return o.handle == handle && !o.done; });
}

bool waiting() {
  return std::any_of(g_operations.begin(), g_operations.end(),
                     [](const Operation& o) { return !o.done && o.waited_for; });
}

void serve() {
  auto next = std::chrono::steady_clock::now();
  for (;;) {
    {
      Lock lock(g_mutex);
      if (g_virtual) g_changed.wait(lock, [] { return !g_running || g_due > 0 || waiting(); });
      if (!g_running) return;
    }
    tick();
    Lock lock(g_mutex);
    if (g_virtual) {
      g_due = std::max(0L, g_due - 1);
      g_changed.notify_all();
      continue;
    }
    next += std::chrono::nanoseconds(1000000000 / static_cast<long>(g_rate));
    next = std::max(next, std::chrono::steady_clock::now() - std::chrono::milliseconds(5));
    lock.unlock();
    std::this_thread::sleep_until(next);
  }
}

// ---------------------------------------------------------------- parameters

enum Type { kBoolean, kInteger, kLong, kFloating };

// Values of a parameter and the type under which the reference lists it; empty if there is none.
struct Parameter {
  std::vector<double> values;
  Type type = kFloating;
};

std::vector<double> scaled(double s, const Vec& v) { return {s * v[0], s * v[1], s * v[2]}; }

std::vector<double> transform(const Vec& position) {  // Column-major, translation last.
  std::vector<double> m(16, 0.0);
  m[0] = m[5] = m[10] = m[15] = 1;
  for (std::size_t i = 0; i < 3; ++i) m[12 + i] = 1e3 * position[i];
  return m;
}

Parameter state_parameter(HDenum name, const State& s) {
  switch (name) {
    case 0x000:
      return {{static_cast<double>(s.buttons)}, kInteger};
    case 0x001:
      return {{1.0}, kBoolean};
    case 0x002:
      return {{g_inkwell ? 1.0 : 0.0}, kBoolean};
    case 0x010:
      return {{0, 0, 0, 0, 0, 0}, kLong};
    case 0x050:
      return {scaled(1e3, s.position)};
    case 0x051:
      return {scaled(1e3, s.velocity)};
    case 0x052:
      return {transform(s.position)};
    case 0x053:
      return {{0, 0, 0}};
    case 0x100:
      return {scaled(1, s.joints)};
    case 0x150:
      return {{0, 0, 0}};
    default:
      return {};
  }
}

Parameter device_parameter(HDenum name) {
  switch (name) {
    case 0x2550:
      return {{-210, -110, -85, 210, 205, 130}};
    case 0x2551:
      return {{-80, -60, -35, 80, 60, 35}};
    case 0x2552:
      return {{110}};
    case 0x2553:
      return {{6}, kInteger};
    case 0x2554:
      return {{3}, kInteger};
    case 0x2555:
      return {{static_cast<double>(kInkwellStyle)}, kInteger};
    case 0x2600:
    case 0x2601:
      return {{static_cast<double>(g_rate)}, kInteger};
    case 0x2602:
      return {{0.5}};
    case 0x2603:
      return {{kPeak}};
    case 0x2604:
      return {{kContinuous}};
    case 0x2605:
      return {std::vector<double>(second(kTemperatures) ? 6 : 3, g_temperature)};
    case 0x2606:
      return {{1e3 * kSpeedLimit}};
    case 0x2607:
      return {{5}};
    case 0x2608:
      return {{kRampRate}};
    case 0x2609:
      return {{0.0015}};
    case 0x2700:
      return {scaled(g_commanded_now ? 1 : 0, g_commanded)};
    case 0x2703:
    case 0x2704:
      return {{0, 0, 0}};
    case 0x2800:
      return {scaled(1, g_motors)};
    default:
      return {};
  }
}

// In hdDefines a value of the last frame lies 0x200 above that of the current one.
Parameter parameter(HDenum name) {
  if (name >= 0x2200 && name < 0x2400) return state_parameter(name - 0x2200, g_last);
  if (name >= 0x2000 && name < 0x2200) return state_parameter(name - 0x2000, g_current);
  return device_parameter(name);
}

bool of_a_frame(HDenum name) { return name < 0x2500 || (name >= 0x2700 && name < 0x2900); }

template <class Value>
void get(HDenum name, Value* values, Type type) {
  const Lock lock(g_mutex);
  if (current_device() == kInvalidHandle) return error(kInvalidOperation);
  const Parameter p = parameter(name);
  if (p.values.empty()) return error(kInvalidEnum);
  const bool rate = (name == 0x2600 || name == 0x2601) && !second(kRateType);
  if (p.type != type && !(rate && type == kFloating)) return error(kInvalidInputType);
  if (of_a_frame(name) && !g_in_frame && second(kGetOutside)) return error(kFrameError);
  for (std::size_t i = 0; i < p.values.size(); ++i) values[i] = static_cast<Value>(p.values[i]);
}

template <class Value>
void set(HDenum name, const Value* values) {
  const Lock lock(g_mutex);
  if (current_device() == kInvalidHandle) return error(kInvalidOperation);
  if (name == kVelocityLimit || name == kImpulseLimit || name == 0x2608) return;
  if (name < 0x2700 || name > 0x2704) return error(kInvalidEnum);
  if (!g_in_frame) return second(kSetOutside) ? void() : error(kFrameError);
  if (name != 0x2700) return;  // No motors for torques.
  for (std::size_t i = 0; i < 3; ++i) g_commanded[i] = values[i];
  g_commanded_now = true;
}

bool is_capability(HDenum name) {
  return (name >= kForceOutput && name <= kOneFrame) || name == kVelocityLimit ||
         name == kImpulseLimit || name == 0x2900;
}

double setting(const char* name, double otherwise) {
  const char* text = std::getenv(name);
  return text != nullptr ? std::atof(text) : otherwise;
}

void reset() {
  g_body = Body{};
  g_motors = g_commanded = {};
  g_current = g_last = State{};
  g_enabled = {{kForceClamping, !second(kClampingDefault)},
               {kForceRamping, !second(kRampingDefault)},
               {kForceLimit_, true},
               {kOneFrame, true},
               {kVelocityLimit, true}};
  g_errors.clear(), t_errors.clear();
  g_operations.clear();
  g_initiated = g_in_frame = g_inkwell = g_commanded_now = false;
  g_plugged = true;
  g_depth = g_pressed = 0;
  g_current_device = t_current_device = kInvalidHandle;
  g_temperature = g_ramp = g_time = 0;
  g_rate = 1000;
  g_due = 0;
  const char* clock = std::getenv("FAKE_HD_CLOCK");
  g_virtual = clock != nullptr && std::strcmp(clock, "virtual") == 0;
  g_warm_seconds = setting("FAKE_HD_WARM_S", 20);
  g_start_seconds = 1e-3 * setting("FAKE_HD_START_MS", 20);
  g_held = setting("FAKE_HD_HELD", 0) != 0;
  const char* calibration = std::getenv("FAKE_HD_CALIBRATION");
  const std::string state = calibration != nullptr ? calibration : "ok";
  g_calibration = state == "ok" ? kCalibrationOk : state == "update" ? kNeedsUpdate : kNeedsManual;
}

struct Loaded {
  Loaded() {
    const char* readings = std::getenv("FAKE_HD_READING");
    if (!fake_configure(readings != nullptr ? readings : "")) std::abort();
  }
  ~Loaded() { hdStopScheduler(); }
} g_loaded;

}  // namespace

extern "C" {

// ---------------------------------------------------------------- what the fake adds

bool fake_configure(const char* readings) {
  const Lock lock(g_mutex);
  const bool known = g_readings.choose(readings);
  reset();
  return known;
}

const char* fake_doubt(int i) {
  thread_local std::string text;
  text = g_readings.text(i);
  return text.empty() ? nullptr : text.c_str();
}

void fake_advance(double seconds) {
  Lock lock(g_mutex);
  g_virtual = true;
  if (!g_running) return;
  g_due += std::lround(seconds * static_cast<double>(g_rate));
  g_changed.notify_all();
  g_changed.wait(lock, [] { return g_due == 0 || !g_running; });
}

void fake_set_hand(double x, double y, double z, double stiffness, double damping) {
  const Lock lock(g_mutex);
  g_body.anchor = {x, y, z};
  g_body.stiffness = stiffness;
  g_body.damping = damping;
}

void fake_press(int button, bool down) {
  const Lock lock(g_mutex);
  g_pressed = down ? g_pressed | (1 << button) : g_pressed & ~(1 << button);
}
void fake_inkwell(bool in) {
  const Lock lock(g_mutex);
  g_inkwell = in;
  if (in && g_calibration == kNeedsManual) g_calibration = kNeedsUpdate;
}
void fake_set_calibration(HDenum state) {
  const Lock lock(g_mutex);
  g_calibration = state;
}
void fake_unplug() {
  const Lock lock(g_mutex);
  g_plugged = false;
  g_motors = {};
}

void fake_truth(double position[3], double velocity[3], double force[3]) {
  const Lock lock(g_mutex);
  for (std::size_t i = 0; i < 3; ++i) {
    position[i] = g_body.position[i];
    velocity[i] = g_body.velocity[i];
    force[i] = g_motors[i];
  }
}

// ---------------------------------------------------------------- devices and errors

HHD hdInitDevice(const char* name) {
  const Lock lock(g_mutex);
  const char* unit = second(kUnit) ? "Default PHANToM" : "Default Device";
  if (!g_plugged || (name != nullptr && std::strcmp(name, unit) != 0)) {
    error(kDeviceFault);
    return kInvalidHandle;
  }
  if (g_initiated) {
    error(kAlreadyInitiated);
    return kInvalidHandle;
  }
  g_initiated = true;
  current_device() = handle();
  return handle();
}

void hdDisableDevice(HHD device) {
  const Lock lock(g_mutex);
  if (!g_initiated || device != handle()) return error(kBadHandle);
  g_initiated = g_in_frame = false;
  g_depth = 0;
  g_motors = {};
  g_current_device = t_current_device = kInvalidHandle;
}

void hdMakeCurrentDevice(HHD device) {
  const Lock lock(g_mutex);
  if (!g_initiated || device != handle()) return error(kBadHandle);
  current_device() = device;
}

HHD hdGetCurrentDevice() {
  const Lock lock(g_mutex);
  if (current_device() == kInvalidHandle) error(kBadHandle);
  return current_device();
}

HDErrorInfo hdGetError() {
  const Lock lock(g_mutex);
  std::vector<HDErrorInfo>& stack = second(kErrors) ? t_errors : g_errors;
  if (stack.empty()) return {kSuccess, 0, current_device()};
  const HDErrorInfo newest = stack.back();
  stack.pop_back();
  return newest;
}

const char* hdGetErrorString(HDerror code) {
  switch (code) {
    case kSuccess:
      return "no error";
    case kInvalidInputType:
      return "wrong type for this parameter";
    case kWarm:
      return "motors are warm";
    case kExceededForce:
      return "force above the maximum";
    case kExceededVelocity:
      return "velocity above the limit";
    case kDeviceFault:
      return "device fault";
    case kCommError:
      return "communication lost";
    case kIllegalBegin:
      return "frame begun twice";
    case kIllegalEnd:
      return "frame ended without its begin";
    case kFrameError:
      return "outside of a frame";
    default:
      return "invalid call";
  }
}

// ---------------------------------------------------------------- frames

void hdBeginFrame(HHD device) {
  const Lock lock(g_mutex);
  if (!g_initiated || device != handle()) return error(kBadHandle);
  current_device() = device;
  if (g_in_frame) return void(++g_depth);
  if (g_frames_in_tick > 0 && g_enabled[kOneFrame] && !second(kSecondFrame))
    return error(kIllegalBegin);
  g_in_frame = true;
  g_commanded_now = false;
  g_commanded = {};
  g_last = g_current;
  g_current = measure();
}

void hdEndFrame(HHD device) {
  const Lock lock(g_mutex);
  if (!g_initiated || device != handle()) return error(kBadHandle);
  if (!g_in_frame) return error(kIllegalEnd);
  if (g_depth > 0) return void(--g_depth);
  g_in_frame = false;
  ++g_frames_in_tick;
  const bool odd = std::lround(g_time * static_cast<double>(g_rate)) % 2 != 0;
  if (starting() && (!second(kStartFrames) || odd)) return error(kIllegalEnd);
  if (!g_plugged) return error(kCommError);
  g_motors = output();
}

// ---------------------------------------------------------------- parameters

void hdEnable(HDenum capability) {
  const Lock lock(g_mutex);
  if (current_device() == kInvalidHandle) return error(kInvalidOperation);
  if (!is_capability(capability)) return error(kInvalidEnum);
  g_enabled[capability] = true;
}
void hdDisable(HDenum capability) {
  const Lock lock(g_mutex);
  if (current_device() == kInvalidHandle) return error(kInvalidOperation);
  if (!is_capability(capability)) return error(kInvalidEnum);
  g_enabled[capability] = false;
}
HDboolean hdIsEnabled(HDenum capability) {
  const Lock lock(g_mutex);
  if (!is_capability(capability)) error(kInvalidEnum);
  return g_enabled[capability];
}

void hdGetBooleanv(HDenum name, HDboolean* values) { get(name, values, kBoolean); }
void hdGetIntegerv(HDenum name, int* values) { get(name, values, kInteger); }
void hdGetLongv(HDenum name, long* values) { get(name, values, kLong); }
void hdGetFloatv(HDenum name, float* values) { get(name, values, kFloating); }
void hdGetDoublev(HDenum name, double* values) { get(name, values, kFloating); }
void hdSetFloatv(HDenum name, const float* values) { set(name, values); }
void hdSetDoublev(HDenum name, const double* values) { set(name, values); }

const char* hdGetString(HDenum name) {
  const Lock lock(g_mutex);
  switch (name) {
    case 0x2500:
      return "3.5";
    case 0x2501:
      return "Touch";
    case 0x2502:
      return "2022.4";
    case 0x2503:
      return "3D Systems";
    case 0x2504:
      return "fake-1";
    default:
      error(kInvalidEnum);
      return nullptr;
  }
}

// ---------------------------------------------------------------- calibration

HDenum hdCheckCalibration() {
  const Lock lock(g_mutex);
  if (current_device() == kInvalidHandle) error(kInvalidOperation);
  if (!g_running && second(kCalibrationBefore)) error(kDeviceFault);
  return g_calibration;
}
HDenum hdCheckCalibrationStyle() { return kInkwellStyle; }

void hdUpdateCalibration(HDenum style) {
  const Lock lock(g_mutex);
  if (current_device() == kInvalidHandle) return error(kInvalidOperation);
  if (!g_running && second(kCalibrationBefore)) return error(kDeviceFault);
  if ((style & kInkwellStyle) == 0) return error(kInvalidOperation);
  if (second(kCalibrationThread) && std::this_thread::get_id() != g_servo) return;
  if (second(kCalibrationUpdate) && !g_inkwell) return;
  if (g_calibration == kNeedsUpdate) g_calibration = kCalibrationOk;
}

// ---------------------------------------------------------------- the scheduler

void hdSetSchedulerRate(unsigned long hz) {
  const Lock lock(g_mutex);
  if ((hz != 500 && hz != 1000 && hz != 2000) || second(kSetRate)) return error(kInvalidValue);
  g_rate = hz;
}

void hdStartScheduler() {
  const Lock lock(g_mutex);
  if (g_running) return;
  g_running = true;
  g_time = g_ramp = 0;
  g_thread = std::thread(serve);
  g_servo = g_thread.get_id();
}

void hdStopScheduler() {
  Lock lock(g_mutex);
  if (!g_running) return;
  g_running = false;
  g_motors = {};
  g_changed.notify_all();
  lock.unlock();
  g_thread.join();
}

double hdGetSchedulerTimeStamp() { return 0; }

HDSchedulerHandle hdScheduleAsynchronous(HDSchedulerCallback callback, void* data,
                                         unsigned short priority) {
  const Lock lock(g_mutex);
  g_operations.push_back({g_next_handle, callback, data, priority, false, false});
  return g_next_handle++;
}

void hdScheduleSynchronous(HDSchedulerCallback callback, void* data, unsigned short priority) {
  Lock lock(g_mutex);
  if (!g_running || std::this_thread::get_id() == g_servo) {
    lock.unlock();
    while (callback(data) == kContinue) {
    }
    return;
  }
  const HDSchedulerHandle mine = g_next_handle++;
  g_operations.push_back({mine, callback, data, priority, true, false});
  g_changed.notify_all();
  g_changed.wait(lock, [mine] { return !g_running || !scheduled(mine); });
  std::erase_if(g_operations, [mine](const Operation& o) { return o.handle == mine; });
}

void hdUnschedule(HDSchedulerHandle handle) {
  const Lock lock(g_mutex);
  for (Operation& o : g_operations)
    if (o.handle == handle && !o.done) return void(o.done = true);
  error(kInvalidOperation);
}

HDboolean hdWaitForCompletion(HDSchedulerHandle handle, HDenum mode) {
  Lock lock(g_mutex);
  if (mode == 0) return scheduled(handle);
  g_changed.wait(lock, [handle] { return !g_running || !scheduled(handle); });
  return 1;
}

}  // extern "C"
