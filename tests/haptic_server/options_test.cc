// The server's options, its choice of a device, and what a replay must share with a recording.
#include "hlm/haptic_server/options.h"

#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>

#include <unistd.h>

#include "hlm/haptic_server/program.h"
#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;

constexpr double kDt = 1e-3;  // s.

/// A file that goes with its owner.
class File {
 public:
  explicit File(const std::string& text) { std::ofstream(path_) << text; }
  ~File() { std::filesystem::remove(path_); }
  std::string path() const { return path_; }

 private:
  static inline int count_ = 0;
  std::string path_ =
      std::filesystem::temp_directory_path() /
      ("hlm_options_" + std::to_string(::getpid()) + '_' + std::to_string(count_++));
};

/// The server's command line with these arguments.
class Parsed {
 public:
  explicit Parsed(const std::vector<std::string>& arguments) {
    settings::CommandLine command_line({"haptic_server", "Serves.", ""});
    add_options(command_line, options);
    std::vector<const char*> all{"haptic_server"};
    for (const std::string& argument : arguments) all.push_back(argument.c_str());
    std::ostringstream new_out;
    std::ostringstream new_err;
    std::streambuf* const old_out = std::cout.rdbuf(new_out.rdbuf());
    std::streambuf* const old_err = std::cerr.rdbuf(new_err.rdbuf());
    code = command_line.parse(static_cast<int>(all.size()), all.data(), [this] { check(options); });
    std::cout.rdbuf(old_out);
    std::cerr.rdbuf(old_err);
    out = new_out.str();
    err = new_err.str();
  }

  std::unique_ptr<Device> device() const { return options.physics.device.open(kDt); }
  std::uint64_t fingerprint() const { return server::fingerprint(options.physics, *device()); }

  ServerOptions options;
  std::optional<int> code;
  std::string out;
  std::string err;
};

std::string error_of(const std::vector<std::string>& arguments) {
  const Parsed parsed(arguments);
  CHECK(parsed.code == settings::kUsageError);
  return parsed.err;
}

TEST_CASE("An address that cannot be used is named with its option and an example") {
  CHECK_THROWS_WITH(
      resolve_option("--listen", "nowhere"),
      ContainsSubstring("--listen nowhere: ") && ContainsSubstring("for example 127.0.0.1:47800"));
  CHECK_THROWS_AS(resolve_option("--listen", "127.0.0.1:99999"), settings::UsageError);
}

TEST_CASE("Without options the simulated device is there, as it is") {
  const Parsed parsed({});
  REQUIRE_FALSE(parsed.code);
  const auto device = parsed.device();
  CHECK(device->name() == "simulated planar device");
  CHECK(device->ratings().max_force == 12);
  CHECK(device->guided_hand() != nullptr);
}

TEST_CASE("Keys of the device come from the file's [device] table and from the command line") {
  const File file("stiffness = 3000\n[device]\nfreedom = \"spatial\"\nmass = 0.5\nmax-force = 7\n");
  const Parsed parsed(
      {"--config", file.path(), "--device-option", "mass=0.25", "--device-option", "friction=0"});
  INFO(parsed.err);
  REQUIRE_FALSE(parsed.code);
  const auto device = parsed.device();
  CHECK(device->name() == "simulated spatial device");
  CHECK(device->ratings().mass == 0.25);
  CHECK(device->ratings().max_force == 7);
  CHECK(parsed.options.physics.servo.local_model.stiffness == 3000);
}

TEST_CASE("A key that the device does not have brings the nearest one, with file and line") {
  const File file("[device]\nmas = 0.5\n");
  CHECK(error_of({"--config", file.path()}) ==
        "haptic_server: " + file.path() +
            ":2: mas: device simulated has no such key; did you mean 'mass'?\n");
  CHECK_THAT(error_of({"--device-option", "delai=3"}), ContainsSubstring("did you mean 'delay'?"));
  CHECK_THAT(error_of({"--device-option", "mass=0.01"}),
             ContainsSubstring("--device-option mass 0.01 kg must be 0.05 to 1000 kg"));
  CHECK_THAT(error_of({"--device-option", "delay=65"}),
             ContainsSubstring("delay 65 ticks must be 0 to 64 ticks"));
  CHECK_THAT(error_of({"--device", "omega"}),
             ContainsSubstring("--device omega must be one of simulated, forcedimension, "
                               "haply, haply2diy, openhaptics, list"));
  const File other("[device]\ndriver = \"omega\"\n");
  CHECK_THAT(error_of({"--config", other.path()}), ContainsSubstring(":2: driver omega must be"));
}

