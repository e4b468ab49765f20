// The shipped scenes, each played by its own hand as scripts/run does.
#include <algorithm>
#include <string>
#include <vector>

#include <spdlog/fmt/fmt.h>

#include "experiments/experiments.h"
#include "hlm/haptic_server/device/hand_script.h"
#include "tests/support/virtual_session.h"

namespace hlm::experiments {
namespace {

struct Scene {
  std::string name;
  std::string tool;
  std::string hand;
  server::DeviceFreedom freedom;
  double duration;  ///< s.
};

const std::vector<Scene> kScenes{
    {"testbed", "peg", "session", server::DeviceFreedom::kPlanar, 36},
    {"push", "pusher", "push", server::DeviceFreedom::kPlanar, 31},
    {"lift", "fork", "lift", server::DeviceFreedom::kSpatial, 37},
    {"stack", "finger", "stack", server::DeviceFreedom::kSpatial, 24},
    {"door", "finger", "door", server::DeviceFreedom::kPlanar, 25},
    {"linkage", "arm", "linkage", server::DeviceFreedom::kPlanar, 25},
    {"corner", "arm", "corner", server::DeviceFreedom::kPlanar, 27},
    {"scissors", "scissors", "scissors", server::DeviceFreedom::kPlanar, 25},
    {"peg_in_hole_3d", "peg", "peg_in_hole_3d", server::DeviceFreedom::kSpatial, 28},
};

/// A collision, of the tool or of a body with another, explains what the force does so long before
/// and after it, s.
constexpr double kImpact = 0.05;
/// Change of a body's speed within a frame that is a collision, m/s.
constexpr double kJolt = 0.1;

struct Play {
  double largest_force = 0;  ///< |command|, N.
  double update_step = 0;    ///< Largest change of F_env at an update far from collisions, N.
  double limited_at = 0;     ///< s, of a command at its limit far from collisions; 0: none.
  int collisions = 0;
  double judged = 0;  ///< Share of the ticks far from collisions.
  bool broken = false;
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Play, largest_force, update_step, limited_at, collisions, judged,
                                   broken)

Play play(const Scene& scene, std::uint64_t seed) {
  test::VirtualSessionOptions options;
  options.world = test::repository_world(scene.name + ".sdf");
  options.tool = scene.tool;
  options.hand =
      server::read_hand_script((test::worlds_folder() / "hands" / (scene.hand + ".toml")).string());
  options.device.freedom = scene.freedom;
  options.link = {.delay = 0.002};
  options.seed = seed;
  const auto time = [](const server::TickRecord& tick) {
    return 1e-3 * static_cast<double>(tick.step);
  };
  Play result;
  std::vector<server::TickRecord> ticks;
  std::vector<double> collisions;
  std::vector<Vector3> velocities(options.world.bodies.size(), Vector3::Zero());
  test::VirtualSession* running = nullptr;
  test::VirtualSession session(options, [&](const server::TickRecord& tick) {
    if (tick.step == 0) return;
    ticks.push_back(tick);
    bool collides = tick.contact_state == ProxyContactState::kColliding;
    result.collisions += collides;
    for (std::size_t i = 0; i < velocities.size(); ++i) {
      const Twist V = running->environment().world.V_WB(static_cast<int>(i));
      collides = collides || (V.head<3>() - velocities[i]).norm() > kJolt;
      velocities[i] = V.head<3>();
    }
    if (collides) collisions.push_back(time(tick));
  });
  running = &session;
  session.run(scene.duration);

  const double most = options.servo.limits.max_force;
  for (std::size_t i = 1; i < ticks.size(); ++i) {
    const server::TickRecord& tick = ticks[i];
    const double force = tick.F_command.head<3>().norm();
    result.largest_force = std::max(result.largest_force, force);
    const auto next = std::lower_bound(collisions.begin(), collisions.end(), time(tick) - kImpact);
    if (next != collisions.end() && *next <= time(tick) + kImpact) continue;
    result.judged += 1 / static_cast<double>(ticks.size());
    if (tick.session != ticks[0].session) result.broken = true;
    if (force > 0.999 * most) result.limited_at = time(tick);
    if (tick.adopted == 0) continue;
    const Wrench change = tick.F_env - ticks[i - 1].F_env;
    result.update_step = std::max(result.update_step, change.head<3>().norm());
  }
  result.broken |= static_cast<double>(ticks.size()) < 1e3 * scene.duration - 500;
  return result;
}

}  // namespace

void scenes(Bench& bench) {
  std::vector<Scene> played;
  for (const Scene& scene : kScenes) {
    if (!bench.quick() || scene.name == "push" || scene.name == "stack") played.push_back(scene);
  }
  const auto plays = bench.map(
      played,
      [](const Scene& scene) {
        return Inputs{{"scene", scene.name}};
      },
      [&](const Scene& scene) { return play(scene, bench.seed()); });
  Table& table =
      bench.table("scenes", "scene,collisions,largest_force_N,update_step_N,limited_at_s");
  for (std::size_t i = 0; i < played.size(); ++i) {
    const Play& p = plays[i];
    table.row(played[i].name, static_cast<double>(p.collisions), p.largest_force, p.update_step,
              p.limited_at);
    bench.claim(
        {.what = fmt::format("Scene {}", played[i].name),
         .criterion = "the session lasts; 50 ms and more from a collision, three quarters of the "
                      "time at least, the command stays below its limit of 12 N and F_env steps at "
                      "updates by 0.5 N at most",
         .measured = fmt::format("{} collisions, up to {:.1f} N, steps of up to {:.2g} N; "
                                 "{:.0f} % of the time",
                                 p.collisions, p.largest_force, p.update_step, 100 * p.judged),
         .holds = !p.broken && p.judged >= 0.75 && p.limited_at == 0 && p.update_step <= 0.5});
  }
}

}  // namespace hlm::experiments
