// Does root's haptic_doctor believe what another user of the machine leaves in its own run folder?
#include <csignal>
#include <filesystem>
#include <optional>
#include <sstream>

#include <nlohmann/json.hpp>
#include <unistd.h>

#include "tests/support/catch.h"
#include "tests/system/session.h"

namespace hlm::test {
namespace {

using Catch::Matchers::ContainsSubstring;
using nlohmann::json;

constexpr const char* kNobody = "65534";

/// A machine with the run folders of root, who has a server, and of a user who has planted files.
class SharedMachine {
 public:
  SharedMachine() {
    namespace fs = std::filesystem;
    for (const std::string& path :
         {directory_.file(""), directory_.file("run/user/0"), planted()}) {
      fs::create_directories(path);
    }
    fs::permissions(directory_.file(""), fs::perms(0755));
    REQUIRE(chown(planted().c_str(), 65534, 65534) == 0);
    server_.emplace(Arguments{"env", "XDG_RUNTIME_DIR=" + directory_.file("run/user/0"),
                              "XDG_STATE_HOME=" + directory_.file("state")} +
                    server_command(port_));
    REQUIRE(server_->wait_for_error("listening", 10));
    REQUIRE(wait_until(10, [&] { return fs::exists(own() + "/" + victim() + ".json"); }));
  }

  std::string victim() const { return loopback(port_); }
  std::string socket() const { return own() + "/" + victim() + ".sock"; }
  Process& server() { return *server_; }

  /// Addresses of which files were planted.
  std::vector<std::string> plant() {
    const std::string script = directory_.file("plant_files.py");
    std::filesystem::copy_file(HLM_PLANT_FILES, script);
    user_.emplace(Arguments{"setpriv", "--reuid", kNobody, "--regid", kNobody, "--clear-groups",
                            "/usr/bin/python3", script, planted(), victim(),
                            std::to_string(server_->id()), own(),
                            own() + "/" + victim() + ".json"});
    REQUIRE(wait_until(20, [&] { return user_->output().find("planted") != std::string::npos; }));
    std::vector<std::string> addresses;
    std::istringstream lines(user_->output());
    for (std::string line; lines >> line && line != "planted";) addresses.push_back(line);
    return addresses;
  }

  /// Root's doctor, for whom /run is this machine's.
  Finished doctor(const Arguments& options) const {
    const std::string in_run = "mount --bind " + directory_.file("run") + " /run && exec \"$@\"";
    return run(Arguments{"env", "XDG_RUNTIME_DIR=/run/user/0", "unshare", "-m", "sh", "-c", in_run,
                         "sh", HLM_DOCTOR} +
                   options,
               kHangs);
  }
  bool can_mount() const { return doctor({"--all"}).exit_code == 0; }

  bool is_stopped() const {
    const Finished force = doctor({"--server", victim(), "--check", "force"});
    return force.output.find("operator_stop") != std::string::npos;
  }

 private:
  static constexpr double kHangs = 20;  // s: a doctor that waits for longer waits for ever.

  std::string own() const { return directory_.file("run/user/0/haptic_server"); }
  std::string planted() const { return directory_.file("run/user/65534/haptic_server"); }

  TemporaryDirectory directory_;
  int port_ = free_port();
  std::optional<Process> server_;
  std::optional<Process> user_;
};

TEST_CASE("Root's doctor believes no file that another user has planted, and hangs on none") {
  if (geteuid() != 0) {
    WARN("SKIPPED: only root can be another user");
    return;
  }
  SharedMachine machine;
  if (!machine.can_mount()) {
    WARN("SKIPPED: this machine lets nobody have a /run of its own");
    return;
  }
  machine.server().send_signal(SIGUSR2);
  REQUIRE(wait_until(10, [&] { return machine.is_stopped(); }));
  const std::vector<std::string> planted = machine.plant();
  CHECK(planted.size() > 20);

  const Finished list = machine.doctor({"--all", "--json"});
  INFO(list.output << list.error);
  REQUIRE(list.exit_code == 0);
  std::size_t root_has = 0;
  const json report = json::parse(list.output);
  for (const json& server : report.at("servers")) {
    const bool is_victim = server.at("listen") == machine.victim();
    root_has += is_victim ? 1 : 0;
    // A user may have a server of its own; that is said of its own process alone.
    CHECK((server.at("process") == machine.server().id()) == is_victim);
  }
  CHECK(root_has == 1);
  CHECK(list.output.find('\x1b') == std::string::npos);

  for (const std::string& address : planted) {
    INFO(address);
    const Finished clear = machine.doctor({"clear", "--server", address});
    INFO(clear.output << clear.error);
    CHECK((clear.exit_code == 1 || clear.exit_code == 2));
    const int force = machine.doctor({"--server", address, "--check", "force"}).exit_code;
    CHECK((force >= 0 && force < 128));
  }
  CHECK(machine.is_stopped());
  const Finished meant = machine.doctor({"clear", "--server", machine.victim()});
  INFO(meant.output << meant.error);
  CHECK(meant.exit_code == 0);
  CHECK_THAT(meant.output, ContainsSubstring("has the fault operator_stop: it ends with the next"));
}

TEST_CASE("A user's server takes no command of another user but root") {
  if (geteuid() != 0) {
    WARN("SKIPPED: only root can be another user");
    return;
  }
  SharedMachine machine;
  const auto say = [&](const Arguments& as) {
    const std::string socket = machine.socket();
    return run(as +
               Arguments{"/usr/bin/python3", "-c",
                         "import socket; s = socket.socket(socket.AF_UNIX); s.connect('" + socket +
                             "'); s.settimeout(10)\n"
                             "try: s.send(b'clear\\n'); print(s.recv(9))\n"
                             "except OSError as error: print(error)"})
        .output;
  };
  CHECK_THAT(say({}), ContainsSubstring("done"));
  CHECK_THAT(say({"setpriv", "--reuid", kNobody, "--regid", kNobody, "--clear-groups"}),
             !ContainsSubstring("done"));
}

}  // namespace
}  // namespace hlm::test
