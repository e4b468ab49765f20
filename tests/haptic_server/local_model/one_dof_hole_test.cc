// The paper's one-dimensional peg in an exactly fitting hole (Figs. 5, 6 and 9; docs/method.md 7).
#include <algorithm>
#include <cmath>
#include <deque>
#include <numbers>
#include <vector>

#include "hlm/haptic_server/local_model/local_model.h"
#include "tests/support/catch.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

constexpr double kPeriod = 0.02;   // s, of the environment
constexpr double kLatency = 0.02;  // s
constexpr double kDuration = 2;    // s

struct HoleOptions {
  UpdateRule rule = UpdateRule::kRetain;
  double epsilon = 0;        // m
  double clearance = 0;      // m, to either side
  double servo_rate = 1000;  // Hz
  double amplitude = 5;      // N
  bool delayed = true;       // false: the walls are always known
};

struct HoleRun {
  std::vector<double> x;              // m, each tick
  std::vector<double> force;          // N, each tick
  std::vector<double> arrival_depth;  // m, of new contacts that arrive penetrating
  int updates = 0;
  int updates_with_both_walls = 0;
  double largest_update_jump = 0;  // N
};

/// Contacts of a peg at x between walls: points of the peg at 0, walls at ±clearance.
ReportedContacts walls(double x, const HoleOptions& options) {
  ReportedContacts contacts;
  for (const double side : {-1.0, 1.0}) {
    ReportedContact contact;
    contact.identity = side < 0 ? 0 : 1;
    contact.n_W = {-side, 0, 0};
    contact.p_WC = {side * options.clearance, 0, 0};
    contact.separation = options.clearance - side * x;
    if (contact.separation <= options.epsilon) contacts.push_back(contact);
  }
  return contacts;
}

double spring_force(const LocalModel& model) {
  double sum = 0;
  for (const LocalContact& contact : model.contacts()) {
    sum += 10'000 * std::max(0.0, -separation(contact, poses_of(model.proxy(), {}))) *
           contact.now.n_W.x();
  }
  return sum;
}

/// Depth of each reported contact that the model does not have yet, at the peg's present place.
void note_arrivals(const LocalModel& model, const ReportedContacts& reported,
                   const HoleOptions& options, HoleRun& run) {
  const double x = model.proxy().configuration()[0];
  for (const ReportedContact& contact : reported) {
    const bool known =
        std::any_of(model.contacts().begin(), model.contacts().end(),
                    [&](const LocalContact& local) { return local.identity == contact.identity; });
    const double sigma = options.clearance + contact.n_W.x() * x;
    if (!known && sigma < 0) run.arrival_depth.push_back(-sigma);
  }
}

HoleRun shake_peg(const HoleOptions& options) {
  LocalModelParameters parameters;
  parameters.update_rule = options.rule;
  parameters.stiffness = 10'000;
  parameters.damping = 15;
  parameters.static_friction = parameters.kinetic_friction = 0;
  ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3, JointType::kPrismatic);
  tool.links[0].axis = Vector3::UnitX();
  const double dt = 1 / options.servo_rate;
  LocalModel model(tool, Configuration::Zero(1), parameters, dt);

  struct Report {
    double arrives;
    double x;
  };
  std::deque<Report> on_the_way{{0, 0}};
  double next_frame = 0;
  HoleRun run;
  for (int tick = 0; tick * dt < kDuration; ++tick) {
    const double t = tick * dt;
    if (t >= next_frame) {
      on_the_way.push_back({t + kLatency, model.proxy().configuration()[0]});
      next_frame += kPeriod;
    }
    const bool arrived = on_the_way.front().arrives <= t;
    if (arrived || !options.delayed) {
      const double x = options.delayed ? on_the_way.front().x : model.proxy().configuration()[0];
      if (arrived) on_the_way.pop_front();
      const ReportedContacts reported = walls(x, options);
      note_arrivals(model, reported, options, run);
      const double before = spring_force(model);
      model.adopt({.contacts = reported,
                   .q_VE = Configuration::Constant(1, x),
                   .age = options.delayed ? kLatency : 0});
      run.largest_update_jump =
          std::max(run.largest_update_jump, std::abs(spring_force(model) - before));
      ++run.updates;
      run.updates_with_both_walls += model.contacts().size() == 2;
    }
    HandInput hand;
    hand.F[0] = options.amplitude * std::sin(2 * std::numbers::pi * 10 * t);
    run.force.push_back(model.step(hand).F[0]);
    run.x.push_back(model.proxy().configuration()[0]);
  }
  return run;
}

double largest(const std::vector<double>& values) {
  double result = 0;
  for (const double value : values) result = std::max(result, std::abs(value));
  return result;
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

double portion_with_force(const HoleRun& run) {
  const auto count = std::count_if(run.force.begin(), run.force.end(),
                                   [](double f) { return std::abs(f) > 1e-9; });
  return static_cast<double>(count) / static_cast<double>(run.force.size());
}

TEST_CASE("Fig. 6: without deformation the peg leaves the hole, with it the peg stays") {
  const double servo_rate = GENERATE(512.0, 1000.0);
  const UpdateRule rule = GENERATE(UpdateRule::kRetain, UpdateRule::kPaper);
  const HoleRun ir =
      shake_peg({.rule = UpdateRule::kIntermediateRepresentation, .servo_rate = servo_rate});
  CHECK(largest({ir.x.begin(), ir.x.begin() + static_cast<std::ptrdiff_t>(servo_rate)}) > 0.5);

  const HoleRun lm = shake_peg({.rule = rule, .servo_rate = servo_rate});
  CHECK(largest(lm.x) > 0.002);  // m
  CHECK(largest(lm.x) < 0.025);  // m
}

TEST_CASE("Fig. 9, LM₀: walls arrive late and deep, the force is intermittent") {
  const HoleRun run = shake_peg({.epsilon = 0});
  REQUIRE(!run.arrival_depth.empty());
  CHECK(median(run.arrival_depth) > 1e-3);  // m
  CHECK(median(run.arrival_depth) < 10e-3);
  CHECK(portion_with_force(run) < 0.7);
}

TEST_CASE("Fig. 9, LM₅: both walls are always there, and it is as if there were no delay") {
  const HoleRun run = shake_peg({.epsilon = 0.005});
  CHECK(run.updates_with_both_walls == run.updates);
  CHECK(portion_with_force(run) > 0.95);
  CHECK(largest(run.x) < 1.5e-3);          // m
  CHECK(run.largest_update_jump <= 1e-9);  // N

  const HoleRun ideal = shake_peg({.epsilon = 0.005, .delayed = false});
  for (std::size_t i = 0; i < run.x.size(); ++i) REQUIRE(std::abs(run.x[i] - ideal.x[i]) < 1e-9);
}

TEST_CASE("A hole with 2.5 mm clearance feels as without delay: the sign of Eq. 6") {
  const HoleOptions options{.epsilon = 0.005, .clearance = 0.0025, .amplitude = 1};
  const HoleRun run = shake_peg(options);
  HoleOptions undelayed = options;
  undelayed.delayed = false;
  const HoleRun ideal = shake_peg(undelayed);
  for (std::size_t i = 0; i < run.x.size(); ++i) REQUIRE(std::abs(run.x[i] - ideal.x[i]) < 1e-9);
}

}  // namespace
}  // namespace hlm::server
