// haptic_doctor: whether machine, network and device can do it, and why nothing is felt.
#include <filesystem>
#include <fstream>
#include <iostream>
#include <stdexcept>

#include <fcntl.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include "hlm/common/descriptor.h"
#include "hlm/haptic_server/program.h"
#include "hlm/protocol/transport/udp_socket.h"
#include "hlm/tools/doctor/contact_examination.h"
#include "hlm/tools/doctor/device_access.h"
#include "hlm/tools/doctor/device_check.h"
#include "hlm/tools/doctor/device_examination.h"
#include "hlm/tools/doctor/fault_release.h"
#include "hlm/tools/doctor/force_examination.h"
#include "hlm/tools/doctor/machine.h"
#include "hlm/tools/doctor/network.h"
#include "hlm/tools/doctor/push_examination.h"
#include "hlm/tools/doctor/report.h"
#include "hlm/tools/doctor/server_list.h"

namespace hlm::server {

/// What is examined.
enum class Part { kAll, kMachine, kNetwork, kDevice, kForce, kContacts };

}  // namespace hlm::server

namespace hlm {

template <>
inline constexpr std::array<Word<server::Part>, 6> kWords<server::Part>{{
    {server::Part::kAll, "all", "everything"},
    {server::Part::kMachine, "machine", "rights, kernel, clocks, the loop"},
    {server::Part::kNetwork, "network", "round trip, jitter, loss, order"},
    {server::Part::kDevice, "device", "present, opened, rated"},
    {server::Part::kForce, "force", "the chain from contact to force"},
    {server::Part::kContacts, "contacts",
     "whether the client's contacts can be trusted: of a capture, or where the server records"},
}};

}  // namespace hlm

