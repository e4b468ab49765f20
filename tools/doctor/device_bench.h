// A device under the server's own loop and force limits, for haptic_doctor to examine.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "hlm/haptic_server/device/device.h"
#include "hlm/haptic_server/device/motor_guard.h"
#include "hlm/haptic_server/loop/periodic_loop.h"
#include "hlm/haptic_server/report/histogram.h"
#include "hlm/haptic_server/safety/limiter.h"
#include "hlm/tools/doctor/finding.h"
#include "hlm/tools/doctor/person.h"

namespace hlm::server {

/// One tick. World axes, metres and radians of the handle.
struct HandleSample {
  double time = 0;                  ///< s since the run began.
  Vector3 p = Vector3::Zero();      ///< m, from where the device was opened.
  Vector3 v = Vector3::Zero();      ///< m/s.
  Vector3 turn = Vector3::Zero();   ///< Rotation vector from where it was opened, rad.
  Vector3 force = Vector3::Zero();  ///< Commanded from here on, N.
};

/// An examination cannot go on.
struct BenchEnded : std::runtime_error {
  BenchEnded(Verdict how_bad, const std::string& why) : std::runtime_error(why), verdict(how_bad) {}
  Verdict verdict;
};

/// Within these a push goes on: distance of the handle from where it began, m, and speed, m/s. More
/// would let a handle that nobody holds run into its stops.
inline constexpr double kFarthestPush = 0.02;
inline constexpr double kFastestPush = 0.1;

/// Runs of ticks, one after the other: between two the caller may think for some milliseconds, but
/// not wait.
class DeviceBench {
 public:
  /// The device is opened, motors off. rate: Hz; max_gap: between two ticks, s, after which another
  /// process takes the motors off.
  DeviceBench(Device& device, double rate, double max_gap, Person& person);
  /// Motors off.
  ~DeviceBench();
  DeviceBench(const DeviceBench&) = delete;
  DeviceBench& operator=(const DeviceBench&) = delete;

  /// Ends what is going on, force first: BenchEnded. Async-signal-safe.
  static void request_stop(int signal) noexcept;

  /// Ticks for `time`, s, without force. All that ticks throws BenchEnded when the device fails or
  /// a signal comes; what waits for the person, or pushes, also when answers have ended.
  void watch(double time);
  /// Ticks without force until the person answers.
  std::string ask(const std::string& question);
  /// The same until the answer is yes or no.
  bool ask_whether(const std::string& question);
  /// Ticks until the handle has been slower than `speed`, m/s, for kRestTime; false if it has not
  /// after `patience`, s.
  bool rests(double speed, double patience);
  /// Motors on, without force. most: that a push may have, N. From here on a handle that is faster
  /// than 0.5 m/s fails: motors off, BenchEnded.
  void enable(double most);
  /// Nobody holds the handle: until disable() one that leaves its place without a push fails, too.
  void let_go() noexcept { is_free_ = true; }
  void disable() noexcept;
  /// After kLead pushes with `force`, N, world axes, up to `time`, s, or until the handle leaves
  /// the bounds above or no new state has come for kBlindTime, then watches for kCoast. Whether a
  /// new state came at all: without one these bounds see nothing.
  bool push(const Vector3& force, double time);

  static constexpr double kLead = 0.02;      // s.
  static constexpr double kCoast = 0.25;     // s.
  static constexpr double kBlindTime = 0.1;  // s.
  static constexpr double kRestTime = 0.2;   // s.

  const Device& device() const noexcept { return device_; }
  double rate() const noexcept { return rate_; }
  /// Samples of the latest run, its first 20 s.
  const std::vector<HandleSample>& samples() const noexcept { return samples_; }
  const HandleSample& latest() const noexcept { return latest_; }
  /// Times between two new states while the handle moved, s, of all runs.
  const Histogram& gaps() const noexcept { return gaps_; }
  std::uint32_t buttons_seen() const noexcept { return buttons_seen_; }
  /// Gripper's smallest and largest opening that was seen; the first above the second: none.
  const std::array<double, 2>& gripper_seen() const noexcept { return gripper_seen_; }
  /// The worst that the device said of itself, and why; in how many ticks it was not good.
  DeviceHealth health() const noexcept { return health_; }
  const char* cause_of_health() const noexcept { return cause_of_health_; }
  std::uint64_t ticks_not_good() const noexcept { return ticks_not_good_; }
  /// Periods that the loop missed, and all, in all runs.
  std::uint64_t missed() const noexcept { return missed_; }
  std::uint64_t ticks() const noexcept { return ticks_; }

 private:
  /// What a run is for.
  struct Plan {
    double longest = 0;     ///< s; of a push the force alone.
    bool asks = false;      ///< It ends with an answer, however long it takes.
    double rest_speed = 0;  ///< It ends when the handle has been slower for kRestTime, m/s.
    bool pushes = false;    ///< After kLead with `force`, followed by kCoast.
    Vector3 force = Vector3::Zero();  ///< N.
  };
  void run(const Plan& plan);
  bool tick(const Plan& plan, const Timing& timing) noexcept;
  /// Whether a handle with its motors on leaves the bounds of this run.
  bool runs_away(const Plan& plan) noexcept;
  bool goes_on(const Plan& plan) noexcept;
  void observe(const DeviceState& state, const Timing& timing) noexcept;
  Wrench command(const Plan& plan, const Timing& timing) noexcept;
  bool fail(const char* cause) noexcept;

  Device& device_;
  double rate_;
  double max_gap_;
  Person& person_;
  MotorGuard guard_;
  std::optional<Limiter> limiter_;  ///< While the motors are on.

  std::vector<HandleSample> samples_;
  Histogram gaps_;
  HandleSample latest_;
  DeviceState state_;
  std::optional<Pose> X_WStart_;
  std::optional<Vector3> p_start_;  ///< Position at the run's first tick with the motors on, m.
  bool is_free_ = false;            ///< Nobody holds the handle.
  double rests_since_ = 0;          ///< s.
  double new_since_ = 0;            ///< When the latest state came, s.
  bool moved_before_ = false;       ///< The handle moved at that time.
  const char* failure_ = nullptr;
  double push_end_ = 0;  ///< When the latest push ended or will end, s.
  std::uint32_t buttons_seen_ = 0;
  std::array<double, 2> gripper_seen_{1, 0};
  DeviceHealth health_ = DeviceHealth::kGood;
  const char* cause_of_health_ = "";
  std::uint64_t ticks_not_good_ = 0;
  std::uint64_t missed_ = 0;
  std::uint64_t ticks_ = 0;
};

}  // namespace hlm::server
