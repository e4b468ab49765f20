// Does haptic_doctor name what is wrong between the real programs? Each test seeds one fault.
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <optional>

#include <nlohmann/json.hpp>
#include <unistd.h>

#include "tests/support/catch.h"
#include "tests/system/session.h"

namespace hlm::test {
namespace {

using Catch::Matchers::ContainsSubstring;
using nlohmann::json;

constexpr int kNoProblem = 0;
constexpr int kProblem = 4;

/// The one problem of a report; empty if there is none. Several fail the test.
json only_problem(const std::string& report) {
  json problem;
  const json parsed = json::parse(report);
  for (const json& examination : parsed.at("examinations")) {
    for (const json& finding : examination.at("findings")) {
      if (finding.at("verdict") != "problem") continue;
      INFO(report);
      CHECK(problem.empty());
      problem = finding;
    }
  }
  return problem;
}

/// A server and what else a test needs, all with a runtime directory of their own.
struct Clinic {
  TemporaryDirectory directory;
  int port = free_port();
  std::optional<Process> server;
  std::optional<Process> client;

  Arguments in_directory() const {
    return {"env", "XDG_RUNTIME_DIR=" + directory.file("run"),
            "XDG_STATE_HOME=" + directory.file("state")};
  }
  void start_server(const Arguments& options = {}) {
    server.emplace(in_directory() + server_command(port) + options);
    REQUIRE(server->wait_for_error("listening", 10));
  }
  /// With a hand that pushes on the testbed's wall.
  void start_session(const Arguments& server_options = {}, const Arguments& client_options = {}) {
    start_server(pushing_hand(directory, 1) + server_options);
    client.emplace(client_command(port) + client_options);
    REQUIRE(server->wait_for_error("begins", 10));
  }
  bool has_state() const {
    return std::filesystem::exists(directory.file("run/haptic_server/") + loopback(port) + ".json");
  }
  Finished doctor(const std::string& part, const Arguments& options = {}) const {
    return run(in_directory() +
                   Arguments{HLM_DOCTOR, "--server", loopback(port), "--check", part, "--json"} +
                   options,
               30);
  }
  /// The doctor's word on the force becomes this within some seconds.
  void names(const std::string& link, const std::string& reason) const {
    std::optional<Finished> last;
    const bool named = wait_until(20, [&] {
      last = doctor("force");
      return last->output.find(reason) != std::string::npos;
    });
    INFO(last->output << last->error);
    REQUIRE(named);
    CHECK(last->exit_code == kProblem);
    CHECK(only_problem(last->output).at("subject") == link);
  }
};

TEST_CASE("The doctor finds no problem where the force reaches the hand") {
  Clinic clinic;
  clinic.start_session();
  std::optional<Finished> last;
  CHECK(wait_until(20, [&] {
    last = clinic.doctor("force");
    return last->output.find("the force reaches the hand") != std::string::npos;
  }));
  INFO(last->output);
  CHECK(last->exit_code == kNoProblem);
}

TEST_CASE("The doctor names missing real-time rights") {
  if (geteuid() != 0) {
    WARN("SKIPPED: only root can give rights away");
    return;
  }
  // Beside a haptic_server whose file grants some, the doctor would say that.
  const TemporaryDirectory directory;
  const std::string doctor = directory.file("haptic_doctor");
  std::filesystem::copy_file(HLM_DOCTOR, doctor);
  for (const std::string& path : {directory.file(""), doctor}) {
    std::filesystem::permissions(path, std::filesystem::perms(0755));
  }
  const Finished finished =
      run({"setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", "--bounding-set=-all",
           "--no-new-privs", doctor, "--check", "machine", "--loop-time", "0.3", "--rate", "100"});
  INFO(finished.output << finished.error);
  CHECK(finished.exit_code == kProblem);
  CHECK_THAT(finished.output, ContainsSubstring("the system grants no SCHED_FIFO priority 40") &&
                                  ContainsSubstring("setcap"));
}

TEST_CASE("The doctor names a port at which nothing listens") {
  const Clinic clinic;
  const Finished finished = clinic.doctor("network");
  CHECK(finished.exit_code == kProblem);
  CHECK_THAT(finished.output, ContainsSubstring("nothing listens at that port"));
}

/// A host with a firewall: its own namespace, whose routing drops what is sent to one UDP port.
class FirewalledHost {
 public:
  explicit FirewalledHost(int port) : name_("hapticdoctor" + std::to_string(getpid())) {
    const std::string in = "-n " + name_;
    made_ = ip("netns add " + name_) && ip(in + " link set lo up") &&
            ip(in + " rule add pref 100 lookup local") &&
            ip(in + " rule add pref 10 ipproto udp dport " + std::to_string(port) + " blackhole") &&
            ip(in + " rule del pref 0");
  }
  ~FirewalledHost() { ip("netns delete " + name_); }
  FirewalledHost(const FirewalledHost&) = delete;
  FirewalledHost& operator=(const FirewalledHost&) = delete;

