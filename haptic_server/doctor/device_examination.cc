#include "haptic_server/doctor/device_examination.h"

#include <cmath>
#include <stdexcept>
#include <string>

#include <spdlog/fmt/fmt.h>

namespace hlm::server {
namespace {

Finding presence(const DeviceDriver& driver) {
  const std::string name(driver.name());
  try {
    const std::vector<std::string> connected = driver.connected();
    if (connected.empty()) {
      return {Verdict::kProblem, "present", "driver " + name + " finds no device",
              "check cable, power and rights; haptic_server --device list says what is connected"};
    }
    return {Verdict::kGood, "present", fmt::format("{}: {}", name, fmt::join(connected, "; ")), ""};
  } catch (const std::runtime_error& error) {
    return {Verdict::kProblem, "present", "driver " + name + ": " + error.what(), ""};
  }
}

Finding health(const std::string& name) {
  const DeviceHealth health = value_of<DeviceHealth>(name).value_or(DeviceHealth::kGood);
  const std::string meaning(meaning_of(health));
  switch (health) {
    case DeviceHealth::kGood:
      return {Verdict::kGood, "state", meaning, ""};
    case DeviceHealth::kForceOff:
      return {Verdict::kProblem, "state", "it is disabled: " + meaning,
              "close its enable switch, or do what its maker says after a safety stop"};
    case DeviceHealth::kSaturated:
    case DeviceHealth::kLate:
      break;
  }
  return {Verdict::kWarning, "state", meaning, ""};
}

Finding end_of_force(bool halts, std::optional<double> time_guard) {
  if (time_guard) {
    return {Verdict::kGood, "at a crash",
            fmt::format("its own time guard ends its force after {} s", *time_guard), ""};
  }
  if (halts) {
    return {Verdict::kGood, "at a crash",
            "its motors are taken off by another process when haptic_server dies or stands still",
            ""};
  }
  return {Verdict::kProblem, "at a crash",
          "its last force stays when haptic_server is killed: it has no time guard, and cannot be "
          "stopped from outside",
          "keep its enable switch within reach of whoever holds it"};
}

Finding rating(const std::string& name, double max_force) {
  if (max_force > 0 && std::isfinite(max_force)) {
    return {Verdict::kGood, "rated", fmt::format("{}, {} N", name, max_force), ""};
  }
  return {Verdict::kWarning, "rated", name + " has no rated force",
          "choose --force-limit by what its motors and the hand endure"};
}

void examine_open(const DeviceChoice& choice, double rate, std::vector<Finding>& findings) {
  const std::unique_ptr<Device> device = choice.driver().open(1 / rate);
  findings.push_back({Verdict::kGood, "opened", std::string(device->name()), ""});
  const DeviceRatings& rated = device->ratings();
  findings.push_back(rating(std::string(device->name()), rated.max_force));
  const std::optional<DeviceState> state = device->read();
  if (!state) {
    findings.push_back({Verdict::kProblem, "state", "it cannot be read",
                        "check its cable and power, and that nothing else uses it"});
  } else {
    findings.push_back(health(std::string(name_of(state->health))));
  }
  findings.push_back(end_of_force(rated.halts, std::isfinite(rated.time_guard)
                                                   ? std::optional(rated.time_guard)
                                                   : std::nullopt));
}

}  // namespace

Examination examine_device(const DeviceChoice& choice, double rate,
                           const std::optional<RunningServer>& running) {
  Examination examination{"Is there a device?", {}};
  std::vector<Finding>& findings = examination.findings;
  if (running) {
    findings = {{Verdict::kGood, "opened", running->device + ", by the running haptic_server", ""},
                rating(running->device, running->max_force),
                health(running->health),
                end_of_force(running->halts, running->time_guard)};
    return examination;
  }
  findings.push_back(presence(choice.driver()));
  if (findings.back().verdict == Verdict::kProblem) return examination;
  try {
    examine_open(choice, rate, findings);
  } catch (const std::runtime_error& error) {
    findings.push_back({Verdict::kProblem, "opened", error.what(), ""});
  }
  return examination;
}

}  // namespace hlm::server