namespace hlm::server {
namespace {

struct DoctorOptions {
  std::string subject;  ///< A capture, or kDeviceCheck; empty: what runs is examined.
  std::string server = "127.0.0.1:47800";
  Part part = Part::kAll;
  bool all = false;   ///< All servers of this machine are listed, and nothing is examined.
  bool udev = false;  ///< With kDeviceCheck: udev's rules are written, and nothing is examined.
  bool json = false;
  std::string report;    ///< File for all that was found; empty: none.
  std::string key_file;  ///< The server's; empty: none.
  std::string world_axes = DeviceCheckOptions{}.world_axes;  ///< Axes for the device check.
  std::optional<double> push;  ///< Force of the checked device's pushes, N.
  MachineOptions machine;
  PhysicsOptions physics;  ///< Physics options: only the rate and the device count.
};

/// Word in place of a capture: a person's first minutes with a device.
constexpr const char* kDeviceCheck = "device";

/// Word in place of a capture: a person at the device lets its server's fault end.
constexpr const char* kClear = "clear";

int clear_fault(const DoctorOptions& options) {
  const auto running = find_running(resolve_option("--server", options.server));
  if (!running) {
    throw settings::UsageError("--server " + options.server +
                               " is no server that runs on this machine: a fault is cleared where "
                               "the device is");
  }
  std::cout << release_fault(*running) << std::endl;
  return kOk;
}

/// For what examines nothing.
int print(const std::string& text) {
  std::cout << text << std::flush;
  if (!std::cout) throw std::runtime_error("standard output takes no text");
  return kOk;
}

int list_servers(bool json) {
  const std::vector<RunningServer> servers = find_all_running();
  return print(json ? list_as_json(servers) : list_as_text(servers));
}

std::vector<Examination> check_device(const DoctorOptions& options) {
  if (options.part != Part::kAll) {
    throw settings::UsageError("--check " + std::string(name_of(options.part)) +
                               " does not go with 'device', which has steps of its own");
  }
  const ServoOptions& servo = options.physics.servo;
  return check_device(options.physics.device,
                      {.rate = servo.rate,
                       .priority = options.machine.priority,
                       .max_gap = servo.max_gap,
                       .world_axes = options.world_axes,
                       .push = options.push,
                       .force_limit = servo.limits.max_force},
                      find_running(resolve_option("--server", options.server)));
}

std::vector<Examination> examine_capture(const DoctorOptions& options) {
  const auto wanted = [&](Part part) { return options.part == part || options.part == Part::kAll; };
  std::vector<Examination> examinations;
  for (const RecordedSession& session : read_sessions(options.subject)) {
    if (wanted(Part::kForce)) examinations.push_back(examine_force(session));
    if (wanted(Part::kContacts)) examinations.push_back(examine_contacts(session));
  }
  if (examinations.empty()) {
    throw settings::UsageError("--check " + std::string(name_of(options.part)) +
                               " must be all, force or contacts for a capture");
  }
  return examinations;
}

/// The sessions of a capture that a server names: nothing else than a regular file of its own
/// user's is read, for a doctor that runs as root.
std::vector<RecordedSession> read_own(const std::string& path, uid_t owner) {
  const Descriptor file(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC));
  struct stat facts {};
  if (!file.is_open() || fstat(file.get(), &facts) != 0) {
    throw std::runtime_error(path + ": cannot be read");
  }
  if (!S_ISREG(facts.st_mode) || facts.st_uid != owner) {
    throw std::runtime_error(path + ": is no file of the server's user");
  }
  return read_sessions(path);
}

/// The latest session in what the server records.
RecordedSession latest_session(const std::optional<RunningServer>& running, Part part) {
  if (!running || running->capture.empty()) {
    throw settings::UsageError(
        "--check " + std::string(name_of(part)) +
        " needs a capture, or a server on this machine that records: haptic_server --record FILE");
  }
  return read_own(running->capture, running->owner).back();
}

std::vector<Examination> examine_present(const DoctorOptions& options) {
  const protocol::Endpoint server = resolve_option("--server", options.server);
  // Machine and device are those of a server here, unless a person asks for them.
  const bool here = protocol::is_own_address(server);
  const auto wanted = [&](Part part) {
    const bool local = part == Part::kMachine || part == Part::kDevice;
    return options.part == part || (options.part == Part::kAll && (here || !local));
  };
  const std::optional<RunningServer> running = find_running(server);
  // A recording may be long: it is read where a person asks for it.
  if (options.part == Part::kContacts) {
    return {examine_contacts(latest_session(running, options.part))};
  }
  std::vector<Examination> examinations;
  if (wanted(Part::kMachine)) {
    MachineOptions machine = options.machine;
    machine.rate = options.physics.servo.rate;
    examinations.push_back(examine_machine(machine, running));
  }
  if (wanted(Part::kDevice)) {
    examinations.push_back(
        examine_device(options.physics.device, options.physics.servo.rate, running));
  }
  // Before the network's own session shows up in the server's state.
  if (wanted(Part::kForce)) examinations.push_back(examine_force(running, options.server));
  if (wanted(Part::kNetwork)) {
    examinations.push_back(examine_network(
        {.name = options.server, .server = server, .key = read_key_option(options.key_file)},
        running));
  }
  return examinations;
}

std::vector<Examination> examine(const DoctorOptions& options) {
  if (options.subject == kDeviceCheck) return check_device(options);
  return options.subject.empty() ? examine_present(options) : examine_capture(options);
}

/// Before the examination, which may take a person's time. What the file holds stays until then.
void check_report(const std::string& file) {
  std::error_code ignored;
  const bool is_new = !std::filesystem::exists(file, ignored);
  if (!std::ofstream(file, std::ios::app)) {
    throw settings::UsageError("--report " + file + " cannot be written");
  }
  if (is_new) std::filesystem::remove(file, ignored);
}

void write_report(const std::string& file, const std::string& text) {
  std::ofstream report(file);
  report << text << std::flush;
  if (!report) throw std::runtime_error("--report " + file + " cannot be written");
}

/// What drivers log goes where the report does not.
void configure_logging() {
  spdlog::set_default_logger(spdlog::stderr_logger_mt("haptic_doctor"));
  spdlog::set_pattern("haptic_doctor %l: %v");
}

int run_doctor(const DoctorOptions& options) {
  configure_logging();
  if (options.subject == kClear) return clear_fault(options);
  if (options.all) return list_servers(options.json);
  if (options.udev) return print(udev_rules());
  if (!options.report.empty()) check_report(options.report);
  const std::vector<Examination> examinations = examine(options);
  std::cout << (options.json ? as_json(examinations) : as_text(examinations)) << std::flush;
  if (!std::cout) throw std::runtime_error("standard output takes no report");
  if (!options.report.empty()) {
    write_report(options.report, as_report(examinations, options.physics.device.to_toml(false)));
  }
  if (worst(examinations) == Verdict::kProblem) return kProblem;
  return complete(examinations) ? kOk : kFailed;
}

const char* const kFooter =
    R"(Examples:
  haptic_doctor                                  this machine, and the server on it
  haptic_doctor --server HOST:47800              from the simulator's machine
  haptic_doctor --all                            every server of this machine, one line each
  haptic_doctor --check force                    while something should be felt, and is not
  haptic_doctor --device NAME --check device     whether a device is there, and what it is rated
  haptic_doctor device --device NAME             with a person at it: its rate, noise, frame, and by
                                                 small pushes its force; before the first session
  haptic_doctor device --udev                    udev's rules and the groups that a user needs
  haptic_doctor --check contacts                 whether a client's contacts can be trusted, while
                                                 a session goes on that the server records
  haptic_doctor clear                            whoever stopped the force, or saw to a fault of the
                                                 device or the loop, lets it go on
  haptic_doctor run.pcap                         a session recorded with --record
  haptic_doctor run.pcap --check contacts        whether its client's contacts can be trusted

An idle server is measured in a session of two seconds, in which its device is enabled; contacts and
faults are left alone, and so is a server that has a client.
'device' tells a person what to do, on standard error, and takes answers from standard input. Nothing
moves before that person has typed yes; no push has more than 1 N.

Exit codes: 0 no problem was found; 1 failed, or not all was checked; 2 wrong usage or
configuration; 4 a problem was found.
)";

