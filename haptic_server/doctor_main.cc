// haptic_doctor: whether machine, network and device can do it, and why nothing is felt.
#include <algorithm>
#include <iostream>
#include <stdexcept>

#include "haptic_server/doctor/contact_examination.h"
#include "haptic_server/doctor/device_examination.h"
#include "haptic_server/doctor/force_examination.h"
#include "haptic_server/doctor/machine.h"
#include "haptic_server/doctor/network.h"
#include "haptic_server/doctor/report.h"
#include "haptic_server/program.h"
#include "protocol/transport/udp_socket.h"

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
     "of a capture: whether the client's contacts can be trusted"},
}};

}  // namespace hlm

namespace hlm::server {
namespace {

struct DoctorOptions {
  std::string capture;  ///< Empty: what runs is examined.
  std::string server = "127.0.0.1:47800";
  Part part = Part::kAll;
  bool json = false;
  std::string key_file;  ///< The server's; empty: none.
  MachineOptions machine;
  PhysicsOptions physics;  ///< Of it the rate and the device.
};

std::vector<Examination> examine_capture(const DoctorOptions& options) {
  const auto wanted = [&](Part part) { return options.part == part || options.part == Part::kAll; };
  std::vector<Examination> examinations;
  for (const RecordedSession& session : read_sessions(options.capture)) {
    if (wanted(Part::kForce)) examinations.push_back(examine_force(session));
    if (wanted(Part::kContacts)) examinations.push_back(examine_contacts(session));
  }
  if (examinations.empty()) {
    throw settings::UsageError("--check " + std::string(name_of(options.part)) +
                               " must be all, force or contacts for a capture");
  }
  return examinations;
}

std::vector<Examination> examine_present(const DoctorOptions& options) {
  if (options.part == Part::kContacts) {
    throw settings::UsageError("--check contacts needs a capture: record a session with --record");
  }
  const protocol::Endpoint server = resolve_option("--server", options.server);
  // Machine and device are those of a server here, unless a person asks for them.
  const bool here = protocol::is_own_address(server);
  const auto wanted = [&](Part part) {
    const bool local = part == Part::kMachine || part == Part::kDevice;
    return options.part == part || (options.part == Part::kAll && (here || !local));
  };
  const std::optional<RunningServer> running = find_running(server);
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

int run_doctor(const DoctorOptions& options) {
  const std::vector<Examination> examinations =
      options.capture.empty() ? examine_present(options) : examine_capture(options);
  std::cout << (options.json ? as_json(examinations) : as_text(examinations)) << std::flush;
  if (!std::cout) throw std::runtime_error("standard output takes no report");
  return worst(examinations) == Verdict::kProblem ? kProblem : kOk;
}

const char* const kFooter =
    R"(Examples:
  haptic_doctor                                  this machine, and the server on it
  haptic_doctor --server HOST:47800              from the simulator's machine
  haptic_doctor --check force                    while something should be felt, and is not
  haptic_doctor --device NAME --check device     a device, before the first session
  haptic_doctor run.pcap                         a session recorded with --record
  haptic_doctor run.pcap --check contacts        whether its client's contacts can be trusted

An idle server is measured in a session of two seconds, in which its device is enabled; contacts and
faults are left alone, and so is a server that has a client.

Exit codes: 0 no problem was found; 1 failed; 2 wrong usage or configuration; 4 a problem was found.
)";

void add_doctor_options(settings::CommandLine& command_line, DoctorOptions& options) {
  command_line.optional_positional(
      "CAPTURE", options.capture,
      "A recorded session, pcap or pcapng: its chain of force and its contacts are examined");
  settings::Table& table = command_line.table();
  table.group("Doctor");
  table.text("server", options.server, "HOST:PORT", "The server that is meant");
  table.file("key-file", options.key_file, "The server's key, if it has one");
  table.choice("check", options.part, "What to examine");
  table.flag("json", options.json, "Write the findings as JSON");
  table.not_in_files();
  table.group("Machine");
  table.number("rate", options.physics.servo.rate, kServoRates, "Rate at which the loop is tested");
  table.whole("priority", options.machine.priority, kPriorities, "Its SCHED_FIFO priority");
  table.number("loop-time", options.machine.loop_time, {0.1, 600, "s"}, "For how long");
  options.physics.device.add_to(command_line);
  // The server's own file says more than what is examined.
  command_line.ignore_unknown_keys();
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
       .footer = server::kFooter});
  add_doctor_options(command_line, options);
  return server::run_program(
      "haptic_doctor", command_line, options.physics, argc, argv,
      [&] { server::check(options.physics); }, [&] { return server::run_doctor(options); });
}
