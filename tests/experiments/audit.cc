// What the audit of bodies says of adapters that are right, and of adapters that are not
// (docs/method.md 20).
#include <algorithm>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include <spdlog/fmt/fmt.h>

#include "tests/experiments/body_tasks.h"
#include "tests/experiments/experiments.h"

namespace hlm::experiments {
namespace {

struct Adapter {
  std::string name;
  AdapterFault fault;
  BodyDoubt due = BodyDoubt::kNone;
};

/// Of every body in an update.
AdapterFault of_bodies(void (*change)(MovableBody&)) {
  return {.report = [change](protocol::ContactUpdate& update) {
    std::ranges::for_each(update.bodies, change);
  }};
}

std::vector<Adapter> adapters() {
  const auto forget_contacts = [](protocol::ContactUpdate& update) {
    for (ReportedContact& contact : update.contacts) {
      if (contact.a.kind == SideKind::kToolLink) continue;
      contact.separation = 1;
      contact.load = 0;
    }
  };
  return {
      {"right", {}},
      {"no gravity", of_bodies([](MovableBody& body) { body.A_W.setZero(); }), BodyDoubt::kGravity},
      {"mass for 1/mass", of_bodies([](MovableBody& body) {
         const Matrix6 W = body.W;
         body.W.topLeftCorner<3, 3>() = W.topLeftCorner<3, 3>().inverse();
       }),
       BodyDoubt::kMass},
      {"impulses twice", {.impulses = 2}, BodyDoubt::kTwice},
      {"impulses ignored", {.impulses = 1e-9}, BodyDoubt::kIgnored},
      {"impulses reversed", {.impulses = -1}, BodyDoubt::kReversed},
      {"velocity 0", of_bodies([](MovableBody& body) { body.V_W.setZero(); }),
       BodyDoubt::kVelocity},
      {"no contacts of its own", {.report = forget_contacts}, BodyDoubt::kSupport},
  };
}

struct Misled {
  const Adapter* adapter;
  std::string name;
  BodyTask task;
  BodyConditions conditions;
  std::uint64_t seed;
};

/// What was said most of the time from the first word on, and when that was.
struct Said {
  BodyDoubt doubt = BodyDoubt::kNone;
  double first = -1;  ///< s.
  std::string all;
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Said, doubt, first, all)

Said listen(const Misled& play) {
  const std::vector<BodySample> samples = experiments::run(play.task, play.conditions, play.seed);
  std::map<BodyDoubt, int> counts;
  Said said;
  for (const BodySample& sample : samples) {
    if (sample.doubt == BodyDoubt::kNone) continue;
    if (said.first < 0) said.first = sample.time;
    ++counts[sample.doubt];
  }
  int most = 0;
  for (const auto& [doubt, count] : counts) {
    said.all += fmt::format("{}{} {}", said.all.empty() ? "" : " ", name_of(doubt), count);
    if (count <= most) continue;
    most = count;
    said.doubt = doubt;
  }
  return said;
}

/// Whether what is said leads to the fault: a body that friction holds does not gain what reversed
/// impulses give it, and where no gravity is known it cannot be missed.
bool leads_right(BodyDoubt due, BodyDoubt said) {
  const bool stays = due == BodyDoubt::kReversed || due == BodyDoubt::kGravity;
  return said == due || (stays && said == BodyDoubt::kIgnored);
}

/// Where an adapter that is right could look wrong.
std::vector<std::pair<std::string, BodyTask>> hard_tasks() {
  return {{"tip", tip()},
          {"jam", jam({})},
          {"hit off centre", hit(0.02)},
          {"hit with ball", hit_with_ball(0.01)},
          {"knock", knock(0.15)},
          {"door", open_door(0.15, 0.3)},
          {"tower", rest_on_tower(0.3)},
          {"3 kg on a plate", carry_on_plate(0.1, 3)},
          {"six cubes", rest_on_cubes(6, 0.3, 0.3)},
          {"swinging wall", press_swinging_wall()},
          {"lift 3 kg", lift(3)},
          {"lift 30 g", lift(0.03)}};
}

}  // namespace

void audit(Bench& bench) {
  Table& table =
      bench.table("audit", "adapter,contacts,task,ve_rate_Hz,delay_s,seed,due,said,first_s,all");
  const std::vector<Adapter> all = adapters();
  std::vector<Misled> runs;
  const std::vector<std::pair<std::string, BodyTask>> tasks{
      {"lift", lift(0.3)}, {"slide", slide({})}, {"rest", rest(0.3)}, {"hit", hit(0)}};
  const auto add = [&](const Adapter& adapter, const std::string& name, const BodyTask& task,
                       double loss) {
    for (const bool shapes : {false, true}) {
      for (const double rate : {30.0, 60.0, 240.0}) {
        for (const double delay : {0.0, 0.02}) {
          if (bench.quick() && (rate != 60 || delay < 0.02)) continue;
          runs.push_back({&adapter,
                          name,
                          task,
                          {.ve_rate = rate,
                           .delay = delay,
                           .loss = loss,
                           .server_holds = false,
                           .shapes = shapes,
                           .fault = adapter.fault},
                          bench.seed()});
        }
      }
    }
  };
  for (const Adapter& adapter : all) {
    for (const auto& [name, task] : tasks) add(adapter, name, task, 0);
  }
  for (const auto& [name, task] : hard_tasks()) add(all.front(), name, task, 0);
  for (const auto& [name, task] : tasks) add(all.front(), name + ", 20 % lost", task, 0.2);
  const auto inputs = [](const Misled& r) {
    return Inputs{{"adapter", r.adapter->name}, {"task", r.name}, {"seed", r.seed}} +
           inputs_of(r.conditions);
  };
  const auto said = bench.map(runs, inputs, listen);
  int right = 0;
  int alarms = 0;
  std::map<std::string, int> named;
  int misled = 0;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const Misled& r = runs[i];
    table.row(r.adapter->name, r.conditions.shapes ? "shapes" : "planes", r.name,
              r.conditions.ve_rate, r.conditions.delay, static_cast<double>(r.seed),
              std::string(name_of(r.adapter->due)), std::string(name_of(said[i].doubt)),
              said[i].first, said[i].all);
    const bool is_right = r.adapter->due == BodyDoubt::kNone;
    right += is_right;
    if (said[i].doubt == BodyDoubt::kNone) continue;
    alarms += is_right;
    misled += !is_right && !leads_right(r.adapter->due, said[i].doubt);
    if (!is_right && leads_right(r.adapter->due, said[i].doubt)) ++named[r.adapter->name];
  }
  bench.claim({.what = "Audit, adapters that are right",
               .criterion =
                   "nothing is said of them, in any task, at 30, 60 and 240 Hz, 0 and 20 ms "
                   "each way, with planes and with shapes, nor with 20 % of all lost",
               .measured = fmt::format("{} of {} runs", alarms, right),
               .holds = alarms == 0});
  std::string counts;
  int least = std::numeric_limits<int>::max();
  int sum = 0;
  for (const Adapter& adapter : all) {
    if (adapter.due == BodyDoubt::kNone) continue;
    least = std::min(least, named[adapter.name]);
    sum += named[adapter.name];
    counts += fmt::format("{}{} {}", counts.empty() ? "" : ", ", adapter.name, named[adapter.name]);
  }
  bench.claim({.what = "Audit, adapters that are wrong",
               .criterion =
                   "each of seven faults is named in some of the tasks, wrongly in at most "
                   "3 % of the runs in which anything is said",
               .measured = fmt::format("{}; {} of {} wrongly", counts, misled, misled + sum),
               .holds = least > 0 && misled <= 0.03 * (misled + sum)});
}

}  // namespace hlm::experiments
