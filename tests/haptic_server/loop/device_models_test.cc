// Every row of every driver's table of models, as a simulated device with that row's ratings, at
// the server's defaults: does it rest on a wall, and what mass does its handle have?
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "hlm/haptic_server/control/stiffness_bound.h"
#include "hlm/haptic_server/device/device_choice.h"
#include "hlm/haptic_server/device/observed_device.h"
#include "hlm/haptic_server/device/simulated_device.h"
#include "tests/haptic_server/loop/wall_client.h"
#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using test::kPeriod;
using test::kToolMass;
using test::kWall;

struct Row {
  std::string driver;
  RatedModel model;
};

std::vector<Row> all_rows() {
  std::vector<Row> rows;
  for (const auto& driver : all_drivers()) {
    for (const RatedModel& model : driver->models()) {
      rows.push_back({std::string(driver->name()), model});
    }
  }
  return rows;
}

SimulatedDeviceOptions simulated(const Row& row) {
  const DeviceRatings& rated = row.model.ratings;
  SimulatedDeviceOptions options;
  options.mass = row.model.model.mass;
  options.damping = translation_of(rated, kPeriod).damping;
  options.dry_friction = 0;
  options.max_force = rated.max_force;
  options.max_torque = 1e-3;
  options.position_step = row.model.model.step;
  options.delay = static_cast<int>(std::lround(rated.delay / kPeriod));
  options.measures_hand_wrench = false;
  return options;
}

/// The device with the row's ratings and the speed that its driver reports: a mean over a window,
/// where the step of the speed is that of a mean, else a low-pass.
class RatedDevice final : public Device {
 public:
  RatedDevice(std::unique_ptr<Device> raw, const Row& row)
      : raw_(std::move(raw)), ratings_(row.model.ratings), lag_(ratings_.velocity_lag) {
    ratings_.freedoms = raw_->ratings().freedoms;
    const double mean = row.model.model.step / (2 * lag_);
    is_mean_ = lag_ >= kPeriod && std::abs(ratings_.speed_step / mean - 1) < 0.05;
    window_ = is_mean_ ? static_cast<std::size_t>(std::lround(2 * lag_ / kPeriod)) : 1;
  }
  std::string_view name() const noexcept override { return raw_->name(); }
  const DeviceRatings& ratings() const noexcept override { return ratings_; }
  bool measures_hand_wrench() const noexcept override { return false; }
  void align(const Pose& X_WH) noexcept override {
    raw_->align(X_WH);
    past_.fill(X_WH);
    V_.setZero();
  }
  void enable() noexcept override { raw_->enable(); }
  void disable() noexcept override { raw_->disable(); }
  std::optional<DeviceState> read() noexcept override {
    auto state = raw_->read();
    Pose& oldest = past_[step_++ % window_];
    const Twist mean = displacement(oldest, state->X_WD) / (static_cast<double>(window_) * kPeriod);
    oldest = state->X_WD;
    const double gain = is_mean_ || lag_ == 0 ? 1 : -std::expm1(-kPeriod / lag_);
    V_ += gain * (mean - V_);
    state->V_WD = V_;
    return state;
  }
  bool write(const Wrench& F) noexcept override { return raw_->write(F); }

 private:
  std::unique_ptr<Device> raw_;
  DeviceRatings ratings_;
  double lag_;
  bool is_mean_ = false;
  std::size_t window_ = 1;
  std::array<Pose, 64> past_;
  std::size_t step_ = 0;
  Twist V_ = Twist::Zero();
};

struct Task {
  HandScript hand;
  double wall = 0;      // N/m; 0: there is none
  double duration = 5;  // s
};

struct Outcome {
  ControllerGains gains;
  std::vector<TickRecord> ticks;
  Fault fault = Fault::kNone;
};

Outcome run(const Row& row, const Task& task, bool keeps = false) {
  const auto device = with_hand_observer(
      std::make_unique<RatedDevice>(
          std::make_unique<SimulatedDevice>(simulated(row), task.hand, kPeriod), row),
      ObserverOptions{}, kPeriod);
  ServoOptions options;
  options.silence_time = 0.25;
  if (task.wall > 0) options.local_model.stiffness = task.wall;
  if (!keeps) {
    lower_stiffness(options.controller, device->ratings(), kPeriod, options.gains,
                    options.local_model);
  }
  Outcome outcome{.gains = options.gains, .ticks = {}};
  const int ticks = static_cast<int>(task.duration / kPeriod);
  test::WallClient(task.wall > 0).run(options, *device, ticks, [&](int, const TickRecord& record) {
    if (record.fault != Fault::kNone) outcome.fault = record.fault;
    outcome.ticks.push_back(record);
  });
  return outcome;
}