TEST_CASE("A hand belongs to the simulated device alone") {
  const Parsed lost({"--hand", "/nowhere.toml"});
  REQUIRE_FALSE(lost.code);
  CHECK_THROWS_AS(lost.device(), settings::UsageError);
  CHECK_THAT(error_of({"--device", "haply", "--hand", "/nowhere.toml"}),
             ContainsSubstring("--hand: device haply has no such key"));
}

TEST_CASE("Every device has the keys of its workspace") {
  const File file("[device]\nframe = \"y z x\"\nscale = 2\nown-force-limit = 3\n");
  const Parsed parsed({"--config", file.path()});
  INFO(parsed.err);
  REQUIRE_FALSE(parsed.code);
  const auto device = parsed.device();
  CHECK(device->ratings().scale == 2);
  CHECK(device->ratings().max_force == 3);
  CHECK(device->ratings().freedoms == 0b001110);  // The device's plane is the world's y-z.
  CHECK(parsed.fingerprint() != Parsed({}).fingerprint());

  CHECK_THAT(error_of({"--device-option", "frame=x y -z"}),
             ContainsSubstring("frame 'x y -z' must be right-handed"));
  CHECK_THAT(error_of({"--device-option", "fram=x y z"}), ContainsSubstring("mean 'frame'?"));
  const Parsed clutched({"--device-option", "clutch=1"});
  CHECK_THROWS_WITH(clutched.device(),
                    "clutch 1 must be one of the 0 buttons of simulated planar device");
  CHECK_THAT(
      *Parsed({"--device", "openhaptics", "--device-help"}).options.physics.device.information(),
      ContainsSubstring("scheduler-rate Hz") && ContainsSubstring("rotation-scale NUMBER"));
}

TEST_CASE(
    "The option --device list names each driver and what is connected, --device-help its keys") {
  const Parsed list({"--device", "list"});
  REQUIRE_FALSE(list.code);
  CHECK_THAT(*list.options.physics.device.information(),
             ContainsSubstring("simulated") && ContainsSubstring("always there") &&
                 ContainsSubstring("haply2diy") && ContainsSubstring("none connected"));
  const Parsed help({"--device", "haply", "--device-help"});
  REQUIRE_FALSE(help.code);
  CHECK_THAT(*help.options.physics.device.information(),
             ContainsSubstring("address HOST:PORT") && !ContainsSubstring("freedom"));
  CHECK_THAT(*Parsed({"--device-help"}).options.physics.device.information(),
             ContainsSubstring("mass kg") && ContainsSubstring("0.05 to 1000 kg (default 1)"));
  CHECK_THAT(Parsed({"--help-all"}).out, !ContainsSubstring("friction-torque"));
}

TEST_CASE("The printed configuration gives the same server, bit for bit") {
  const File hand("[[segment]]\nduration = 1.0\nwrench = { force = [1, 0, 0] }\n");
  const std::vector<std::string> arguments{
      "--stiffness",     "1234.5678901234567", "--torque-limit",  "0.30000000000000004",
      "--hand",          hand.path(),          "--device-option", "mass=0.1",
      "--device-option", "measures-hand=false"};
  std::vector<std::string> printing = arguments;
  printing.push_back("--print-config");
  const Parsed printed(printing);
  REQUIRE(printed.code == 0);
  CHECK_THAT(printed.out, ContainsSubstring("torque-limit = 0.30000000000000004\n"));
  const File file(printed.out);
  const Parsed again({"--config", file.path()});
  INFO(again.err);
  REQUIRE_FALSE(again.code);
  CHECK(again.fingerprint() == Parsed(arguments).fingerprint());
  CHECK(again.options.physics.servo.local_model.stiffness == 1234.5678901234567);
}

