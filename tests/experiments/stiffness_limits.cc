// k_max of every method on the hole that is shaken with 3 N (b = 100), in one run; and what of it
// is the deformation's doing, what the controller's.
#include <map>

#include <spdlog/fmt/fmt.h>

#include "tests/experiments/experiments.h"
#include "tests/experiments/hole_task.h"
#include "tests/experiments/stiffness_search.h"

namespace hlm::experiments {
namespace {

constexpr double kPush = 3;       // N
constexpr double kDamping = 100;  // N·s/m
constexpr double kDuration = 4;   // s

/// A device as they are: a tick from command to force, and a velocity from encoders.
server::SimulatedDeviceOptions realistic(server::SimulatedDeviceOptions device) {
  device.delay = 1;
  device.position_step = 2e-5;
  device.angle_step = 2e-4;
  device.velocity_cutoff = 100;
  return device;
}

std::map<std::string_view, StiffnessLimit> limits(Bench& bench,
                                                  const std::vector<std::string>& names,
                                                  bool on_realistic_device, Table& table) {
  const std::vector<Method> methods = bench.methods(names);
  Trial trial{hole_task(kPush, 0, kDamping, kDuration), {}, {}, bench.seed()};
  if (on_realistic_device) trial.task.device = realistic(trial.task.device);
  const std::vector<StiffnessLimit> found = bench.map(methods, [&](const Method& method) {
    Trial of_method = trial;
    of_method.method = method;
    return find_stiffness_limit(of_method, bench.quick() ? 1 : 10);
  });
  std::map<std::string_view, StiffnessLimit> result;
  const char* device = on_realistic_device ? "1 tick of delay and filtered velocity" : "ideal";
  for (std::size_t i = 0; i < methods.size(); ++i) {
    result[methods[i].name] = found[i];
    const double ratio = found[i].k_max / result["ir"].k_max;
    table.row(device, methods[i].label, found[i].k_max, ratio, found[i].beyond ? 1.0 : 0.0,
              found[i].monotonous ? 1.0 : 0.0);
  }
  return result;
}

}  // namespace

void stiffness_limits(Bench& bench) {
  std::vector<std::string> names{"ir", "lm0", "lm5", "lm0-direct", "lm5-direct", "ir-four"};
  if (!bench.quick()) {
    for (const Method& method : kMethods) {
      if (std::find(names.begin(), names.end(), method.name) == names.end()) {
        names.emplace_back(method.name);
      }
    }
  }
  Table& table = bench.table("limits", "device,method,k_max,ratio_to_ir,beyond,monotonous");
  auto ideal = limits(bench, names, false, table);
  std::map<std::string_view, StiffnessLimit> real;
  if (!bench.quick()) real = limits(bench, names, true, table);
  if (!bench.complete()) return;

  const auto gain = [&](std::map<std::string_view, StiffnessLimit>& of, const char* name) {
    return of[name].k_max / of["ir"].k_max;
  };
  const auto claim_gain = [&](const char* name, const char* paper) {
    bench.claim({.what = fmt::format("k_max, {}", method(name).label),
                 .paper = paper,
                 .criterion = "at least 4 times that of IR in the same run",
                 .measured = fmt::format("{} against {}: {}{:.1f} times", described(ideal[name]),
                                         described(ideal["ir"]), ideal[name].beyond ? "> " : "",
                                         gain(ideal, name)),
                 .holds = ideal["ir"].k_max > 0 && gain(ideal, name) >= 4});
  };
  claim_gain("lm0", "four times");
  claim_gain("lm5", "four times");
  claim_gain("lm0-direct", "");
  claim_gain("lm5-direct", "");
  if (bench.quick()) return;
  bench.find(fmt::format(
      "Which mechanism brings the stiffness: on an ideal device deformation alone (LM₅ with direct "
      "coupling, k_max {}) already gains {:.1f} times over IR ({}); the four-channel controller "
      "alone "
      "(IR four-channel) gains {:.2f} times. The paper puts the gain down to the controller's "
      "damping. Its own gain shows on a device with one tick of delay and a filtered velocity: "
      "LM₅ direct {}, LM₅ four-channel {}.",
      described(ideal["lm5-direct"]), gain(ideal, "lm5-direct"), described(ideal["ir"]),
      gain(ideal, "ir-four"), described(real["lm5-direct"]), described(real["lm5"])));
}

}  // namespace hlm::experiments
