// What is felt by a rod that is led over posts and between them, and touches none.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <spdlog/fmt/fmt.h>

#include "experiments/corners.h"
#include "experiments/experiments.h"

namespace hlm::experiments {
namespace {

enum class Post : std::uint8_t { kRound, kSquare, kBall };
constexpr std::array kPosts{Post::kRound, Post::kSquare, Post::kBall};
constexpr std::array<const char*, 3> kNames{"round posts", "square posts", "balls"};

// The rod lies along z and moves in the plane of x and y. The posts stand along x, tops at y = 0.
constexpr double kRodRadius = 0.005;  // m
constexpr double kPostRadius = 0.01;  // Half a square post's width, m.
constexpr double kSpacing = 0.06;     // m
constexpr double kPostHeight = 0.1;   // m
constexpr int kCount = 5;             // Of posts in each row; there are three rows along z.
constexpr double kAbove = 0.003;      // Between rod and tops, m.
constexpr double kDip = 0.03;         // Of the rod's lowest point below the tops, m.
constexpr double kSpeed = 0.5;        // Largest, m/s.

std::string geometry(Post post) {
  const auto collision = [](const std::string& shape) {
    return "<collision name='post'><geometry>" + shape + "</geometry></collision>";
  };
  switch (post) {
    case Post::kRound:
      return collision(fmt::format("<cylinder><radius>{}</radius><length>{}</length></cylinder>",
                                   kPostRadius, kPostHeight));
    case Post::kSquare:
      return collision(
          fmt::format("<box><size>{0} {0} {1}</size></box>", 2 * kPostRadius, kPostHeight));
    case Post::kBall:
      break;
  }
  return collision(fmt::format("<sphere><radius>{}</radius></sphere>", kPostRadius));
}

ve::WorldDescription world_of(Post post, const Vector3& rod) {
  const double y = post == Post::kBall ? -kPostRadius : -kPostHeight / 2;
  std::string models;
  for (int i = 0; i < kCount; ++i) {
    for (const double z : {-0.03, 0.0, 0.03}) {
      models += test::fixed_model(
          fmt::format("post_{}_{:g}", i, 1e3 * z),
          fmt::format("{} {} {} 1.5707963267948966 0 0", i * kSpacing, y, z), geometry(post));
    }
  }
  models += test::model(
      "rod", fmt::format("{} {} 0 0 0 0", rod.x(), rod.y()),
      fmt::format("<collision name='rod'><geometry><cylinder><radius>{}</radius><length>0.08"
                  "</length></cylinder></geometry></collision>",
                  kRodRadius),
      "<haptic:tool_joint>planar</haptic:tool_joint>");
  return test::world_of(models);
}

/// Between rod and posts, m.
double gap(Post post, const Vector3& rod) {
  double gap = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kCount; ++i) {
    const double x = rod.x() - i * kSpacing;
    const double distance =
        post == Post::kBall
            ? std::hypot(x, rod.y() + kPostRadius) - kPostRadius
            : std::hypot(std::max(0.0, std::abs(x) - kPostRadius), std::max(0.0, rod.y()));
    gap = std::min(gap, distance - kRodRadius);
  }
  return gap;
}

struct Led {
  Post post;
  std::uint64_t seed;
  CornerConditions conditions;
};

struct Felt {
  double ticks = 0;
  double ghosts = 0;   ///< Ticks with more than kGhostForce.
  double largest = 0;  ///< N
  double least_gap = std::numeric_limits<double>::infinity();  ///< m
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Felt, ticks, ghosts, largest, least_gap)

/// Over all posts and back, then between each two of them and out again.
Felt lead(const Led& led) {
  const double above = kRodRadius + kAbove;
  const Vector3 start(-kSpacing, above, 0);
  server::HandScript hand;
  hand.after = server::AfterLastSegment::kHold;
  double duration = 0;
  Vector3 at = start;
  const auto wait = [&](double time) {
    hand.segments.push_back(firm_reach(time, at));
    duration += time;
  };
  const auto go = [&](const Vector3& to) {
    const double time = duration_of((to - at).norm(), kSpeed);
    at = to;
    wait(time);
  };
  wait(0.3 + 4 * led.conditions.delay);
  go({kCount * kSpacing, above, 0});
  wait(0.2);
  go(start);
  wait(0.2);
  for (int i = 0; i + 1 < kCount; ++i) {
    const double middle = (i + 0.5) * kSpacing;
    go({middle, above, 0});
    wait(0.1);
    go({middle, kRodRadius - kDip, 0});
    wait(0.1);
    go({middle, above, 0});
    wait(0.1);
  }
  Felt felt;
  test::VirtualSessionOptions options =
      session_options(hand, world_of(led.post, start), led.conditions, led.seed);
  options.tool = "rod";
  test::VirtualSession session(options, [&](const server::TickRecord& record) {
    if (record.step == 0) return;
    const double force = record.F_env.head<3>().norm();
    ++felt.ticks;
    felt.ghosts += force > kGhostForce;
    felt.largest = std::max(felt.largest, force);
    felt.least_gap = std::min(felt.least_gap, gap(led.post, record.X_WP.p));
  });
  session.run(duration + 0.2);
  return felt;
}

}  // namespace

void posts(Bench& bench) {
  std::vector<Led> cases;
  for (const std::uint64_t seed : bench.seed_list(bench.quick() ? 1 : 5)) {
    for (const Post post : kPosts) {
      for (const double delay : {0.0, 0.02, 0.1}) {
        cases.push_back({post, seed, {.delay = delay}});
        cases.push_back({post, seed, {.delay = delay, .shapes = false}});
      }
    }
  }
  const auto inputs_of = [](const Led& led) {
    return Inputs{{"posts", kNames[static_cast<std::size_t>(led.post)]},
                  {"contacts", led.conditions.shapes ? "shapes" : "planes"},
                  {"delay_s", led.conditions.delay},
                  {"seed", led.seed}};
  };
  const auto outcomes = bench.map(cases, inputs_of, lead);
  Table& table =
      bench.table("posts", "posts,contacts,delay_s,seed,ghosts,largest_force_n,least_gap_m");
  Felt of_shapes;
  Felt of_planes;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const auto& [post, seed, conditions] = cases[i];
    const Felt& felt = outcomes[i];
    table.row(kNames[static_cast<std::size_t>(post)], conditions.shapes ? "shapes" : "planes",
              conditions.delay, static_cast<double>(seed), felt.ghosts / felt.ticks, felt.largest,
              felt.least_gap);
    Felt& sum = conditions.shapes ? of_shapes : of_planes;
    sum.ticks += felt.ticks;
    sum.ghosts += felt.ghosts;
    sum.largest = std::max(sum.largest, felt.largest);
    sum.least_gap = std::min(sum.least_gap, felt.least_gap);
  }
  const auto in_words = [&](const Felt& felt) {
    return fmt::format("{:.2f} % of the ticks, up to {:.2g} N", 100 * felt.ghosts / felt.ticks,
                       felt.largest);
  };
  bench.claim({.what = "a rod is led at up to 0.5 m/s over and between round posts, square posts "
                       "and balls, and touches none; 0 to 100 ms each way",
               .criterion = "no tick with more than 0.5 N",
               .measured = in_words(of_shapes) + " (planes, ε = 5 mm: " + in_words(of_planes) + ")",
               .holds = of_shapes.ghosts == 0 && of_shapes.least_gap > kTouchesNothing});
}

}  // namespace hlm::experiments
