// The longest ticks of a local model among random scenes in which very much overlaps, in processor
// time of the thread. Usage: heavy_scenes [COUNT [SEED]]; each scene is stepped 20 times at 1 kHz.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <stdexcept>
#include <vector>

#include "hlm/haptic_server/local_model/local_model.h"
#include "tests/support/heap.h"
#include "tests/support/random_tool.h"

namespace hlm::test {
namespace {

constexpr double kStep = 1e-3;  // s
constexpr int kSteps = 20;
constexpr int kUpdateEach = 17;  // Steps.

double processor_time() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

/// Of the ticks of a scene, s. Throws std::length_error if it cannot be made.
std::vector<double> ticks_of(std::uint64_t seed) {
  Random random(seed);
  const RandomHeap heap(random);
  const ToolDescription tool = rigid_tool(1, Matrix3::Identity() * 1e-3);
  server::Scene scene(heap.heap.shapes, {}, tool);
  const auto model = std::make_unique<server::LocalModel>(tool, ToolModel(tool).neutral(),
                                                          server::LocalModelParameters{}, kStep);
  const ReportedContacts none;
  model->set_scene(&scene);
  model->step({});  // What is touched for the first time is not a tick's.
  std::vector<double> ticks;
  for (int step = 0; step < kSteps; ++step) {
    server::HandInput hand;
    hand.F.head<3>() = random.vector(20);
    const double begin = processor_time();
    if (step % kUpdateEach == 1 && !heap.bodies.empty()) {
      model->adopt({.contacts = none,
                    .q_VE = model->proxy().configuration(),
                    .bodies = heap.bodies,
                    .impulse_step = std::max(1.0, step - 16.0),
                    .period = 0.017,
                    .poses = heap.poses});
    }
    model->step(hand);
    ticks.push_back(processor_time() - begin);
    if (!model->velocity().allFinite()) throw std::runtime_error("not finite");
  }
  return ticks;
}

}  // namespace
}  // namespace hlm::test

int main(int count, char** arguments) {
  const long scenes = count > 1 ? std::atol(arguments[1]) : 1000;
  const long seed = count > 2 ? std::atol(arguments[2]) : 1;
  std::vector<double> ticks;
  long refused = 0;
  for (long i = 0; i < scenes; ++i) {
    try {
      const std::vector<double> some = hlm::test::ticks_of(static_cast<std::uint64_t>(seed + i));
      ticks.insert(ticks.end(), some.begin(), some.end());
    } catch (const std::length_error&) {
      ++refused;
    }
  }
  std::ranges::sort(ticks);
  const auto at = [&](double share) {
    return 1e3 * ticks[static_cast<std::size_t>(share * static_cast<double>(ticks.size() - 1))];
  };
  std::printf(
      "%ld scenes, %ld refused as they were made; ticks, ms: median %.3f, 99 %% %.3f, 99.9 %% "
      "%.3f, "
      "longest %.3f\n",
      scenes, refused, at(0.5), at(0.99), at(0.999), at(1));
}
