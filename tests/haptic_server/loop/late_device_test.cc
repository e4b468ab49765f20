// A hand presses a late device on a wall: does it come to rest at what the server makes of the
// stiffness that was asked for?
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "hlm/haptic_server/control/stiffness_bound.h"
#include "hlm/haptic_server/device/simulated_device.h"
#include "tests/haptic_server/loop/wall_client.h"
#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using test::kPeriod;
using test::kWall;

/// The device with another velocity: the mean over the last 20 ms, as vendors' estimators give it.
class MeanVelocity final : public Device {
 public:
  explicit MeanVelocity(std::unique_ptr<Device> raw) : raw_(std::move(raw)) {
    ratings_ = raw_->ratings();
    ratings_.velocity_lag = kWindow * kPeriod / 2;
  }
  std::string_view name() const noexcept override { return raw_->name(); }
  const DeviceRatings& ratings() const noexcept override { return ratings_; }
  bool measures_hand_wrench() const noexcept override { return raw_->measures_hand_wrench(); }
  void align(const Pose& X_WH) noexcept override {
    raw_->align(X_WH);
    past_.fill(X_WH);
  }
  void enable() noexcept override { raw_->enable(); }
  void disable() noexcept override { raw_->disable(); }
  std::optional<DeviceState> read() noexcept override {
    auto state = raw_->read();
    Pose& oldest = past_[step_++ % kWindow];
    state->V_WD = displacement(oldest, state->X_WD) / (kWindow * kPeriod);
    oldest = state->X_WD;
    return state;
  }
  bool write(const Wrench& F) noexcept override { return raw_->write(F); }

 private:
  static constexpr std::size_t kWindow = 20;  // ticks
  std::unique_ptr<Device> raw_;
  DeviceRatings ratings_;
  std::array<Pose, kWindow> past_;
  std::size_t step_ = 0;
};

struct Case {
  ControllerKind controller = ControllerKind::kFourChannel;
  int delay = 0;        // ticks
  double friction = 0;  // N
  bool mean_velocity = false;
  Grip grip{.stiffness = 500, .damping = 5};
  double push = 0;  // N: instead of a grip
  bool lowered = true;
  int contacts = 1;
  double lever = 0.04;  // m, of two and more
};

HandScript hand_of(const Case& c) {
  if (c.push > 0) {
    Push push;
    push.constant[0] = c.push;
    return {{{1, push}}, AfterLastSegment::kHold};
  }
  Reach reach;
  reach.position = Vector3(kWall + 0.02, 0, 0);
  reach.grip = c.grip;
  return {{{0.3, reach}}, AfterLastSegment::kHold};
}

struct Outcome {
  double sway = 0;       ///< Of the handle in the last 2 s, m, where contacts on a lever are.
  double stiffness = 0;  ///< In effect, N/m.
  bool fault = false;
};

std::unique_ptr<Device> device_of(const Case& c) {
  SimulatedDeviceOptions options;
  options.delay = c.delay;
  options.dry_friction = c.friction;
  auto device = std::make_unique<SimulatedDevice>(options, hand_of(c), kPeriod);
  if (!c.mean_velocity) return device;
  return std::make_unique<MeanVelocity>(std::move(device));
}

/// A session of so many seconds.
Outcome press(const Case& c, double duration = 5) {
  const std::unique_ptr<Device> device = device_of(c);
  ServoOptions options;
  options.controller = c.controller;
  options.silence_time = 0.25;
  if (c.lowered) {
    lower_stiffness(c.controller, device->ratings(), kPeriod, options.gains, options.local_model);
  }
  Outcome outcome;
  outcome.stiffness = traits(c.controller).replaces_proxy ? options.local_model.max_hand_stiffness
                                                          : options.gains.stiffness;
  double least = 1e9;
  double most = -1e9;
  const int ticks = static_cast<int>(duration / kPeriod);
  const int last = ticks - static_cast<int>(2 / kPeriod);
  test::WallClient client(c.contacts, c.contacts > 1 ? c.lever : 0);
  client.run(options, *device, ticks, [&](int i, const TickRecord& record) {
    outcome.fault |= record.fault != Fault::kNone;
    if (i < last) return;
    const double place = record.X_WD.p.x() + c.lever * rotation_vector(record.X_WD.R).z();
    least = std::min(least, place);
    most = std::max(most, place);
  });
  outcome.sway = most - least;
  return outcome;
}

/// Whatever the delay, the friction and the estimate of the velocity: the handle that a hand with
/// little damping presses on a wall, on one contact or two, is at rest after 3 s.
void check_rest(ControllerKind controller) {
  for (int delay = 0; delay <= 50; ++delay) {
    for (const double friction : {0.0, 0.2}) {
      for (const bool mean_velocity : {false, true}) {
        for (const int contacts : {1, 2}) {
          const Outcome outcome = press({.controller = controller,
                                         .delay = delay,
                                         .friction = friction,
                                         .mean_velocity = mean_velocity,
                                         .contacts = contacts});
          CAPTURE(delay, friction, mean_velocity, contacts, outcome.stiffness);
          CHECK_FALSE(outcome.fault);
          CHECK(outcome.sway < 1e-4);  // m
        }
      }
    }
  }
}

TEST_CASE("With four channels a late device rests on a wall, at every delay up to 50 ms") {
  check_rest(ControllerKind::kFourChannel);
}

TEST_CASE("With three channels a late device rests on a wall, at every delay up to 50 ms") {
  check_rest(ControllerKind::kThreeChannel);
}

TEST_CASE("With a coupler a late device rests on a wall, at every delay up to 50 ms") {
  check_rest(ControllerKind::kVirtualCoupler);
}

TEST_CASE("Directly coupled a late device rests on a wall, at every delay up to 50 ms") {
  check_rest(GENERATE(ControllerKind::kDirect, ControllerKind::kRotationCoupler));
}

TEST_CASE("A late device that nothing but itself damps comes to rest, too, in its own time") {
  Case c{.controller = ControllerKind::kDirect, .delay = GENERATE(20, 35, 50), .contacts = 2};
  c.mean_velocity = GENERATE(false, true);
  c.push = 2;  // N
  const double early = press(c, 6).sway;
  const double late = press(c, 20).sway;
  CAPTURE(c.delay, c.mean_velocity, early, late);
  CHECK(late < std::max(early / 5, 1e-5));  // m
}

TEST_CASE("Left as it was asked for, the stiffness shakes a late device") {
  const Case c{.controller = GENERATE(ControllerKind::kFourChannel, ControllerKind::kDirect),
               .delay = 20,
               .lowered = false,
               .contacts = 2};
  CHECK(press(c).sway > 5e-3);  // m
}

}  // namespace
}  // namespace hlm::server
