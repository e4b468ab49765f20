// The ticks of a tool that is pressed on surfaces of many pieces, in processor time of the thread.
// Usage: surface_ticks; 2 s of each at 1 kHz, slid and tilted.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <memory>
#include <numbers>
#include <vector>

#include "hlm/haptic_server/local_model/local_model.h"
#include "tests/support/random_tool.h"

namespace hlm::test {
namespace {

constexpr double kStep = 1e-3;  // s
constexpr int kSteps = 2000;
constexpr ContactSide kWorld{SideKind::kWorld, 0};
constexpr ContactSide kTool{SideKind::kToolLink, 0};

double processor_time() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

using Shapes = std::vector<server::PlacedShape>;

void add(Shapes& shapes, const ContactSide& side, const geometry::Shape& shape, const Vector3& p,
         double about_z = 0) {
  shapes.push_back(
      {.shape = std::make_shared<const geometry::ShapeParts>(parts_of(shape, "of the benchmark")),
       .side = side,
       .X_BS = {p, rotation_from_vector(Vector3(0, 0, about_z))}});
}

/// A floor at z = 0 of 24 x 24 tiles; each is lower than the one before by `step`, of three.
void add_tiles(Shapes& shapes, double width, double step) {
  for (int i = 0; i < 24; ++i) {
    for (int j = 0; j < 24; ++j) {
      add(shapes, kWorld, geometry::Box{{width, width, 0.02}},
          {(i - 11.5) * width, (j - 11.5) * width, -0.01 - step * ((i + j) % 3)});
    }
  }
}

void add_slab(Shapes& shapes) {
  add(shapes, kWorld, geometry::Box{{0.6, 0.6, 0.02}}, {0, 0, -0.01});
}

void add_plate(Shapes& shapes) {
  add(shapes, kTool, geometry::Box{{0.1, 0.1, 0.02}}, {0, 0, 0.01});
}

/// A floor and twenty walls around it.
void add_mug(Shapes& shapes) {
  constexpr int kWalls = 20;
  add(shapes, kTool, geometry::Cylinder{0.03, 0.008}, {0, 0, 0.004});
  for (int i = 0; i < kWalls; ++i) {
    const double angle = 2 * std::numbers::pi * i / kWalls;
    const double width = 2 * 0.034 * std::tan(std::numbers::pi / kWalls);
    add(shapes, kTool, geometry::Box{{0.004, width, 0.08}},
        {0.032 * std::cos(angle), 0.032 * std::sin(angle), 0.04}, angle);
  }
}

void time_ticks(const char* name, const Shapes& shapes) {
  const ToolDescription tool = rigid_tool(0.3, Matrix3::Identity() * 3e-4);
  server::Scene scene(shapes, {}, tool);
  const auto model = std::make_unique<server::LocalModel>(tool, ToolModel(tool).neutral(),
                                                          server::LocalModelParameters{}, kStep);
  model->set_scene(&scene);
  model->step({});  // What is touched for the first time is not a tick's.
  std::vector<double> ticks;
  for (int i = 0; i < kSteps; ++i) {
    server::HandInput hand;
    hand.F << 0.9 * std::sin(0.004 * i), 0.7 * std::sin(0.0053 * i), -4, 0.01 * std::sin(0.01 * i),
        0.01 * std::sin(0.013 * i), 0.004 * std::sin(0.02 * i);
    const double begin = processor_time();
    model->step(hand);
    ticks.push_back(1e6 * (processor_time() - begin));
  }
  std::ranges::sort(ticks);
  std::printf("%-34s %8.1f %8.1f %8.1f\n", name, ticks[kSteps / 2], ticks[kSteps * 99 / 100],
              ticks[kSteps * 999 / 1000]);
}

void time_all() {
  std::printf("%-34s %8s %8s %8s  us\n", "", "median", "p99", "p99.9");
  const auto time_on = [](const char* name, const auto& floor, const auto& tool) {
    Shapes shapes;
    floor(shapes);
    tool(shapes);
    time_ticks(name, shapes);
  };
  const auto tiles = [](double width, double step) {
    return [=](Shapes& shapes) { add_tiles(shapes, width, step); };
  };
  time_on("plate on a slab", add_slab, add_plate);
  time_on("plate on tiles of 20 mm", tiles(0.02, 0), add_plate);
  time_on("plate on tiles of 10 mm", tiles(0.01, 0), add_plate);
  time_on("plate on tiles with steps of 20 um", tiles(0.02, 2e-5), add_plate);
  time_on("mug of 21 pieces on a slab", add_slab, add_mug);
  time_on("mug of 21 pieces on tiles", tiles(0.02, 0), add_mug);
}

}  // namespace
}  // namespace hlm::test

int main() { hlm::test::time_all(); }