void add_doctor_options(settings::CommandLine& command_line, DoctorOptions& options) {
  command_line.optional_positional(
      "CAPTURE", options.subject,
      "A recorded session, pcap or pcapng: its chain of force and its contacts are examined; or "
      "the "
      "word device: the device is checked step by step, with a person at it; or the word clear: a "
      "fault of the server on this machine may end");
  settings::Table& table = command_line.table();
  table.group("Doctor");
  table.text("server", options.server, "HOST:PORT", "The server that is meant");
  table.file("key-file", options.key_file, "The server's key, if it has one");
  table.choice("check", options.part, "What to examine");
  table.flag("all", options.all,
             "List all servers of this machine: client, state, lateness, load, missed ticks");
  table.not_in_files();
  table.flag("udev", options.udev,
             "With 'device': write the udev rules that let a user open it, and examine nothing");
  table.not_in_files();
  table.flag("json", options.json, "Write the findings, or the list, as JSON");
  table.not_in_files();
  table.text(
      "report", options.report, "FILE",
      "Write the findings to this file, too, with version, kernel and the device's keys: to be "
      "sent to somebody");
  table.not_in_files();
  table.text("world-axes", options.world_axes, "WORDS",
             "With 'device': where the world's x, y and z point for the person at the device");
  table.not_in_files();
  table.number("push", options.push, kPushes,
               "With 'device': largest force of its pushes. Unset: a tenth of the device's rating");
  table.not_in_files();
  table.number(options.physics.servo.limits, kLimiterNumbers[0]);
  table.group("Machine");
  table.number("rate", options.physics.servo.rate, kServoRates, "Rate at which the loop is tested");
  table.whole("priority", options.machine.priority, kPriorities, "Its SCHED_FIFO priority");
  table.number("loop-time", options.machine.loop_time, {0.1, 600, "s"}, "For how long");
  options.physics.device.add_to(command_line);
  // The server's own file says more than what is examined.
  command_line.ignore_unknown_keys();
}

void check_options(const DoctorOptions& options) {
  check(options.physics);
  const bool has_axes = options.world_axes != DeviceCheckOptions{}.world_axes;
  if (options.subject != kDeviceCheck && (options.push || has_axes || options.udev)) {
    const std::string wrong = options.push ? "--push" : has_axes ? "--world-axes" : "--udev";
    throw settings::UsageError(wrong + " goes with 'device' only: haptic_doctor device");
  }
  const bool writes = options.json || !options.report.empty() || options.part != Part::kAll;
  if (options.udev && writes) {
    throw settings::UsageError("--udev stands alone after 'device': it examines nothing");
  }
  if (options.subject == kClear && writes) {
    throw settings::UsageError("'clear' goes with --server only: it examines nothing");
  }
  if (options.all &&
      (!options.subject.empty() || !options.report.empty() || options.part != Part::kAll)) {
    throw settings::UsageError("--all goes with --json only: it examines nothing");
  }
  if (const auto error = find_error_in_axes(options.world_axes)) {
    throw settings::UsageError("--" + *error);
  }
}

}  // namespace
}  // namespace hlm::server

int main(int argc, char** argv) {
  using namespace hlm;
  server::DoctorOptions options;
  settings::CommandLine command_line(
      {.name = "haptic_doctor",
       .purpose = "Finds out whether machine, network and device can render force, and why none is "
                  "felt.",
       .footer = server::kFooter,
       .usual = {"server", "key-file", "check", "all", "udev", "json", "report", "push",
                 "force-limit"}});
  add_doctor_options(command_line, options);
  return server::run_program(
      "haptic_doctor", command_line, options.physics, argc, argv,
      [&] { server::check_options(options); }, [&] { return server::run_doctor(options); });
}
