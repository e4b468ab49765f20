#include "hlm/tools/doctor/device_bench.h"

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstring>

#include <spdlog/fmt/fmt.h>

namespace hlm::server {
namespace {

constexpr double kLongestRecord = 20;  // s.
/// The handle moves: states that are new tell its rate, m/s. A step of a coarse encoder, 0.1 mm, is
/// then passed in 3 ms.
constexpr double kMovingSpeed = 0.03;
/// A handle with motors on and no command stays where it is if it is free, but after a push it
/// coasts, m from where the run began.
constexpr double kFarthestCoast = 0.08;
/// Nothing moves faster with motors on, m/s: neither a hand nor a push gets there.
constexpr double kRunawaySpeed = 0.5;
/// A push ends when ticks were missed for this long, s.
constexpr double kLongestPause = 0.02;

std::atomic<int> stop_signal = 0;
static_assert(std::atomic<int>::is_always_lock_free);

bool is_finite(const DeviceState& state) noexcept {
  return state.X_WD.p.allFinite() && state.X_WD.R.coeffs().allFinite() && state.V_WD.allFinite();
}

}  // namespace

void DeviceBench::request_stop(int signal) noexcept { stop_signal = signal; }

DeviceBench::DeviceBench(Device& device, double rate, double max_gap, Person& person)
    : device_(device), rate_(rate), max_gap_(max_gap), person_(person), guard_(device, max_gap) {
  samples_.reserve(static_cast<std::size_t>(kLongestRecord * rate));
}

DeviceBench::~DeviceBench() { disable(); }

void DeviceBench::enable(double most) {
  LimiterOptions limits;
  limits.max_force = most;
  limits.rise_time = 1e-3;  // The rate limit alone: a step tells friction from delay.
  limits.max_energy = 2 * most * kFarthestPush;
  limiter_.emplace(limits, device_.ratings(), 1 / rate_);
  device_.enable();
}

void DeviceBench::disable() noexcept {
  limiter_.reset();
  is_free_ = false;
  device_.write(Wrench::Zero());
  device_.disable();
}

void DeviceBench::watch(double time) { run({.longest = time}); }

std::string DeviceBench::ask(const std::string& question) {
  person_.say(question);
  run({.asks = true});
  return person_.answer();
}

bool DeviceBench::ask_whether(const std::string& question) {
  for (std::string answer = ask(question);; answer = ask("Type yes or no.")) {
    if (answer == "yes") return true;
    if (answer == "no") return false;
  }
}

bool DeviceBench::rests(double speed, double patience) {
  run({.longest = patience, .rest_speed = speed});
  return latest_.time - rests_since_ >= kRestTime;
}

bool DeviceBench::push(const Vector3& force, double time) {
  run({.longest = time, .pushes = true, .force = force});
  return new_since_ >= kLead;
}

void DeviceBench::run(const Plan& plan) {
  samples_.clear();
  rests_since_ = new_since_ = 0;
  moved_before_ = false;
  p_start_.reset();
  push_end_ = kLead + plan.longest;
  if (limiter_) limiter_->restart();
  PeriodicLoop loop({.rate = rate_});
  loop.run([&](const Timing& timing) noexcept {
    if (!tick(plan, timing)) loop.stop();
  });
  if (const int signal = stop_signal; signal != 0) {
    throw BenchEnded(Verdict::kWarning, fmt::format("ended by a signal: {}", strsignal(signal)));
  }
  if (failure_ != nullptr) {
    throw BenchEnded(Verdict::kProblem, *failure_ != '\0' ? failure_ : "it cannot be read");
  }
  if (plan.asks && person_.is_gone()) throw BenchEnded(Verdict::kWarning, "no more answers came");
  if (plan.pushes && person_.intervenes()) {
    throw BenchEnded(Verdict::kWarning, person_.is_at_terminal()
                                            ? "the person at the keyboard ended it"
                                            : "the answers ended");
  }
}

/// Whether the run goes on.
bool DeviceBench::tick(const Plan& plan, const Timing& timing) noexcept {
  guard_.beat();
  ++ticks_;
  missed_ += timing.missed;
  if (static_cast<double>(timing.missed) / rate_ > max_gap_) return fail("the loop stood still");
  const std::optional<DeviceState> state = device_.read();
  if (!state) return fail(device_.cause());
  if (!is_finite(*state)) return fail("its pose or its speed is not a number");
  observe(*state, timing);
  if (latest_.v.norm() > plan.rest_speed) rests_since_ = latest_.time;
  if (plan.pushes && state->health == DeviceHealth::kForceOff) {
    return fail(*device_.cause() != '\0' ? device_.cause() : "its own safety holds the motors off");
  }
  if (limiter_ && runs_away(plan)) return fail("with its motors on the handle ran away");
  const Wrench F = command(plan, timing);
  latest_.force = F.head<3>();
  if (samples_.size() < samples_.capacity()) samples_.push_back(latest_);
  if (!device_.write(F)) return fail(device_.cause());
  return goes_on(plan);
}

bool DeviceBench::fail(const char* cause) noexcept {
  failure_ = cause;
  disable();
  return false;
}

bool DeviceBench::runs_away(const Plan& plan) noexcept {
  if (!p_start_) p_start_ = latest_.p;
  const double farthest = plan.pushes || plan.rest_speed > 0 ? kFarthestCoast : kFarthestPush;
  const bool is_far = is_free_ && (latest_.p - *p_start_).norm() > farthest;
  return is_far || latest_.v.norm() > kRunawaySpeed;
}

bool DeviceBench::goes_on(const Plan& plan) noexcept {
  if (stop_signal != 0) return false;
  if (plan.asks) return !person_.has_answered() && !person_.is_gone();
  if (plan.rest_speed > 0 && latest_.time - rests_since_ >= kRestTime) return false;
  if (plan.pushes) return !person_.intervenes() && latest_.time < push_end_ + kCoast;
  return latest_.time < plan.longest;
}

void DeviceBench::observe(const DeviceState& state, const Timing& timing) noexcept {
  const bool is_first = !X_WStart_;
  if (is_first) X_WStart_ = state.X_WD;
  // Of the pose alone: a driver that takes speeds from poses changes them in each tick.
  const bool is_new = is_first || !(state.X_WD == state_.X_WD);
  state_ = state;
  const DeviceRatings& rated = device_.ratings();
  const Vector6 moved = displacement(*X_WStart_, state.X_WD);
  latest_ = {.time = timing.begin,
             .p = moved.head<3>() / rated.scale,
             .v = state.V_WD.head<3>() / rated.scale,
             .turn = moved.tail<3>() / rated.rotation_scale,
             .force = Vector3::Zero()};
  const double speed = latest_.v.norm();
  if (is_new) {
    const bool moves = speed > kMovingSpeed;
    if (moves && moved_before_) gaps_.record(timing.begin - new_since_);
    moved_before_ = moves;
    new_since_ = timing.begin;
  }
  buttons_seen_ |= state.buttons;
  if (state.gripper) {
    gripper_seen_[0] = std::min(gripper_seen_[0], *state.gripper);
    gripper_seen_[1] = std::max(gripper_seen_[1], *state.gripper);
  }
  if (state.health != DeviceHealth::kGood) ++ticks_not_good_;
  if (state.health > health_) {
    health_ = state.health;
    cause_of_health_ = device_.cause();
  }
}

/// The tick's wrench. What ends a push takes its force off at once.
Wrench DeviceBench::command(const Plan& plan, const Timing& timing) noexcept {
  if (!limiter_) return Wrench::Zero();
  const double time = timing.begin;
  bool pushes = plan.pushes && time >= kLead && time < push_end_;
  const bool is_far = (latest_.p - *p_start_).norm() > kFarthestPush;
  const bool is_fast = latest_.v.norm() > kFastestPush;
  const bool is_late = static_cast<double>(timing.missed) / rate_ > kLongestPause;
  const bool is_blind = time - std::max(new_since_, kLead) > kBlindTime;
  if (pushes && (is_far || is_fast || is_late || is_blind || state_.clutched)) {
    pushes = false;
    push_end_ = time;
  }
  limiter_->allow(pushes);
  limiter_->observe(state_.X_WD, 0);
  if (!pushes || person_.intervenes() || stop_signal != 0) {
    limiter_->cut();
    return Wrench::Zero();
  }
  Wrench F = Wrench::Zero();
  F.head<3>() = plan.force;
  return limiter_->limit(F, Wrench::Zero(), state_.V_WD);
}

}  // namespace hlm::server