  bool made() const { return made_; }
  Arguments in() const { return {"ip", "netns", "exec", name_}; }

 private:
  static bool ip(const std::string& arguments) {
    return std::system(("ip " + arguments + " >/dev/null 2>&1").c_str()) == 0;
  }

  std::string name_;
  bool made_ = false;
};

TEST_CASE("The doctor names a firewall before a server that runs") {
  const Clinic clinic;
  const FirewalledHost host(clinic.port);
  if (!host.made()) {
    WARN("SKIPPED: network namespaces need root (CAP_SYS_ADMIN) and iproute2");
    return;
  }
  Process server(host.in() + clinic.in_directory() + server_command(clinic.port));
  REQUIRE(server.wait_for_error("listening", 10));
  REQUIRE(wait_until(10, [&] { return clinic.has_state(); }));
  const Finished finished =
      run(host.in() + clinic.in_directory() +
              Arguments{HLM_DOCTOR, "--server", loopback(clinic.port), "--check", "network"},
          30);
  INFO(finished.output << finished.error);
  CHECK(finished.exit_code == kProblem);
  CHECK_THAT(finished.output, ContainsSubstring("firewall of this machine drops it"));
}

TEST_CASE("The doctor names a wrong key and a missing one, and measures with the right one") {
  Clinic clinic;
  const std::string right = clinic.directory.file("right.key");
  const std::string wrong = clinic.directory.file("wrong.key");
  for (const std::string& key : {right, wrong}) REQUIRE(run({HLM_KEYGEN, key}, 5).exit_code == 0);
  clinic.start_server({"--key-file", right});
  REQUIRE(wait_until(10, [&] { return clinic.has_state(); }));

  const Finished measured = clinic.doctor("network", {"--key-file", right});
  INFO(measured.output << measured.error);
  CHECK(measured.exit_code == kNoProblem);
  for (const auto& [options, reason] : {std::pair{Arguments{"--key-file", wrong}, "wrong key"},
                                        std::pair{Arguments{}, "unsealed"}}) {
    Finished finished;
    // Its state still shows the session before for a moment.
    CHECK(wait_until(10, [&, &options = options] {
      finished = clinic.doctor("network", options);
      return finished.output.find("left alone") == std::string::npos;
    }));
    INFO(finished.output << finished.error);
    REQUIRE(finished.exit_code == kProblem);
    CHECK_THAT(std::string(only_problem(finished.output).at("text")), ContainsSubstring(reason));
  }
}

TEST_CASE("The doctor names a slow client") {
  Clinic clinic;
  clinic.start_session({}, {"--rate", "2"});
  clinic.names("updates", "the client is slow: only 2");
}

TEST_CASE("The doctor names contacts that are far") {
  Clinic clinic;
  clinic.start_server();
  clinic.client.emplace(client_command(clinic.port));
  REQUIRE(clinic.server->wait_for_error("begins", 10));
  // No hand: what stops the force first is that. A device that does not measure it misses none.
  SECTION("a hand that is not measured, in free space") {
    clinic.server.emplace(clinic.in_directory() + server_command(clinic.port = free_port()) +
                          Arguments{"--device-option", "measures-hand=false", "--device-option",
                                    "observe-hand=false", "--controller", "three_channel"});
    clinic.client.emplace(client_command(clinic.port));
    clinic.names("contacts", "farther than epsilon");
  }
  SECTION("no hand at all is no problem of the programs") {
    CHECK(wait_until(20, [&] {
      return clinic.doctor("force").output.find("no hand on the device") != std::string::npos;
    }));
    CHECK(clinic.doctor("force").exit_code == kNoProblem);
  }
}

TEST_CASE("The doctor names contacts without stiffness, a force that fades, a limit of nothing") {
  struct Option {
    Arguments given;
    const char* link;
    const char* reason;
  };
  const auto option = GENERATE(
      Option{{"--stiffness", "1"}, "penalty", "the stiffness is only 1.00 N/m"},
      Option{{"--rise-time", "10"}, "limiter", "the force fades"},
      Option{{"--force-limit", "0.01"}, "limiter", "the force limit lets nothing through"});
  Clinic clinic;
  clinic.start_session(option.given);
  clinic.names(option.link, option.reason);
}

TEST_CASE("The doctor names a disabled device") {
  Clinic clinic;
  clinic.start_session({"--device-option", "switched-on=false"});
  clinic.names("device", "the device is disabled");
  CHECK(clinic.doctor("device").exit_code == kProblem);

  const Finished before = run({HLM_DOCTOR, "--check", "device", "--server", loopback(free_port()),
                               "--device-option", "switched-on=false"});
  CHECK(before.exit_code == kProblem);
  CHECK_THAT(before.output, ContainsSubstring("it is disabled"));
}

TEST_CASE("The doctor names a dead client") {
  Clinic clinic;
  clinic.start_session();
  clinic.client->send_signal(SIGKILL);
  clinic.names("updates", "it is dead or hangs");
}

TEST_CASE("The doctor names a server that stands still") {
  Clinic clinic;
  clinic.start_session();
  REQUIRE(wait_until(10, [&] { return clinic.has_state(); }));
  clinic.server->send_signal(SIGSTOP);
  clinic.names("server", "stands still");
  clinic.server->send_signal(SIGCONT);
}

TEST_CASE("The doctor names a fault, and leaves it") {
  Clinic clinic;
  clinic.start_session({"--max-gap", "0.2"});
  clinic.server->send_signal(SIGSTOP);
  wait_until(0.5, [] { return false; });
  clinic.server->send_signal(SIGCONT);
  clinic.names("session", "fault overrun");
  clinic.client.reset();
  // The client is gone: the doctor asks for a session and hears of the fault.
  const Finished network = clinic.doctor("network");
  const Finished force = clinic.doctor("force");
  INFO(network.output << force.output);
  CHECK_THAT(force.output, ContainsSubstring("fault overrun"));
}

TEST_CASE("A fault ends by the doctor's word at the server, and by no client's") {
  Clinic clinic;
  clinic.start_session();
  clinic.server->send_signal(SIGUSR2);
  clinic.names("session", "fault operator_stop");
  clinic.client.emplace(client_command(clinic.port));
  CHECK(clinic.client->wait_for_error("run haptic_doctor clear at the server", 10));
  const Finished clear = run(clinic.in_directory() +
                             Arguments{HLM_DOCTOR, "clear", "--server", loopback(clinic.port)});
  INFO(clear.output << clear.error);
  CHECK(clear.exit_code == 0);
  CHECK_THAT(clear.output, ContainsSubstring("has the fault operator_stop: it ends with the next"));
  clinic.client.emplace(client_command(clinic.port));
  CHECK(clinic.client->wait_for_error("began", 10));
}

TEST_CASE(
    "The doctor clears only where a server runs that can be told, and examines nothing then") {
  const Finished nowhere = run({HLM_DOCTOR, "clear", "--server", loopback(free_port())});
  CHECK(nowhere.exit_code == 2);
  CHECK_THAT(nowhere.error, ContainsSubstring("is no server that runs on this machine"));
  const Finished both = run({HLM_DOCTOR, "clear", "--json"});
  CHECK(both.exit_code == 2);
  CHECK_THAT(both.error, ContainsSubstring("'clear' goes with --server only"));
}

TEST_CASE("The doctor measures an idle server, and leaves one with a client alone") {
  Clinic clinic;
  clinic.start_server();
  const Finished idle = clinic.doctor("network");
  INFO(idle.output << idle.error);
  CHECK(idle.exit_code == kNoProblem);
  CHECK_THAT(idle.output, ContainsSubstring("round trip") && ContainsSubstring(" 0.0 % lost"));

  clinic.client.emplace(client_command(clinic.port));
  REQUIRE(clinic.client->wait_for_error("began", 10));
  // A server whose state cannot be read is asked once, and is busy.
  const Finished busy = run({"env", "XDG_RUNTIME_DIR=/nowhere", HLM_DOCTOR, "--check", "network",
                             "--server", loopback(clinic.port)});
  INFO(busy.output << busy.error);
  CHECK(busy.exit_code == kNoProblem);
  CHECK_THAT(busy.output, ContainsSubstring("has another client"));
  REQUIRE(wait_until(
      5, [&] { return clinic.doctor("network").output.find("left alone") != std::string::npos; }));
  CHECK_THAT(clinic.client->error(), !ContainsSubstring("lost"));
}

TEST_CASE("The doctor reads a recorded session") {
  Clinic clinic;
  clinic.start_session({"--record", clinic.directory.file("run.pcap"), "--stiffness", "1"},
                       {"--duration", "3"});
  CHECK(clinic.client->wait(20) == 0);
  clinic.server->send_signal(SIGTERM);
  REQUIRE(clinic.server->wait(10) == 0);
  const Finished finished = run({HLM_DOCTOR, clinic.directory.file("run.pcap"), "--json"});
  INFO(finished.output << finished.error);
  CHECK(finished.exit_code == kProblem);
  CHECK(only_problem(finished.output).at("subject") == "penalty");
  CHECK_THAT(finished.output, ContainsSubstring("of the states at penalty"));
}

TEST_CASE("The doctor judges the contacts of a session that goes on, where the server records it") {
  Clinic clinic;
  std::optional<Finished> last;
  SECTION("recorded") {
    clinic.start_session({"--record", clinic.directory.file("run.pcap")}, {"--contacts"});
    CHECK(wait_until(20, [&] {
      last = clinic.doctor("contacts");
      return last->output.find("change as the tool moves") != std::string::npos;
    }));
    INFO(last->output << last->error);
    CHECK(last->exit_code == kNoProblem);
  }
  SECTION("not recorded") {
    clinic.start_session();
    REQUIRE(wait_until(5, [&] { return clinic.has_state(); }));
    last = clinic.doctor("contacts");
    CHECK(last->exit_code == 2);
    CHECK_THAT(last->error, ContainsSubstring("that records: haptic_server --record FILE"));
  }
}

TEST_CASE("The doctor lists all servers, with their clients") {
  Clinic clinic;
  clinic.start_session();
  const int base = free_port();
  Process second(clinic.in_directory() + server_command(base) + Arguments{"--instance", "7"});
  REQUIRE(second.wait_for_error("listening", 10));
  // Beside them may be others, of root.
  const auto find = [&](int port) {
    const Finished list = run(clinic.in_directory() + Arguments{HLM_DOCTOR, "--all", "--json"});
    CHECK(list.exit_code == kNoProblem);
    const json report = json::parse(list.output);
    for (const json& each : report.at("servers")) {
      if (each.at("listen") == loopback(port)) return each;
    }
    return json();
  };
  CHECK(wait_until(10, [&] {
    const json first = find(clinic.port);
    return !first.is_null() && first.at("state") == "active";
  }));
  const json first = find(clinic.port);
  CHECK(first.at("client").get<std::string>().starts_with("127.0.0.1:"));
  CHECK(first.at("process") == clinic.server->id());
  CHECK(first.at("load") > 0);
  CHECK(first.at("load") < 2);
  CHECK(first.at("lateness_max") >= first.at("lateness_p50"));
  CHECK(wait_until(5, [&] { return !find(base + 7).is_null(); }));
  CHECK(find(base + 7).at("client") == "");
  const Finished text = run(clinic.in_directory() + Arguments{HLM_DOCTOR, "--all"});
  CHECK_THAT(text.output, ContainsSubstring(loopback(clinic.port)) &&
                              ContainsSubstring(loopback(base + 7) + ' '));

  // A killed server leaves its file behind, and is in no list.
  second.send_signal(SIGKILL);
  second.wait(10);
  CHECK(find(base + 7).is_null());
  CHECK(run({HLM_DOCTOR, "--all", "run.pcap"}).exit_code == 2);
}

TEST_CASE("The exit status of a mistake in the use of the doctor is not that of a problem") {
  CHECK(run({HLM_DOCTOR, "--check", "everything"}).exit_code == 2);
  CHECK(run({HLM_DOCTOR, "--server", "nonsense"}).exit_code == 2);
  const Finished unreadable = run({HLM_DOCTOR, "/nowhere.pcap"});
  CHECK(unreadable.exit_code == 1);
  CHECK_THAT(unreadable.error, ContainsSubstring("/nowhere.pcap"));
}

}  // namespace
}  // namespace hlm::test
