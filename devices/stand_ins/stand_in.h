// The simulated device and its hand behind a vendor's boundary: what all stand-ins share.
//
// A stand-in takes its orders from the environment of the process that it lives in:
//   HAPTIC_STAND_IN_HAND    hand script, TOML; none: nobody holds the handle
//   HAPTIC_STAND_IN_MOTORS  file that holds what the motors give (Amplifier::Memory); none: nowhere
//   HAPTIC_STAND_IN_ORDERS  file or FIFO that is read while it grows, one order a line: a word of
//                           StandInFault, which then lasts; `good` ends all of them, `replug`
//                           unplugging; `press N` and `release N` are a button, from 0;
//                           `hold X Y Z`: a hand draws the handle there, m, device's frame, until
//                           `let_go`
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <string_view>
#include <thread>

#include "hlm/haptic_server/device/simulated_device.h"

namespace hlm::stand_in {

/// What can be wrong with a device. The first seven happen at the vendor's boundary, which asks for
/// them; the others to the handle itself.
enum class StandInFault {
  kError,      ///< Every call fails.
  kSaturate,   ///< Motors give less than is asked for, and say so.
  kTimeGuard,  ///< Calls come too often for new values.
  kForceOff,   ///< The device's own safety takes the motors off.
  kMirror,     ///< Orientations are those of a mirror.
  kNotFinite,  ///< Positions are not numbers.
  kBroken,     ///< The boundary's rules are broken, whatever they are.
  kUnplug,     ///< Neither calls nor motors work.
  kSlow,       ///< States are new 200 times a second.
  kFreeze,     ///< States stay as they are.
  kLate,       ///< States are 30 ms old.
  kReverse,    ///< Motors push the other way.
  kReflect,    ///< Positions are those of a mirror: x has the other sign.
  kNoisy,      ///< Positions are off by up to 0.5 mm in each direction.
  kStop,       ///< The handle is held where it is, as by a mechanical stop.
  kJump,       ///< Positions are off by 50 mm, speeds are not.
  kWeak,       ///< Motors give half of what is asked for.
  kStrong,     ///< Motors give three times as much.
  kOneWeak,    ///< The motor along x gives 30 %.
  kScaled,     ///< Positions and speeds are 1.5 times as large.
  kFast,       ///< Speeds are twice as large.
};

}  // namespace hlm::stand_in

namespace hlm {

template <>
inline constexpr std::array<Word<stand_in::StandInFault>, 21> kWords<stand_in::StandInFault>{{
    {stand_in::StandInFault::kError, "error", "every call fails"},
    {stand_in::StandInFault::kSaturate, "saturate", "motors give less than is asked for"},
    {stand_in::StandInFault::kTimeGuard, "timeguard", "calls come too often for new values"},
    {stand_in::StandInFault::kForceOff, "force_off", "its own safety takes the motors off"},
    {stand_in::StandInFault::kMirror, "mirror", "orientations are those of a mirror"},
    {stand_in::StandInFault::kNotFinite, "not_finite", "positions are not numbers"},
    {stand_in::StandInFault::kBroken, "broken", "the boundary's rules are broken"},
    {stand_in::StandInFault::kUnplug, "unplug", "neither calls nor motors work"},
    {stand_in::StandInFault::kSlow, "slow", "states are new 200 times a second"},
    {stand_in::StandInFault::kFreeze, "freeze", "states stay as they are"},
    {stand_in::StandInFault::kLate, "late", "states are 30 ms old"},
    {stand_in::StandInFault::kReverse, "reverse", "motors push the other way"},
    {stand_in::StandInFault::kReflect, "reflect", "positions are those of a mirror"},
    {stand_in::StandInFault::kNoisy, "noisy", "positions are off by up to 0.5 mm"},
    {stand_in::StandInFault::kStop, "stop", "the handle is held where it is"},
    {stand_in::StandInFault::kJump, "jump", "positions are off by 50 mm, speeds are not"},
    {stand_in::StandInFault::kWeak, "weak", "motors give half of what is asked for"},
    {stand_in::StandInFault::kStrong, "strong", "motors give three times as much"},
    {stand_in::StandInFault::kOneWeak, "one_weak", "the motor along x gives 30 %"},
    {stand_in::StandInFault::kScaled, "scaled", "positions and speeds are 1.5 times as large"},
    {stand_in::StandInFault::kFast, "fast", "speeds are twice as large"},
}};

}  // namespace hlm

