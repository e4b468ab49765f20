#include "hlm/haptic_server/options.h"

#include <cmath>

#include <spdlog/fmt/fmt.h>

#include "hlm/haptic_server/control/stiffness_bound.h"
#include "hlm/protocol/sealing/key_file.h"

namespace hlm::server {
namespace {

using settings::Table;
using settings::UsageError;

constexpr Range kKeptRecordings{0, 10000};
constexpr Range kProcesses{0, 4194304};  // Linux has no larger numbers.
constexpr Range kInstances{0, 99};
constexpr const char* kSimulated = "simulated";

void add_servo_options(Table& table, ServoOptions& o) {
  LocalModelParameters& local = o.local_model;
  table.group("Contacts");
  table.choice("update-rule", local.update_rule, "How contacts carry over an update");
  // What only comparisons change is for experiments to set: the collision rule, the contact step,
  // the limits that are infinite otherwise.
  for (const NumberOf<LocalModelParameters>& each : kLocalModelNumbers) {
    if (std::isfinite(LocalModelParameters{}.*each.number)) table.number(local, each);
  }
  table.group("Controller");
  table.number("rate", o.rate, kServoRates, "Rate of local model and device control");
  table.choice("controller", o.controller,
               "Controller between device and proxy, or a rival to compare with");
  table.numbers(o.gains, kGainNumbers);
  table.flag("keep-stiffness", o.keep_stiffness,
             "Leave stiffness as it is where the device, by its rates and delay, does not bear it; "
             "otherwise it is lowered, also where a client asks for it");
  table.group("Safety");
  table.numbers(o.limits, kLimiterNumbers);
  table.numbers(o.handle, kHandleNumbers);
  table.number("silence-time", o.silence_time, kSilenceTimes,
               "Force fades when nothing of the client has come for this long. Unset: 4.5 of its "
               "frames, within " +
                   to_string(kDefaultSilenceTimes) +
                   ", or 2 s where the server moves what the hand holds");
  table.numbers(o, kServoNumbers);
}

std::string ratings_text(const Device& device) {
  const DeviceRatings& r = device.ratings();
  std::string text = device.measures_hand_wrench() ? "measured" : "";
  if (device.observes_hand_wrench()) text += " by an observer";
  for (const double rating : {r.max_force, r.max_torque, r.max_force_rate, r.max_torque_rate,
                              r.max_power, r.max_turning_power, r.max_stiffness,
                              r.max_angular_stiffness, r.mass, r.inertia, r.damping, r.scale}) {
    text += ' ' + shortest_text(rating);
  }
  if (r.delay > 0) text += " late " + shortest_text(r.delay);
  if (r.velocity_lag > 0) text += " velocity late " + shortest_text(r.velocity_lag);
  if (std::isfinite(r.exchange_rate)) text += " rate " + shortest_text(r.exchange_rate);
  if (r.rotation_scale != 1) text += " turns " + shortest_text(r.rotation_scale);
  return text;
}

/// FNV-1a.
std::uint32_t hash_of(const std::string& text) {
  std::uint32_t hash = 0x811c9dc5u;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x01000193u;
  return hash;
}

void throw_if(const std::optional<std::string>& error) {
  if (error) throw UsageError(*error);
}

void check_attendance(const ServerOptions& options) {
  const std::string_view device = options.physics.device.driver().name();
  if (!options.unattended || device == kSimulated) return;
  throw UsageError(fmt::format(
      "--device {} does not go with --unattended, by which the server comes back by itself after a "
      "crash: a person at a device lets force come back. Only --device {} does",
      device, kSimulated));
}

}  // namespace

void add_options(settings::CommandLine& command_line, PhysicsOptions& options) {
  add_servo_options(command_line.table(), options.servo);
  options.device.add_to(command_line);
}

void add_options(settings::CommandLine& command_line, ServerOptions& options) {
  Table& table = command_line.table();
  table.group("Connection");
  table.text("listen", options.listen, "ADDRESS:PORT", "Where to wait for the client");
  table.whole("instance", options.instance, kInstances,
              "Number of this server among several with the same options: it is added to the port "
              "of --listen");
  table.not_in_files();
  options.key_file = protocol::key_of_service();
  table.file(
      "key-file", options.key_file,
      "Serve only clients with this key, which haptic_keygen makes; all datagrams are sealed. "
      "Without a key the server listens on loopback only");
  table.flag("insecure", options.insecure,
             "Listen anywhere without a key: whoever reaches the address can move the device. For "
             "closed networks");
  table.number("duration", options.duration, {0, 1e9, "s"}, "End after this long; 0 is never");
  table.whole("parent", options.parent, kProcesses,
              "End when the process of this number, which started the server, ends; 0 is none");
  table.not_in_files();
  add_options(command_line, options.physics);
  table.group("Real time");
  table.choice("realtime", options.realtime.policy,
               "What happens without real-time rights. Except with off, no core sleeps while a "
               "session runs, "
               "which costs power");
  table.whole("priority", options.realtime.priority, kPriorities, "SCHED_FIFO priority");
  table.number(
      "final-spin", options.loop.final_spin, {0, 0.5 / kServoRates.least, "s"},
      "Last part of each wait that is spent spinning, at most half a period; costs its share "
      "of one core. Unset: with real-time rights 0.0001, at most 0.4 periods (10 % of a core "
      "at 1 kHz, 40 % from 4 kHz on); without them 0");
  table.group("Device");
  table.flag("without-time-guard", options.without_time_guard,
             "Use a device that keeps its last force when no commands come: if the server and its "
             "guard die in the same instant (Haply), or the server alone (OpenHaptics), only its "
             "enable switch or its plug ends that force");
  table.flag("unattended", options.unattended,
             "Nobody is at the device, and the server may come back by itself after a crash: only "
             "with the simulated device");
  table.not_in_files();
  table.group("Recording");
  table.file("record", options.record,
             "Write all datagrams to this capture file, .pcap, or packed .pcap.gz");
  table.file("log", options.log, "Write every tick's signals to this file, CSV");
  table.text("recordings", options.recordings, "DIRECTORY",
             "Where the last 10 s of every tick are written on a fault or SIGUSR1. Unset: "
             "$STATE_DIRECTORY, $XDG_STATE_HOME/haptic_server or ~/.local/state/haptic_server");
  table.whole("keep-recordings", options.keep_recordings, kKeptRecordings,
              "How many of these stay there, the newest; 0 keeps no ticks and writes none");
  table.choice("log-level", options.log_level, {"trace", "debug", "info", "warn", "error", "off"},
               "What to say on standard error");
  table.yes_no("status", options.status, "Whether to show the live status line");
}

void check(const PhysicsOptions& options) {
  if (options.device.information()) return;
  throw_if(find_error(PeriodicLoopOptions{.rate = options.servo.rate, .final_spin = 0}));
  throw_if(find_error(options.servo));
  throw_if(options.device.find_error());
}

void check(const ServerOptions& options) {
  check(options.physics);
  PeriodicLoopOptions loop = options.loop;
  loop.rate = options.physics.servo.rate;
  throw_if(find_error(loop));
  throw_if(find_error(options.realtime));
  if (options.insecure && !options.key_file.empty()) {
    throw UsageError("--insecure goes without --key-file: with a key every address is safe");
  }
  if (!options.log.empty() && options.log == options.record) {
    throw UsageError(
        fmt::format("--log and --record must name two files, not both {}", options.log));
  }
  check_attendance(options);
}

std::optional<std::string> suit_to(const Device& device, PhysicsOptions& options) {
  ServoOptions& servo = options.servo;
  if (servo.keep_stiffness) return std::nullopt;
  return lower_stiffness(servo.controller, device.ratings(), 1 / servo.rate, servo.gains,
                         servo.local_model);
}

void check_time_guard(const Device& device, const ServerOptions& options) {
  if (std::isfinite(device.ratings().time_guard) || options.without_time_guard) return;
  const char* failure = device.ratings().halts ? "the server and its guard die in the same instant"
                                               : "the server dies";
  throw UsageError(fmt::format(
      "{} has no time guard: if {}, its last force stays. Take a device that ends its force by "
      "itself, or say --without-time-guard and keep its enable switch or its plug within reach",
      device.name(), failure));
}

std::vector<std::string> doubts_about(const PhysicsOptions& options, const Device& device) {
  const ServoOptions& servo = options.servo;
  const DeviceRatings& rated = device.ratings();
  std::vector<std::string> doubts =
      check_against_device(servo.controller, servo.gains, servo.local_model, rated,
                           device.measures_hand_wrench(), 1 / servo.rate);
  if (servo.limits.max_force > rated.max_force) {
    doubts.push_back(
        fmt::format("--force-limit {} N is above the device's rated {} N: {} N is in effect",
                    servo.limits.max_force, rated.max_force, rated.max_force));
  }
  if (!rated.halts && std::isinf(rated.time_guard)) {
    doubts.emplace_back(
        "this device cannot be stopped from outside: if the server is killed, its last force stays "
        "until its enable switch opens");
  }
  if (rated.max_torque == 0) {
    doubts.push_back("this device takes no torque: its handle turns freely");
  } else if (const double rating = rated.max_torque / rated.torque_scale();
             servo.limits.max_torque > rating) {
    doubts.push_back(
        fmt::format("--torque-limit {} N·m is above the device's rated {} N·m: {} N·m is in effect",
                    servo.limits.max_torque, rating, rating));
  }
  return doubts;
}

std::uint64_t fingerprint(const PhysicsOptions& options, const Device& device) {
  ServoOptions servo = options.servo;
  Table table;
  add_servo_options(table, servo);
  const std::uint64_t upper = hash_of(table.to_toml(false) + ratings_text(device));
  return upper << 32 | hash_of(options.device.fingerprint_text());
}

}  // namespace hlm::server