/// A hand that reaches 4 mm into the wall, or as far as half of the device's force brings it.
HandScript pressing(const Row& row) {
  Reach reach;
  const double force = std::min(1.0, row.model.ratings.max_force / 2);
  reach.grip = {.stiffness = 250, .damping = 5};
  reach.position = Vector3(kWall + force / reach.grip.stiffness, 0, 0);
  return {{{0.3, reach}}, AfterLastSegment::kHold};
}

/// Peak to peak of the commanded force in the last 2 s, N.
double shake_at_rest(const Outcome& outcome) {
  double least = 1e9;
  double most = -1e9;
  for (std::size_t i = outcome.ticks.size() - 2000; i < outcome.ticks.size(); ++i) {
    least = std::min(least, outcome.ticks[i].F_command[0]);
    most = std::max(most, outcome.ticks[i].F_command[0]);
  }
  return most - least;
}

/// Encoders so coarse that the observer of the hand toggles with them on the stiffest wall, m.
constexpr double kCoarse = 60e-6;

TEST_CASE("At its defaults every model rests on a wall within 0.1 N, peak to peak") {
  for (const Row& row : all_rows()) {
    for (const double wall : {1000.0, 2000.0, 4000.0, 10'000.0}) {
      const Outcome outcome = run(row, {pressing(row), wall});
      const bool toggles = row.model.model.step >= kCoarse && wall > 4000;
      const double last = outcome.ticks.back().F_command[0];
      CAPTURE(row.driver, row.model.model.name, wall, outcome.gains.stiffness,
              outcome.gains.damping, last);
      CHECK(outcome.fault == Fault::kNone);
      CHECK(last < -0.2);                                      // N: it is pressed.
      CHECK(shake_at_rest(outcome) < (toggles ? 0.25 : 0.1));  // N
    }
  }
}

TEST_CASE("With the coupling as asked a Touch shakes on a wall of 4 kN/m with more than 0.5 N") {
  for (const Row& row : all_rows()) {
    if (row.model.model.name != "Touch") continue;
    CHECK(shake_at_rest(run(row, {pressing(row), 4000}, true)) > 0.5);  // N
  }
}

/// Mass of F = (m + b / iω) a, of a hand that shakes the handle in free motion, kg.
double felt_mass(const Row& row, double frequency) {
  constexpr double kShake = 0.2;  // N
  Push push;
  push.amplitude[0] = kShake;
  push.frequency = frequency;
  const Outcome outcome =
      run(row, {.hand = {{{60, push}}, AfterLastSegment::kHold}, .duration = 8});
  const double w = 2 * std::numbers::pi * frequency;
  constexpr std::size_t kBegin = 4000;
  constexpr std::size_t kCount = 4000;
  std::complex<double> x = 0;
  for (std::size_t i = kBegin; i < kBegin + kCount; ++i) {
    x += outcome.ticks[i].X_WD.p.x() * std::polar(1.0, -w * outcome.ticks[i].time);
  }
  return (std::complex<double>(0, -kShake) / (-w * w * 2.0 * x / double(kCount))).real();
}

TEST_CASE("A handle with its tool is felt with half the sum of their masses, within 10 %") {
  for (const Row& row : all_rows()) {
    if (row.model.ratings.mass == 0) continue;  // Three channels.
    // Of four channels: each pushes the other by what the hand does.
    const double half = (row.model.ratings.mass + kToolMass) / 2;
    CAPTURE(row.driver, row.model.model.name);
    CHECK(felt_mass(row, 1) == Approx(half).epsilon(0.1));  // Hz, kg
  }
}

TEST_CASE("Every row says what the rule for damping needs") {
  for (const Row& row : all_rows()) {
    const DeviceRatings& rated = row.model.ratings;
    CAPTURE(row.driver, row.model.model.name);
    CHECK(row.model.model.mass > 0);
    CHECK(rated.delay > 0);
    CHECK(rated.position_step > 0);
    CHECK(rated.speed_step > 0);
    CHECK(rated.velocity_lag > 0);
    CHECK((std::isinf(rated.continuous_force) || rated.continuous_force < rated.max_force));
    CHECK((rated.max_gripper_force == 0 || rated.gripper));
  }
  CHECK(all_rows().size() == 18);
}

}  // namespace
}  // namespace hlm::server
