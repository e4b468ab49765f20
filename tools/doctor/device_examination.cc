#include "hlm/tools/doctor/device_examination.h"

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

/// cause: why, in the device's own words; empty if it does not say.
Finding health(const std::string& name, const std::string& cause) {
  const DeviceHealth health = value_of<DeviceHealth>(name).value_or(DeviceHealth::kGood);
  const std::string meaning(meaning_of(health));
  switch (health) {
    case DeviceHealth::kGood:
      return {Verdict::kGood, "state", meaning, ""};
    case DeviceHealth::kForceOff:
      return {Verdict::kProblem, "state",
              "it is disabled: " + meaning + (cause.empty() ? "" : ": " + cause),
              "close its enable switch, or do what its maker says after a safety stop"};
    case DeviceHealth::kSaturated:
    case DeviceHealth::kLate:
      break;
  }
  return {Verdict::kWarning, "state", meaning, ""};
}

Finding end_of_force(bool halts, std::optional<double> time_guard) {
  if (time_guard == 0) {
    return {Verdict::kGood, "at a crash", "it is simulated: no motor keeps a force", ""};
  }
  if (time_guard) {
    return {Verdict::kGood, "at a crash",
            fmt::format("its own time guard ends its force after {} s", *time_guard), ""};
  }
  if (halts) {
    return {Verdict::kGood, "at a crash",
            "its motors are taken off by another process when haptic_server dies or stands still",
            "it has no time guard if both die: haptic_server asks for --without-time-guard"};
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

/// All that is known of it besides its force.
Finding other_ratings(const DeviceRatings& rated) {
  std::string known;
  std::string unknown;
  const auto add = [&](const char* name, double value, const char* unit, bool is_known) {
    std::string& list = is_known ? known : unknown;
    list += list.empty() ? "" : ", ";
    list += is_known ? fmt::format("{} {:.4g} {}", name, value, unit) : name;
  };
  const auto add_finite = [&](const char* name, double value, const char* unit) {
    add(name, value, unit, std::isfinite(value));
  };
  add_finite("torque", rated.max_torque / rated.torque_scale(), "N·m");
  add_finite("stiffness", rated.max_stiffness * rated.scale, "N/m");
  add_finite("exchange", rated.exchange_rate, "Hz");
  add("mass", rated.mass * rated.scale, "kg", rated.mass > 0);
  add("delay", 1e3 * rated.delay, "ms", rated.delay > 0);
  return {Verdict::kNote, "rated",
          fmt::format("at the handle: {}; not known: {}", known.empty() ? "nothing else" : known,
                      unknown.empty() ? "nothing" : unknown),
          ""};
}

void examine_opened(Device& device, std::vector<Finding>& findings) {
  findings.push_back({Verdict::kGood, "opened", std::string(device.name()), ""});
  const DeviceRatings& rated = device.ratings();
  findings.push_back(rating(std::string(device.name()), rated.max_force));
  findings.push_back(other_ratings(rated));
  const std::optional<DeviceState> state = device.read();
  if (!state) {
    findings.push_back({Verdict::kProblem, "state",
                        "it cannot be read: " + std::string(device.cause()),
                        "check its cable and power, and that nothing else uses it"});
  } else {
    findings.push_back(health(std::string(name_of(state->health)), device.cause()));
  }
  findings.push_back(end_of_force(rated.halts, std::isfinite(rated.time_guard)
                                                   ? std::optional(rated.time_guard)
                                                   : std::nullopt));
}

}  // namespace

std::unique_ptr<Device> open_examined(const DeviceChoice& choice, double rate,
                                      Examination& examination) {
  std::vector<Finding>& findings = examination.findings;
  findings.push_back(presence(choice.driver()));
  const bool is_listed = findings.back().verdict != Verdict::kProblem;
  try {
    std::unique_ptr<Device> device = choice.open(1 / rate);
    // One whose place a person names need not be listed.
    if (!is_listed) findings.back() = {Verdict::kNote, "present", "not listed by its driver", ""};
    examine_opened(*device, findings);
    return device;
  } catch (const std::runtime_error& error) {
    const std::string advice = is_listed ? "" : findings.back().advice;
    if (!is_listed) findings.pop_back();
    findings.push_back({Verdict::kProblem, "opened", error.what(), advice});
    return nullptr;
  }
}

Examination examine_device(const DeviceChoice& choice, double rate,
                           const std::optional<RunningServer>& running) {
  Examination examination{kDeviceQuestion, {}};
  if (running) {
    examination.findings = {
        {Verdict::kGood, "opened", running->device + ", by the running haptic_server", ""},
        rating(running->device, running->max_force),
        health(running->health, ""),
        end_of_force(running->halts, running->time_guard)};
  } else {
    open_examined(choice, rate, examination);
  }
  return examination;
}

}  // namespace hlm::server