namespace hlm::stand_in {

/// How the vendor's side finds pose and twist, of which none measures a speed: from encoders.
struct Encoders {
  double step = 0;    ///< Positions are whole multiples of it, m; 0: they have none.
  double window = 0;  ///< Speeds are the mean over that time, s, up to 0.05; 0: over none.
  double cutoff = 0;  ///< Or they pass a low-pass of that cut-off, Hz; 0: none.
};

/// Gives this thread, and those that it will start, a rank above all that is not real-time, where
/// it may: hardware does not wait for other programs.
void run_as_hardware();

/// Moved by the real clock in steps of 0.25 ms, whoever asks and however seldom. Any thread may
/// call; none waits for longer than a few steps.
class StandIn {
 public:
  /// What the vendor's boundary shows of the handle: poses in the device's own frame, which begins
  /// where the handle is now. Throws std::runtime_error if the environment asks for what cannot be.
  explicit StandIn(const server::SimulatedDeviceOptions& options, const Encoders& encoders = {});
  ~StandIn();
  StandIn(const StandIn&) = delete;
  StandIn& operator=(const StandIn&) = delete;

  /// The handle now, as faults let it be seen.
  server::DeviceState state();
  /// The wrench that the motors give from now on, at the handle, device's frame.
  void command(const Wrench& F);
  /// Motors on, without a wrench; what its own safety has taken off is on again. The hand's script
  /// begins with the first time; until then the handle rests.
  void enable();
  void disable();
  /// Takes the motors off by itself if no command comes for that long, s; 0: never.
  void set_watchdog(double time);

  /// Speeds of translation, of rotation, or of both, are the mean over `window`, s, from now on.
  void set_window(double window, bool translations, bool rotations);

  bool has(StandInFault fault) const noexcept {
    return (faults_.load(std::memory_order_relaxed) >> static_cast<unsigned>(fault) & 1) != 0;
  }
  bool enabled();
  /// Whether the watchdog has taken the motors off since they were put on.
  bool watchdog_has_bitten();

 private:
  using Clock = std::chrono::steady_clock;

  void run(const std::stop_token& stop);
  void advance();
  void step();
  void take_off();
  void read_orders();
  void obey(std::string_view order);
  void hold(std::string_view place);
  void begin();

  server::DeviceState handle();
  /// What the vendor's side makes of the handle as it is.
  server::DeviceState encoded(server::DeviceState state) const;

  static constexpr std::size_t kHistory = 256;  ///< Steps that are remembered.

  server::SimulatedDevice device_;
  int orders_ = -1;      ///< Descriptor.
  std::string pending_;  ///< The beginning of an order.
  std::atomic<std::uint32_t> faults_ = 0;

  std::mutex mutex_;  ///< Guards all below, and the device.
  Clock::time_point now_ = Clock::now();
  std::array<server::DeviceState, kHistory> history_;
  std::uint64_t steps_ = 0;
  double cutoff_;                 ///< Hz.
  double step_;                   ///< m.
  std::uint64_t linear_window_;   ///< Steps.
  std::uint64_t angular_window_;  ///< Steps.
  std::optional<Pose> stopped_;   ///< Where the handle is held.
  server::DeviceState shown_;     ///< What was seen last.
  std::minstd_rand noise_;        ///< Noise of kNoisy.
  Wrench command_ = Wrench::Zero();
  Clock::time_point commanded_ = now_;
  Clock::duration watchdog_{0};
  std::uint32_t buttons_ = 0;
  bool enabled_ = false;
  bool bitten_ = false;
  bool has_begun_ = false;
  std::jthread thread_;
};

}  // namespace hlm::stand_in
