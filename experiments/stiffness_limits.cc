// k_max of every method on the hole that is shaken with 3 N (b = 100), in one run; and what of it
// is the deformation's doing, what the controller's.
#include <algorithm>
#include <map>

#include <spdlog/fmt/fmt.h>

#include "experiments/experiments.h"
#include "experiments/hole_task.h"
#include "experiments/stiffness_search.h"
#include "hlm/haptic_server/local_model/parameters.h"

namespace hlm::experiments {
namespace {

constexpr double kPush = 3;       // N
constexpr double kDamping = 100;  // N·s/m
constexpr double kShaking = 4;    // s

/// A device as they are: a tick from command to force, and a velocity from encoders.
server::SimulatedDeviceOptions realistic(server::SimulatedDeviceOptions device) {
  device.delay = 1;
  device.position_step = 2e-5;
  device.angle_step = 2e-4;
  device.velocity_cutoff = 100;
  return device;
}

using Limits = std::map<std::string_view, StiffnessLimits>;

/// On what the methods are compared.
enum class Setting { kIdeal, kRealistic, kIdealHealing };

std::string_view name_of(Setting setting) {
  switch (setting) {
    case Setting::kIdeal:
      return "ideal";
    case Setting::kRealistic:
      return "1 tick of delay and filtered velocity";
    case Setting::kIdealHealing:
      return "ideal, deformation heals";
  }
  return {};
}

Limits limits(Bench& bench, const std::vector<std::string>& names, Setting setting, Table& table) {
  const std::vector<Method> methods = bench.methods(names);
  Trial trial{hole_task(kPush, 0, kDamping, kShaking), {}, {}, bench.seed()};
  if (setting == Setting::kRealistic) trial.task.device = realistic(trial.task.device);
  if (setting == Setting::kIdealHealing) {
    trial.conditions.healing_speed = server::LocalModelParameters{}.healing_speed;
  }
  const int seeds = bench.quick() ? 1 : 10;
  const auto inputs_of = [&](const Method& method) {
    return Inputs{{"method", method.name}, {"device", name_of(setting)}, {"seeds", seeds}};
  };
  const std::vector<StiffnessLimits> found =
      bench.map(methods, inputs_of, [&](const Method& method) {
        Trial of_method = trial;
        of_method.method = method;
        return find_stiffness_limits(of_method, seeds);
      });
  Limits result;
  for (std::size_t i = 0; i < methods.size(); ++i) {
    result[methods[i].name] = found[i];
    for (const Criterion& criterion : kCriteria) {
      const StiffnessLimit& limit = found[i].*criterion.limit;
      table.row(name_of(setting), methods[i].label, criterion.name, limit.k_max,
                limit.beyond ? 1.0 : 0.0, limit.monotonous ? 1.0 : 0.0);
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

/// What the user may give values to.
struct Wanted {
  Conditions conditions;
  double rate = 0;  ///< Of the environment, Hz; 0: drawn.
  double push = kPush;
  double damping = kDamping;
  double friction = Task{}.friction;
  std::string device;
};

void declare_wanted(settings::Table& table, Wanted& wanted) {
  Conditions& conditions = wanted.conditions;
  table.number("delay", conditions.link.delay, {0, 10, "s"}, "Of the network, one way");
  table.number("jitter", conditions.link.jitter, {0, 1, "s"}, "Of that delay");
  table.number("loss", conditions.link.loss, {0, 0.9, ""}, "Share of datagrams");
  table.number("rate", wanted.rate, {1, 1000, "Hz"}, "Of the environment");
  table.number("servo-rate", conditions.servo_rate, {100, 20'000, "Hz"}, "Of the server");
  table.number("healing-speed", conditions.healing_speed, {0, 10, "m/s"}, "Of deformation");
  table.number("push", wanted.push, {0.01, 100, "N"}, "Of the hand, to and fro at 2.5 Hz");
  table.number("damping", wanted.damping, {0, 10'000, "N·s/m"}, "Of contacts");
  table.number("friction", wanted.friction, {0, 10, ""}, "Coefficient");
  table.file("device", wanted.device, "Keys of a simulated device, TOML");
}

Trial trial_of(const Wanted& wanted, const Method& method, std::uint64_t seed) {
  Trial trial{hole_task(wanted.push, 0, wanted.damping, kShaking), method, wanted.conditions, seed};
  trial.task.friction = wanted.friction;
  if (wanted.rate > 0) trial.conditions.ve_low = trial.conditions.ve_high = wanted.rate;
  use_device(wanted.device, trial.task.device);
  return trial;
}

std::vector<Swept> found_limits(const Trial& trial) {
  const StiffnessLimits limits = find_stiffness_limits(trial, 1);
  std::vector<Swept> found;
  for (const Criterion& criterion : kCriteria) {
    const StiffnessLimit& limit = limits.*criterion.limit;
    found.push_back({.what = fmt::format("k_max by {}", criterion.name),
                     .unit = "N/m",
                     .criterion = "",
                     .value = limit.k_max,
                     .note = limit.beyond      ? "beyond"
                             : limit.k_max > 0 ? ""
                                               : "below"});
  }
  return found;
}

/// k_max in the hole with the user's values.
void limits_over(Bench& bench) {
  std::vector<SweptCell> cells;
  const auto variants = bench.over().variants(Wanted{}, declare_wanted);
  for (const Method& method :
       bench.methods_or({"ir", "lm5", "lm5-direct", "shapes", "shapes-direct"})) {
    for (const auto& [wanted, given] : variants) {
      for (const std::uint64_t seed : bench.seeds_of_variant()) {
        cells.push_back({method.name, given, seed, [wanted, method, seed] {
                           return found_limits(trial_of(wanted, method, seed));
                         }});
      }
    }
  }
  sweep_over(bench, "limits", cells);
}

}  // namespace

void stiffness_limits(Bench& bench) {
  if (bench.over().any()) return limits_over(bench);
  std::vector<std::string> names{"ir",         "lm0",     "lm5",    "lm0-direct",
                                 "lm5-direct", "ir-four", "shapes", "shapes-direct"};
  if (!bench.quick()) {
    for (const Method& method : kMethods) {
      if (std::find(names.begin(), names.end(), method.name) == names.end()) {
        names.emplace_back(method.name);
      }
    }
  }
  Table& table = bench.table("limits", "device,method,criterion,k_max,beyond,monotonous");
  Limits ideal = limits(bench, names, Setting::kIdeal, table);
  std::vector<std::string> healing{"lm0-direct", "lm5-direct"};
  if (!bench.quick()) healing.insert(healing.end(), {"lm0", "lm5"});
  Limits healed = limits(bench, healing, Setting::kIdealHealing, table);
  Limits real;
  if (!bench.quick()) real = limits(bench, names, Setting::kRealistic, table);
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
  for (const auto& [name, planes] : {std::pair{"shapes", "lm5"}, {"shapes-direct", "lm5-direct"}}) {
    bool holds = true;
    for (const Criterion& criterion : kCriteria) {
      const double k_max = (ideal[name].*criterion.limit).k_max;
      holds = holds && 1.1 * k_max >= (ideal[planes].*criterion.limit).k_max;
    }
    bench.claim(
        {.what = fmt::format("k_max, {}", method(name).label),
         .criterion = "no lower than with planes, within the 10 % of the search",
         .measured = fmt::format("{} by energy, {} by motion (planes: {}, {})",
                                 described(ideal[name].energy), described(ideal[name].motion),
                                 described(ideal[planes].energy), described(ideal[planes].motion)),
         .holds = holds});
  }
  for (const std::string& name : healing) {
    if (name == "lm0-direct") continue;
    std::string text;
    bool holds = true;
    for (const Criterion& criterion : kCriteria) {
      const StiffnessLimit& with = healed[name].*criterion.limit;
      const StiffnessLimit& without = ideal[name].*criterion.limit;
      holds = holds && 1.1 * with.k_max >= without.k_max;
      text += fmt::format("{}{} with, {} without by {}", text.empty() ? "" : "; ", described(with),
                          described(without), criterion.name);
    }
    bench.claim({.what = fmt::format("k_max where deformation heals, {}", method(name).label),
                 .criterion = "no lower than without healing, within the 10 % of the search",
                 .measured = text,
                 .holds = holds});
  }
  bench.find(fmt::format(
      "Healing brings walls that arrived late back to their place, paid for by what the "
      "contacts took from the device. With direct coupling that costs stiffness by energy: LM₀ "
      "direct has {} with healing, {} without.",
      described(healed["lm0-direct"].energy), described(ideal["lm0-direct"].energy)));
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
