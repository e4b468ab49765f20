#include "hlm/tools/doctor/device_check.h"

#include <algorithm>
#include <memory>

#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include "hlm/haptic_server/loop/realtime.h"
#include "hlm/haptic_server/program.h"
#include "hlm/tools/doctor/device_bench.h"
#include "hlm/tools/doctor/device_examination.h"
#include "hlm/tools/doctor/frame_examination.h"
#include "hlm/tools/doctor/push_examination.h"
#include "hlm/tools/doctor/report.h"
#include "hlm/tools/doctor/rest_examination.h"

namespace hlm::server {
namespace {

bool has_problem(const Examination& examination) {
  return worst({examination}) == Verdict::kProblem;
}

/// `step` adds its findings to the examination, and returns whether it was done; the reason why it
/// had to end is another one. Whether the next step may follow.
template <class Step>
bool examine(bool may_begin, Examination& examination, Step&& step) {
  std::vector<Finding>& findings = examination.findings;
  examination.complete = false;
  if (!may_begin) {
    findings.push_back(
        {Verdict::kWarning, "step", "not tried: the steps before must be found good first", ""});
    return false;
  }
  try {
    examination.complete = step(findings);
  } catch (const BenchEnded& ended) {
    findings.push_back({ended.verdict, "ended", ended.what(), ""});
  }
  return examination.complete && !has_problem(examination);
}

void examine_steps(DeviceBench& bench, Person& person, const DeviceChoice& choice,
                   const DeviceCheckOptions& options, std::vector<Examination>& examinations) {
  Examination rest{"How does it measure a handle at rest?", {}};
  Examination frame{"Is its frame right?", {}};
  Examination force{"Does it push where it should, and how soon?", {}};
  const Outlook outlook(options.world_axes);
  double noise = 0;
  const bool rests = examine(true, rest, [&](std::vector<Finding>& findings) {
    const RestFigures figures = examine_rest(bench, person);
    noise = figures.noise;
    findings = figures.findings;
    return true;
  });
  const bool has_frame = examine(rests, frame, [&](std::vector<Finding>& findings) {
    return examine_frame(bench, person, choice.workspace(), outlook, findings);
  });
  examine(has_frame, force, [&](std::vector<Finding>& findings) {
    const double most =
        std::min(push_force(bench.device().ratings(), options.push), options.force_limit);
    return examine_pushes(bench, person, outlook, most, noise, findings);
  });
  bench.disable();
  person.say("That is all. What was found:");
  examinations.insert(examinations.end(), {rest, frame, force});
  examinations.push_back({"What did it report meanwhile?", examine_exchange(bench)});
}

}  // namespace

std::vector<Examination> check_device(const DeviceChoice& choice, const DeviceCheckOptions& options,
                                      const std::optional<RunningServer>& running) {
  if (running) {
    throw std::runtime_error(
        fmt::format("haptic_server (process {}) runs and has {}: end it first, or name another one "
                    "with --server",
                    running->process, running->device));
  }
  std::vector<Examination> examinations{{kDeviceQuestion, {}}};
  const std::unique_ptr<Device> device = open_examined(choice, options.rate, examinations.front());
  if (!device) return examinations;
  Person person(STDIN_FILENO);
  DeviceBench bench(*device, options.rate, options.max_gap, person);
  handle_signals(&DeviceBench::request_stop);
  enter_realtime({.policy = RealtimePolicy::kPrefer, .priority = options.priority});
  examine_steps(bench, person, choice, options, examinations);
  return examinations;
}

}  // namespace hlm::server
