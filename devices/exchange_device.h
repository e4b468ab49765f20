// Devices behind a service or a serial port: one request with a force, one reply with a state.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "hlm/common/latest_value.h"
#include "hlm/common/settings/table.h"
#include "hlm/devices/motion_check.h"
#include "hlm/haptic_server/device/device.h"

namespace hlm::server {

using SteadyTime = std::chrono::steady_clock::time_point;

/// What a reply says of the handle, in the device's own frame.
struct HandleState {
  Pose X;                   ///< Pose of the handle, m.
  Twist V = Twist::Zero();  ///< Twist of the handle, m/s and rad/s.
  std::uint32_t buttons = 0;
  bool saturated = false;  ///< The latest request was for more than its motors give.
  /// Why its motors give nothing, in words of static storage duration; null: they give force.
  const char* force_off = nullptr;
};

/// The line to such a device. Used by one thread; what goes wrong is thrown as std::runtime_error
/// that names it.
class DeviceLine {
 public:
  virtual ~DeviceLine() = default;

  /// Connects, finds the device and prepares it. May take seconds.
  virtual void open() = 0;
  /// Lets go. May be called when nothing is open, and twice.
  virtual void close() noexcept = 0;
  /// A request: the force that the device exerts on the hand, device frame, N; empty: none is
  /// rendered, the state alone is asked for.
  virtual void send(const std::optional<Vector3>& force) = 0;
  /// Throws if there is something that was not asked for. Called when every request has its reply.
  virtual void expect_silence() = 0;
  /// The reply to the oldest request that has none; empty if none has come by `deadline`.
  virtual std::optional<HandleState> receive(SteadyTime deadline) = 0;
  /// Who makes the speed in its states.
  virtual MotionCheck::SpeedSource speed_source() const noexcept {
    return MotionCheck::SpeedSource::kDevice;
  }
  /// Takes the motors off, as Device::halt().
  virtual void halt() noexcept = 0;
  /// What a person should know who uses a line that was opened again; empty if nothing.
  virtual const char* warning_after_reopening() const noexcept { return ""; }
};

struct ExchangeOptions {
  double rate = 2000;  ///< Requests, Hz, at most. Less ages states and forces, more costs time.
  /// Oldest state and oldest command that are used, s. Less ends sessions when the machine is busy;
  /// more lets a force outlive what it answers.
  double oldest = 0.015;
  double first_state = 3;  ///< Time that calibrate() waits for it, s.
};

/// Why they cannot be used together; empty if they can.
std::optional<std::string> find_error(const ExchangeOptions& options);
/// Declares what a person may set of them.
void add_keys(settings::Table& table, ExchangeOptions& options);

/// Exchanges with its line in a thread of its own. The servo thread reads the latest state and
/// leaves the latest force; it never waits. Safety here:
/// - a state of motors at their limit is kSaturated, of motors that are off kForceOff;
/// - a state that a MotionCheck finds fault with is a failure of the device;
/// - a state older than `oldest` is a failure of the device, older than a third of that kLate;
/// - a force older than `oldest`, as when the servo thread stands still, is sent as zero;
/// - a force ends with a request for zero, whatever follows: where no reply to one came, the first
///   request on the line that is opened again is another;
/// - the line is asked again only when it has answered, except for a zero that ends a force: that
///   is sent at once;
/// - after a failure, whose cause is named, the line is opened again and again without
///   force, and read() fails until enable(). So the device is back when a person arms it.
/// Reports the handle in the device's own frame, from wherever it is.
class ExchangeDevice final : public Device {
 public:
  /// name: "Haply Inverse3". A torque is not sent, and `ratings` should say so.
  ExchangeDevice(std::string name, const DeviceRatings& ratings, const ExchangeOptions& options,
                 std::unique_ptr<DeviceLine> line);
  ~ExchangeDevice() override;

  std::string_view name() const noexcept override { return name_; }
  const DeviceRatings& ratings() const noexcept override { return ratings_; }
  bool measures_hand_wrench() const noexcept override { return false; }
  /// Opens the line and waits for the first state.
  void calibrate() override;
  void align(const Pose&) noexcept override {}
  void enable() noexcept override;
  void disable() noexcept override;
  std::optional<DeviceState> read() noexcept override;
  bool write(const Wrench& F) noexcept override;
  void halt() noexcept override;
  /// Why the latest read() failed, or its health was not good; empty if neither.
  const char* cause() const noexcept override { return cause_now_; }

 private:
  struct TimedState {
    HandleState handle;
    SteadyTime asked{};  ///< When its request was sent: the state is not older.
  };
  struct TimedForce {
    Vector3 force = Vector3::Zero();
    SteadyTime written{};
  };

  void run();
  void exchange();
  void pause();
  bool must_end() noexcept;
  void request_no_force();
  void await_reply();
  void send(const std::optional<Vector3>& force);
  void take(const HandleState& state);
  std::optional<Vector3> wanted_force() noexcept;
  void measure(std::chrono::nanoseconds lateness);
  void observe(SteadyTime now);
  void fail(const std::string& text);
  void rest(std::chrono::duration<double> time);
  bool stopping() const noexcept { return stopping_.load(std::memory_order_relaxed); }

  const std::string name_;
  DeviceRatings ratings_;
  const std::chrono::nanoseconds period_;
  const std::chrono::nanoseconds oldest_;
  const std::chrono::duration<double> first_state_;
  const std::unique_ptr<DeviceLine> line_;

  // Between the two threads.
  LatestValue<TimedState> state_;
  LatestValue<TimedForce> force_;
  std::atomic<bool> enabled_ = false;
  std::atomic<bool> halted_ = false;
  std::atomic<std::uint32_t> failures_ = 0;
  std::atomic<bool> stopping_ = false;
  std::mutex mutex_;  ///< Guards what calibrate() waits for.
  std::condition_variable changed_;
  bool has_state_ = false;
  std::string cause_;  ///< Cause of the latest failure; empty: none since it works.
  std::atomic<const char*> told_ = "";  ///< Text of the latest failure.

  // Used by the servo thread.
  std::uint32_t failures_seen_ = 0;  ///< Failures at enable().
  const char* cause_now_ = "";

  // Used by the exchange's own thread.
  bool is_open_ = false;             ///< The line is open.
  std::string refusal_;              ///< Why it could not be opened, the last time.
  Vector3 given_ = Vector3::Zero();  ///< Force in the latest request on this line.
  /// A force was sent and no request for zero was answered since. Outlives the line.
  bool may_hold_force_ = false;
  int unanswered_ = 0;   ///< Requests.
  SteadyTime asked_{};   ///< When the oldest of these was sent, or the latest of all.
  SteadyTime ended_{};   ///< When the zero behind it was.
  MotionCheck motion_;   ///< Of the states on this line.
  SteadyTime opened_{};  ///< When the line was opened.
  int replies_ = 0;      ///< Replies in the present session,
  std::chrono::nanoseconds lateness_{};  ///< lateness of all of them,
  std::chrono::nanoseconds worst_{};     ///< and the largest.
  std::thread thread_;
};

}  // namespace hlm::server