TEST_CASE("The process to end with is no matter of configuration files") {
  const Parsed printed({"--parent", "5", "--print-config"});
  REQUIRE(printed.code == 0);
  CHECK_THAT(printed.out, !ContainsSubstring("parent"));
  const File file("parent = 5\n");
  CHECK_THAT(Parsed({"--config", file.path()}).err, ContainsSubstring("parent"));
}

TEST_CASE("The fingerprint changes with whatever moves the proxy otherwise") {
  const File hand("[[segment]]\nduration = 1.0\nwrench = { force = [1, 0, 0] }\n");
  const File same("[[segment]]\nduration = 1.0\nwrench = { force = [1, 0, 0] }\n");
  const std::uint64_t usual = Parsed({}).fingerprint();
  const std::vector<std::vector<std::string>> changes{{"--stiffness", "4001"},
                                                      {"--rate", "999"},
                                                      {"--controller", "direct"},
                                                      {"--force-limit", "11"},
                                                      {"--healing-speed", "0"},
                                                      {"--silence-time", "0.26"},
                                                      {"--device-option", "mass=2"},
                                                      {"--device-option", "friction=0"},
                                                      {"--device-option", "delay=1"},
                                                      {"--device-option", "freedom=spatial"},
                                                      {"--device-option", "measures-hand=false"},
                                                      {"--hand", hand.path()}};
  for (const auto& change : changes) {
    INFO(change[0] << ' ' << change[1]);
    CHECK(Parsed(change).fingerprint() != usual);
  }
  CHECK(Parsed({"--hand", hand.path()}).fingerprint() ==
        Parsed({"--hand", same.path()}).fingerprint());
  CHECK(Parsed({"--log-level", "off", "--duration", "1"}).fingerprint() == usual);
}

TEST_CASE("A limit above the device's rating is doubtful, and says which is in effect") {
  const Parsed parsed({"--force-limit", "50", "--torque-limit", "2"});
  REQUIRE_FALSE(parsed.code);
  std::string doubts;
  for (const auto& doubt : doubts_about(parsed.options.physics, *parsed.device())) doubts += doubt;
  CHECK_THAT(doubts, ContainsSubstring("--force-limit 50 N is above the device's rated 12 N: 12 N "
                                       "is in effect") &&
                         ContainsSubstring("rated 0.6 N·m"));
  CHECK(error_of({"--force-limit", "1e9"}) ==
        "haptic_server: --force-limit 1e+09 N must be 0.01 to 1000 N\n");
  const Parsed usual({"--controller", "three_channel", "--stiffness", "100"});
  for (const auto& doubt : doubts_about(usual.options.physics, *usual.device())) {
    CHECK_THAT(doubt, !ContainsSubstring("in effect"));
  }
}

TEST_CASE("Options that do not go together are refused") {
  CHECK_THAT(error_of({"--static-friction", "0.1"}),
             ContainsSubstring("static friction 0.1 (--static-friction) must be at least kinetic"));
  CHECK_THAT(error_of({"--rate", "8000", "--final-spin", "0.0001"}),
             ContainsSubstring("final spin 0.0001 s must be 0 to"));
}

TEST_CASE("Where nobody attends a server, it takes the simulated device alone") {
  CHECK_FALSE(Parsed({"--unattended"}).code);
  CHECK_FALSE(Parsed({"--device", "haply"}).code);
  const Parsed real({"--unattended", "--device", "haply"});
  CHECK(real.code == settings::kUsageError);
  CHECK_THAT(real.err, ContainsSubstring("--device haply does not go with --unattended"));
  const File file("[device]\ndriver = \"haply\"\n");
  CHECK(Parsed({"--unattended", "--config", file.path()}).code == settings::kUsageError);
}

TEST_CASE("An instance has a number from 0 to 99") {
  CHECK(Parsed({"--instance", "99"}).options.instance == 99);
  for (const char* wrong : {"100", "-1", "hole"}) {
    const Parsed parsed({"--instance", wrong});
    CHECK(parsed.code == settings::kUsageError);
    CHECK_THAT(parsed.err, ContainsSubstring(std::string("--instance ") + wrong));
  }
}

}  // namespace
}  // namespace hlm::server
