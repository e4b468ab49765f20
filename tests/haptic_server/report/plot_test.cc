// Does the plot script draw what the tick log writes, and refuse what it cannot draw?
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include <sys/wait.h>
#include <unistd.h>

#include "hlm/haptic_server/report/tick_csv.h"
#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;

/// A directory of this process' own, removed at the end.
class TemporaryDirectory {
 public:
  TemporaryDirectory()
      : path_(std::filesystem::temp_directory_path() / ("plot_test_" + std::to_string(getpid()))) {
    std::filesystem::create_directory(path_);
  }
  ~TemporaryDirectory() { std::filesystem::remove_all(path_); }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;

  std::string file(const std::string& name) const { return (path_ / name).string(); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(path_ / name) << text;
    return file(name);
  }

 private:
  std::filesystem::path path_;
};

struct Outcome {
  int exit_code = 0;
  std::string output;
};

Outcome plot(const std::string& arguments) {
  const std::string command = HLM_SOURCE_DIR "/scripts/plot.py " + arguments + " 2>&1";
  std::FILE* pipe = popen(command.c_str(), "r");
  REQUIRE(pipe);
  Outcome outcome;
  for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) {
    outcome.output.push_back(static_cast<char>(c));
  }
  outcome.exit_code = WEXITSTATUS(pclose(pipe));
  return outcome;
}

/// A tenth of a second of a session on a wall.
std::string log_text() {
  std::string text = tick_csv_header();
  for (int i = 0; i < 100; ++i) {
    TickRecord record;
    record.session = 1;
    record.time = 1e-3 * i;
    record.server = ServerState::kActive;
    record.active_contacts = i > 50 ? 1 : 0;
    record.X_WD.p.y() = 1e-4 * i;
    append_tick_csv(record, text);
  }
  return text;
}

TEST_CASE("A tick log, a world and a hand script become a picture") {
  const TemporaryDirectory directory;
  const std::string log = directory.write("ticks.csv", log_text());
  const std::string picture = directory.file("session.png");
  // Boxes; a tool of several links, a capsule and cylinders; meshes and an ellipsoid.
  const auto [world, hand] =
      GENERATE(table<std::string, std::string>({{"testbed.sdf", "session.toml"},
                                                {"scissors.sdf", "scissors.toml"},
                                                {"mesh.sdf", "mesh.toml"}}));
  const std::string worlds = HLM_SOURCE_DIR "/worlds/";
  const Outcome outcome = plot(log + " " + picture + " --world " + worlds + world + " --hand " +
                               worlds + "hands/" + hand);
  CHECK(outcome.output.empty());
  CHECK(outcome.exit_code == 0);
  std::string signature(4, '\0');
  std::ifstream(picture, std::ios::binary).read(signature.data(), 4);
  CHECK(signature == "\x89PNG");
}

TEST_CASE("A world that cannot be drawn is refused by name") {
  const TemporaryDirectory directory;
  const std::string world = directory.write("world.sdf", "<sdf version='1.9'></sdf>");
  const Outcome outcome = plot(directory.write("ticks.csv", log_text()) + " " +
                               directory.file("session.png") + " --world " + world);
  CHECK(outcome.exit_code == 1);
  CHECK_THAT(outcome.output, ContainsSubstring("world.sdf: not a world"));
}

TEST_CASE("What is no tick log is refused by name and place") {
  const TemporaryDirectory directory;
  const std::string picture = directory.file("session.png");
  std::string broken = log_text();
  broken.replace(broken.rfind(",0\n"), 3, ",many\n");
  const auto [text, message] = GENERATE_COPY(table<std::string, std::string>(
      {{"", "column 'device_x_m' is missing"},
       {broken, ":101: column 'dropped': 'many' is not a number"}}));
  const Outcome outcome = plot(directory.write("ticks.csv", text) + " " + picture);
  CHECK(outcome.exit_code == 1);
  CHECK_THAT(outcome.output, ContainsSubstring("ticks.csv"));
  CHECK_THAT(outcome.output, ContainsSubstring(message));
  CHECK_FALSE(std::filesystem::exists(picture));
}

}  // namespace
}  // namespace hlm::server
