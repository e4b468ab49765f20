// k_max of every method on the hole that is shaken with 3 N (b = 100), in one run; and what of it
// is the deformation's doing, what the controller's.
#include <algorithm>
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

using Limits = std::map<std::string_view, StiffnessLimits>;

Limits limits(Bench& bench, const std::vector<std::string>& names, bool on_realistic_device,
              Table& table) {
  const std::vector<Method> methods = bench.methods(names);
  Trial trial{hole_task(kPush, 0, kDamping, kDuration), {}, {}, bench.seed()};
  if (on_realistic_device) trial.task.device = realistic(trial.task.device);
  const std::vector<StiffnessLimits> found = bench.map(methods, [&](const Method& method) {
    Trial of_method = trial;
    of_method.method = method;
    return find_stiffness_limits(of_method, bench.quick() ? 1 : 10);
  });
  Limits result;
  const char* device = on_realistic_device ? "1 tick of delay and filtered velocity" : "ideal";
  for (std::size_t i = 0; i < methods.size(); ++i) {
    result[methods[i].name] = found[i];
    for (const Criterion& criterion : kCriteria) {
      const StiffnessLimit& limit = found[i].*criterion.limit;
      table.row(device, methods[i].label, criterion.name, limit.k_max, limit.beyond ? 1.0 : 0.0,
                limit.monotonous ? 1.0 : 0.0);
    }
  }
  return result;
}

/// How many times the stiffness of IR, "> " before it where the method is beyond the scan.
struct Gain {
  double ratio = 0;
  std::string text;
};

Gain gain(Limits& of, std::string_view name, const Criterion& criterion) {
  const StiffnessLimit& limit = of[name].*criterion.limit;
  const StiffnessLimit& ir = of["ir"].*criterion.limit;
  const double ratio = ir.k_max > 0 ? limit.k_max / ir.k_max : 0;
  return {ratio, fmt::format("{}{:.3g} times", limit.beyond ? "> " : "", ratio)};
}

/// "12 kN/m against 1.1 kN/m by energy: 11 times; …"
std::string compared(Limits& of, std::string_view name) {
  std::string text;
  for (const Criterion& criterion : kCriteria) {
    text += fmt::format("{}{} against {} by {}: {}", text.empty() ? "" : "; ",
                        described(of[name].*criterion.limit), described(of["ir"].*criterion.limit),
                        criterion.name, gain(of, name, criterion).text);
  }
  return text;
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
  Table& table = bench.table("limits", "device,method,criterion,k_max,beyond,monotonous");
  Limits ideal = limits(bench, names, false, table);
  Limits real;
  if (!bench.quick()) real = limits(bench, names, true, table);
  if (!bench.complete()) return;

  const auto claim_gain = [&](const char* name, const char* paper, bool by_motion) {
    const bool holds = gain(ideal, name, kCriteria[0]).ratio >= 4 &&
                       (!by_motion || gain(ideal, name, kCriteria[1]).ratio >= 4);
    bench.claim(
        {.what = fmt::format("k_max, {}", method(name).label),
         .paper = paper,
         .criterion = fmt::format("at least 4 times that of IR in the same run, by energy{}",
                                  by_motion ? " and by motion" : ""),
         .measured = compared(ideal, name),
         .holds = holds});
  };
  claim_gain("lm0", "four times", false);
  claim_gain("lm5", "four times", true);
  claim_gain("lm0-direct", "", true);
  claim_gain("lm5-direct", "", true);
  bench.find(fmt::format(
      "What counts as stable decides k_max. By energy a method must not give out more than {:.0f} "
      "mJ in {:.0f} s. By motion, the paper's sense, the handle must stay below {} m/s and within "
      "{:.0f} mm: in the hole. IR gives out energy long before it leaves the hole. LM₀ gives out "
      "none, but may drift out ({} by motion): its walls come late, each time a little elsewhere.",
      1e3 * kUnstableEnergy, kEnergyWindow, kUnstableSpeed, 1e3 * kOutOfHole,
      described(ideal["lm0"].motion)));
  if (bench.quick()) return;
  bench.find(fmt::format(
      "Which mechanism brings the stiffness: on an ideal device deformation alone (LM₅ with direct "
      "coupling) gains over IR: {}. The four-channel controller alone (IR four-channel): {}. The "
      "paper puts the gain down to the controller's damping. Its own gain shows on a device with "
      "one tick of delay and a filtered velocity: by energy LM₅ direct {}, LM₅ four-channel {}.",
      compared(ideal, "lm5-direct"), compared(ideal, "ir-four"),
      described(real["lm5-direct"].energy), described(real["lm5"].energy)));
}

}  // namespace hlm::experiments
