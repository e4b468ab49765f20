// Collisions and friction: what impulses do to energy, which of them pull, what of them reaches the
// hand; stick and slip.
#include <algorithm>
#include <cmath>
#include <vector>

#include <spdlog/fmt/fmt.h>

#include "experiments/experiments.h"
#include "hlm/haptic_server/control/controller.h"
#include "tests/support/random_collision.h"
#include "tests/support/virtual_session.h"

namespace hlm::experiments {
namespace {

using server::CollisionRule;
using server::TickRecord;

struct Drawn {
  double energy_error = 0;
  double impulse_error = 0;
  double feasible_error = 0;
  double most_kept = 0;
  double deepest = 0;  ///< m/s, of a contact that closes on.
  int pulls = 0;
  /// Restitution, share of the energy that Newton's rule leaves, and the non-negative one.
  std::vector<std::array<double, 3>> rows;
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Drawn, energy_error, impulse_error, feasible_error, most_kept,
                                   deepest, pulls, rows)

/// Drawn tools of one to five links that approach 1 to 64 contacts.
Drawn draw(int count, std::uint64_t seed) {
  Drawn o;
  test::Random random(seed);
  for (int trial = 0; trial < count; ++trial) {
    const double e = random.uniform(0, 1);
    const test::Case c = random_case(random, random.integer(1, 5), random.integer(1, 64));
    const double before = kinetic_energy(c, c.v);
    const auto kept = [&](CollisionRule rule, double restitution) {
      return kinetic_energy(c, after(c, collision_impulse(rule, c, restitution))) / before;
    };
    const double newton = kept(CollisionRule::kNewton, e);
    const double plastic = 1 - kept(CollisionRule::kNewton, 0);  // |Πu|²/2 of what there is
    o.energy_error = std::max(o.energy_error, std::abs(newton - 1 + (1 - e * e) * plastic));
    const double nonnegative = kept(CollisionRule::kNonnegative, e);
    o.most_kept = std::max(o.most_kept, nonnegative);
    o.rows.push_back({e, newton, nonnegative});

    const Eigen::VectorXd printed = printed_impulse(c, e);
    const GeneralisedForce expected = c.normals * printed;
    const auto off = [&](const GeneralisedForce& impulse) {
      return (impulse - expected).norm() / expected.norm();
    };
    o.impulse_error =
        std::max(o.impulse_error, off(collision_impulse(CollisionRule::kNewton, c, e)));
    const GeneralisedForce without_pull = collision_impulse(CollisionRule::kNonnegative, c, e);
    if (printed.minCoeff() >= 0) o.feasible_error = std::max(o.feasible_error, off(without_pull));
    o.pulls += off(without_pull) > 1e-6;
    const Eigen::VectorXd residual = c.normals.transpose() * (after(c, without_pull) + e * c.v);
    o.deepest = std::max(o.deepest, -residual.minCoeff());
  }
  return o;
}

void drawn_states(Bench& bench) {
  const int count = bench.quick() ? 300 : 2000;
  const Drawn o = bench.run({{"of", "drawn states"}, {"count", count}},
                            [&] { return draw(count, bench.seed()); });
  Table& table = bench.table("collisions", "restitution,newton_share,nonnegative_share");
  for (const auto& [e, newton, nonnegative] : o.rows) table.row(e, newton, nonnegative);
  bench.claim({.what = "Collisions, Eq. 11",
               .criterion = "kinetic energy changes by -(1-e²)/2 |Πu|², to 1e-9 of it, and the "
                            "wrench is that of the printed pseudo-inverse, to 1e-7",
               .measured = fmt::format("{:.1g}; {:.1g}", o.energy_error, o.impulse_error),
               .holds = o.energy_error <= 1e-9 && o.impulse_error <= 1e-7});
  bench.claim({.what = "Collisions, impulses that do not pull",
               .criterion = "no energy is added, no contact closes on faster than restitution "
                            "leaves it (1e-6 m/s), and where Eq. 11 does not pull both are equal "
                            "(1e-7)",
               .measured = fmt::format("at most {:.6g} of the energy is left; {:.1g} m/s; {:.1g}",
                                       o.most_kept, o.deepest, o.feasible_error),
               .holds = o.most_kept <= 1 + 1e-9 && o.deepest <= 1e-6 && o.feasible_error <= 1e-7});
  bench.find(
      fmt::format("Eq. 11 has no equivalent without a pull in {:.0f} % of these states: there the "
                  "impulses that "
                  "do not pull are others. They are the default.",
                  100.0 * o.pulls / count));
}

/// A block before a wall at y = 0, `gap` m away, without friction of the device.
test::VirtualSessionOptions block(double gap) {
  test::VirtualSessionOptions options;
  options.world = test::world_of(
      test::model("tool", fmt::format("0 {} 0 0 0 0", -0.01 - gap), test::box("0.2 0.02 0.02"),
                  "<haptic:tool_joint>planar</haptic:tool_joint>") +
      test::fixed_model("wall", "0 0.1 0 0 0 0", test::box("2 0.2 0.2")));
  options.tool = "tool";
  options.device.dry_friction = 0;
  options.frame.report_friction = {};
  return options;
}

constexpr double kPress = 3;     // N
constexpr double kStatic = 0.5;  // μ_s
constexpr double kKinetic = 0.3;

struct Rubbed {
  double sticks = 0;                          ///< Largest force at rest, N.
  double slips = 0;                           ///< Median force in motion, N.
  std::vector<std::array<double, 4>> series;  ///< Time, pull, felt, speed.
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Rubbed, sticks, slips, series)

/// The block is pressed on the wall and pulled along it, to and fro.
Rubbed rub(std::uint64_t seed) {
  Rubbed result;
  test::VirtualSessionOptions options = block(0.001);
  options.seed = seed;
  options.servo.local_model.static_friction = kStatic;
  options.servo.local_model.kinetic_friction = kKinetic;
  const server::Push press{.constant = test::force(0, kPress)};
  const server::Push pull{
      .constant = test::force(0, kPress), .amplitude = test::force(2, 0), .frequency = 0.25};
  options.hand = {{{1.5, press}, {8, pull}}, server::AfterLastSegment::kHold};
  std::vector<double> sliding;
  test::VirtualSession session(options, [&](const TickRecord& tick) {
    if (tick.time < 1.6) return;
    const double felt = -tick.F_env[0];
    const double speed = tick.V_WP[0];
    if (tick.step % 10 == 0) result.series.push_back({tick.time, tick.F_hand[0], felt, speed});
    if (std::abs(speed) > 0.02) sliding.push_back(std::abs(felt));
    if (std::abs(speed) < 1e-3) result.sticks = std::max(result.sticks, std::abs(felt));
  });
  session.run(9.5);
  result.slips = sliding.empty() ? 0 : median(sliding);
  return result;
}

void friction(Bench& bench) {
  const Rubbed o = bench.run({{"of", "friction"}}, [&] { return rub(bench.seed()); });
  Table& table = bench.table("collisions_friction", "time_s,pull_N,felt_N,speed_m_s");
  for (const auto& [time, pull, felt, speed] : o.series) table.row(time, pull, felt, speed);
  bench.claim({.what = "Friction",
               .criterion = "pressed with 3 N, μ_s = 0.5 and μ_k = 0.3: sticks up to 1.5 N, within "
                            "5 %, and slides at 0.9 N, within 2 %",
               .measured = fmt::format("{:.3g} N; {:.3g} N", o.sticks, o.slips),
               .holds = std::abs(o.sticks / (kStatic * kPress) - 1) <= 0.05 &&
                        std::abs(o.slips / (kKinetic * kPress) - 1) <= 0.02});
}

struct Thrown {
  double felt = 0;                            ///< N·s.
  double lost = 0;                            ///< N·s.
  double largest_command = 0;                 ///< N.
  std::vector<std::array<double, 3>> series;  ///< Time, felt, command.
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Thrown, felt, lost, largest_command, series)

/// The hand throws the block at the wall.
Thrown throw_at_wall(std::uint64_t seed) {
  Thrown result;
  constexpr double kRestitution = 0.3;
  test::VirtualSessionOptions options = block(0.01);
  options.seed = seed;
  options.servo.local_model.restitution = kRestitution;
  options.hand = {{{0.5, server::Push{}}, {10, server::Push{.constant = test::force(0, 1)}}},
                  server::AfterLastSegment::kHold};
  std::vector<TickRecord> ticks;
  test::VirtualSession session(options, [&](const TickRecord& tick) { ticks.push_back(tick); });
  session.run(2);
  const auto hit = std::find_if(ticks.begin(), ticks.end(), [](const TickRecord& tick) {
    return tick.contact_state == ProxyContactState::kColliding;
  });
  // What the position channels do to the proxy.
  const server::ControllerGains gains;
  const auto coupling = [&](const TickRecord& tick) {
    return gains.stiffness * (tick.X_WD.p - tick.X_WP.p).y() +
           gains.damping * (tick.V_WD - tick.V_WP)[1];
  };
  auto& [felt, lost, largest_command, series] = result;
  if (hit != ticks.end() && hit - ticks.begin() > 21 && ticks.end() - hit > 60) {
    // From before the contact's force to after the impulse's end.
    for (auto tick = hit - 20; tick != hit + 60; ++tick) {
      series.push_back({tick->time - hit->time, -tick->F_env[1], -tick->F_command[1]});
      largest_command = std::max(largest_command, tick->F_command.head<3>().norm());
      felt -= 1e-3 * tick->F_env[1];
      lost += 1e-3 * (tick->F_hand[1] + 0.5 * (coupling(*tick) + coupling(*(tick - 1))));
    }
    lost -= (hit + 59)->V_WP[1] - (hit - 21)->V_WP[1];  // of 1 kg
  }
  return result;
}

void impulse(Bench& bench) {
  const Thrown o = bench.run({{"of", "impulse"}}, [&] { return throw_at_wall(bench.seed()); });
  Table& table = bench.table("collisions_impulse", "time_s,felt_N,command_N");
  for (const auto& [time, felt, command] : o.series) table.row(time, felt, command);
  bench.claim({.what = "Collisions, at the hand",
               .criterion = "the hand gets the momentum that the wall takes from the proxy "
                            "(1 kg at some 0.1 m/s, e = 0.3), within 5 %, and no more than 12 N",
               .measured = fmt::format("{:.3g} of {:.3g} N·s, up to {:.3g} N", o.felt, o.lost,
                                       o.largest_command),
               .holds = o.lost > 0.05 && std::abs(o.felt / o.lost - 1) <= 0.05 &&
                        o.largest_command <= 12 + 1e-9});
}

}  // namespace

void collisions(Bench& bench) {
  drawn_states(bench);
  friction(bench);
  impulse(bench);
}

}  // namespace hlm::experiments
