// Four channels with a measured hand, with an observed one (docs/method.md 14), and without one, on
// a device with encoder steps and delay.
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include <spdlog/fmt/fmt.h>

#include "experiments/experiments.h"
#include "experiments/hole_task.h"
#include "experiments/stiffness_search.h"

namespace hlm::experiments {
namespace {

/// How the server knows the hand.
enum class Hand { kMeasured, kObserved, kUnknown };

std::string_view name_of(Hand hand) {
  switch (hand) {
    case Hand::kMeasured:
      return "measured";
    case Hand::kObserved:
      return "observed";
    case Hand::kUnknown:
      return "unknown";
  }
  return {};
}

struct HandCase {
  Hand hand = Hand::kMeasured;
  double rate = 1000;  ///< Hz.
  int delay = 0;       ///< Of the device, ticks.
};

/// With encoder steps of 0.05 mm and 0.5 mrad, and a velocity that is filtered as they ask for.
Trial trial_of(const HandCase& c, const Task& task) {
  Trial trial{task, method("lm5"), {}, 1};
  server::SimulatedDeviceOptions& device = trial.task.device;
  device.position_step = 5e-5;
  device.angle_step = 5e-4;
  device.velocity_cutoff = 100;
  device.delay = c.delay;
  device.measures_hand_wrench = c.hand == Hand::kMeasured;
  trial.task.observer.on = c.hand == Hand::kObserved;
  trial.conditions.servo_rate = c.rate;
  return trial;
}

Task on_testbed(const server::HandSegment& hand) {
  Task task;
  task.world = test::repository_world("testbed.sdf");
  task.tool = "peg";
  task.hand = hand;
  task.duration = 6;
  task.device.dry_friction = 0;
  task.off_centre = 0;
  return task;
}

constexpr double kShake = 0.5;      // N
constexpr double kFrequency = 2.5;  // Hz
constexpr double kPush = 2;         // N
constexpr double kSettled = 4;      // s

struct KnownHand {
  double mass = 0;     ///< Felt in free motion at the hand's frequency, kg.
  double damping = 0;  ///< Likewise, N·s/m.
  double error = 0;    ///< Of the hand's force as the server knows it, rms, N.
  double pressed = 0;  ///< Mean force on the wall, N.
  StiffnessLimits limits;
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(KnownHand, mass, damping, error, pressed, limits)

/// Mass and damping of F = (m + b / iω) a, of a hand that shakes the handle in free motion.
void shake_freely(const HandCase& c, KnownHand& outcome) {
  const Trace trace = run(trial_of(c, on_testbed(shake({kShake, 0, 0}, kFrequency))));
  const double w = 2 * std::numbers::pi * kFrequency;
  std::complex<double> x = 0;
  double squares = 0;
  int count = 0;
  for (const server::TickRecord& tick : trace.ticks) {
    if (tick.time < kSettled || tick.time >= kSettled + 2) continue;
    x += tick.X_WD.p.x() * std::polar(1.0, -w * tick.time);
    squares += std::pow(tick.F_hand[0] - kShake * std::sin(w * tick.time), 2);
    ++count;
  }
  const std::complex<double> felt =
      std::complex<double>(0, -kShake) / (-w * w * 2.0 * x / static_cast<double>(count));
  outcome.mass = felt.real();
  outcome.damping = -felt.imag() * w;
  outcome.error = std::sqrt(squares / count);
}

KnownHand outcome_of(const HandCase& c) {
  KnownHand outcome;
  shake_freely(c, outcome);
  const Trace pressing = run(trial_of(c, on_testbed(push({0, kPush, 0}))));
  outcome.pressed = -mean(window(
      pressing, [](const server::TickRecord& t) { return t.F_command[1]; }, kSettled, 6));
  constexpr double kDamping = 100;  // N·s/m, as in `limits`
  outcome.limits = find_stiffness_limits(trial_of(c, hole_task(3, 0, kDamping, 4)), 1);
  return outcome;
}

std::vector<HandCase> cases(bool quick) {
  std::vector<HandCase> all;
  for (const double rate : {1000.0, 4000.0}) {
    if (quick && rate > 1000) continue;
    for (const int delay : {0, 1, 3}) {
      for (const Hand hand : {Hand::kMeasured, Hand::kObserved, Hand::kUnknown}) {
        all.push_back({hand, rate, delay});
      }
    }
  }
  return all;
}

}  // namespace

void hand_observer(Bench& bench) {
  const std::vector<HandCase> all = cases(bench.quick());
  const auto inputs_of = [](const HandCase& c) {
    return Inputs{{"hand", name_of(c.hand)}, {"rate_hz", c.rate}, {"delay_ticks", c.delay}};
  };
  const std::vector<KnownHand> outcomes = bench.map(all, inputs_of, outcome_of);
  Table& table = bench.table("observer",
                             "hand,rate_hz,delay_ticks,felt_mass_kg,felt_damping,error_N,"
                             "pressed_N,k_max_energy,k_max_motion");
  double heaviest = 0;     // observed, of measured
  double lightest = 1e9;   // unknown, of measured
  double worst_press = 0;  // of 2 N
  double least_k = 1e9;    // observed, by energy, N/m
  double least_motion = 1e9;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto& [hand, rate, delay] = all[i];
    const KnownHand& o = outcomes[i];
    table.row(name_of(hand), rate, static_cast<double>(delay), o.mass, o.damping, o.error,
              o.pressed, o.limits.energy.k_max, o.limits.motion.k_max);
    const KnownHand& measured = outcomes[i - i % 3];
    worst_press = std::max(worst_press, std::abs(o.pressed / kPush - 1));
    if (hand == Hand::kUnknown) lightest = std::min(lightest, o.mass / measured.mass);
    if (hand != Hand::kObserved) continue;
    heaviest = std::max(heaviest, o.mass / measured.mass);
    least_motion = std::min(least_motion, o.limits.motion.k_max);
    if (rate <= 1000) least_k = std::min(least_k, o.limits.energy.k_max);
  }
  bench.claim(
      {.what = "felt mass in free motion",
       .criterion = "observed hand: within 5 % of a measured one; unknown: 1.8 times",
       .measured = fmt::format("at most {:.3f} times; at least {:.2f} times", heaviest, lightest),
       .holds = heaviest < 1.05 && lightest > 1.8});
  bench.claim({.what = "a wall pressed with 2 N",
               .criterion = "mean force within 2 %",
               .measured = fmt::format("{:.3f} %", 100 * worst_press),
               .holds = worst_press < 0.02});
  bench.claim({.what = "k_max with an observed hand",
               .criterion = "at 1 kHz at least 20 kN/m by energy, and by motion beyond the scan",
               .measured = fmt::format("{:.3g} and {:.3g} kN/m", least_k / 1e3, least_motion / 1e3),
               .holds = least_k >= 20e3 && least_motion >= kMostStiffness});
}

}  // namespace hlm::experiments
