// The client's options: values, ranges, configuration file, and one line for each mistake.
#include "hlm/ve_client/run/settings.h"

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>
#include <vector>

#include "tests/support/catch.h"

namespace hlm::ve {
namespace {

using Catch::Matchers::ContainsSubstring;

struct Parsed {
  ParsedArguments arguments;
  std::string out;
  std::string err;
};

Parsed parse(std::vector<const char*> options) {
  options.insert(options.begin(), "ve_client");
  std::ostringstream out;
  std::ostringstream err;
  std::streambuf* const original_out = std::cout.rdbuf(out.rdbuf());
  std::streambuf* const original_err = std::cerr.rdbuf(err.rdbuf());
  const ParsedArguments arguments =
      parse_arguments(static_cast<int>(options.size()), options.data());
  std::cout.rdbuf(original_out);
  std::cerr.rdbuf(original_err);
  return {arguments, out.str(), err.str()};
}

/// Fails with one line on stderr, which is returned.
std::string error_of(std::vector<const char*> options) {
  options.insert(options.begin(), {"--world", "w.sdf"});
  const Parsed parsed = parse(options);
  CHECK_FALSE(parsed.arguments.settings);
  CHECK(parsed.arguments.exit_code == 2);
  CHECK(std::ranges::count(parsed.err, '\n') == 1);
  return parsed.err;
}

TEST_CASE("Options without a value have their defaults") {
  const auto settings = parse({"--world", "w.sdf"}).arguments.settings;
  REQUIRE(settings);
  CHECK(settings->tools.front().server == "127.0.0.1:47800");
  CHECK(settings->tools.front().tool.empty());
  CHECK(settings->frame.epsilon == 0.005);
  CHECK(settings->rate_low == 60);
  CHECK(settings->rate_high == 60);
  CHECK(settings->connect_timeout == 0);  // For ever: either side starts first.
}

TEST_CASE("A second server has a tool, a start and a recording of its own") {
  const auto settings =
      parse({"--world", "w.sdf", "--second-server", "there:47801", "--second-tool", "peg",
             "--second-start", "hole", "--second-record", "peg.pcap", "--record", "tray.pcap"})
          .arguments.settings;
  REQUIRE(settings);
  REQUIRE(settings->tools.size() == 2);
  CHECK(settings->tools[0].server == "127.0.0.1:47800");
  CHECK(settings->tools[0].record == "tray.pcap");
  CHECK(settings->tools[1].server == "there:47801");
  CHECK(settings->tools[1].tool == "peg");
  CHECK(settings->tools[1].start == "hole");
  CHECK(settings->tools[1].record == "peg.pcap");
  CHECK_THAT(error_of({"--second-tool", "peg"}),
             ContainsSubstring("--second-tool peg needs --second-server"));
}

TEST_CASE("A check is asked for with one flag") {
  CHECK_FALSE(parse({"--world", "w.sdf"}).arguments.settings->check);
  CHECK(parse({"--world", "w.sdf", "--check"}).arguments.settings->check);
}

TEST_CASE("Options set what they name") {
  const auto settings = parse({"--world", "w.sdf", "--rate-range", "30", "60", "--epsilon", "0",
                               "--follow", "kinematic", "--delay", "0.01", "--quiet"})
                            .arguments.settings;
  REQUIRE(settings);
  CHECK(settings->rate_low == 30);
  CHECK(settings->rate_high == 60);
  CHECK(settings->frame.epsilon == 0);
  CHECK(settings->frame.delay == 0.01);
  CHECK(settings->follow.mode == FollowMode::kKinematic);
  CHECK(settings->log_level == "warn");
}

TEST_CASE("A mistake is one line that names the option, its value and what is allowed") {
  CHECK_THAT(error_of({"--epsilon", "-1"}),
             ContainsSubstring("--epsilon") && ContainsSubstring("-1") && ContainsSubstring("0.2"));
  CHECK_THAT(error_of({"--epsilon", "wide"}), ContainsSubstring("wide"));
  CHECK_THAT(error_of({"--rate", "0"}), ContainsSubstring("--rate") && ContainsSubstring("1000"));
  CHECK_THAT(error_of({"--rate-range", "60", "30"}), ContainsSubstring("--rate-range"));
  CHECK_THAT(error_of({"--rate", "50", "--delay", "0.021"}),
             ContainsSubstring("--delay 0.021 s must be 0 to 0.02 s, the shortest frame"));
  CHECK_THAT(error_of({"--follow", "magic"}),
             ContainsSubstring("--follow magic must be one of implicit, kinematic"));
  CHECK_THAT(error_of({"--colour", "red"}), ContainsSubstring("--colour"));
  CHECK_THAT(error_of({"--epsilom", "0.005"}), ContainsSubstring("did you mean '--epsilon'?"));
  CHECK_THAT(error_of({"--config", "/nonexistent.toml"}), ContainsSubstring("/nonexistent.toml"));
  const Parsed no_world = parse({});
  CHECK(no_world.arguments.exit_code == 2);
  CHECK_THAT(no_world.err, ContainsSubstring("--world"));
}

TEST_CASE("What --print-config prints is a configuration file with the same effect") {
  const Parsed printed = parse({"--world", "w.sdf", "--rate-range", "25", "50", "--epsilon",
                                "0.003", "--follow", "kinematic", "--print-config"});
  CHECK_FALSE(printed.arguments.settings);
  CHECK(printed.arguments.exit_code == 0);

  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / "hlm_settings_test.toml";
  std::ofstream(file) << printed.out;
  const Parsed read = parse({"--config", file.c_str()});
  std::filesystem::remove(file);
  INFO(read.err);
  REQUIRE(read.arguments.settings);
  CHECK(read.arguments.settings->world == "w.sdf");
  CHECK(read.arguments.settings->rate_low == 25);
  CHECK(read.arguments.settings->rate_high == 50);
  CHECK(read.arguments.settings->frame.epsilon == 0.003);
  CHECK(read.arguments.settings->follow.mode == FollowMode::kKinematic);
}

TEST_CASE("Help names the units") {
  const Parsed help = parse({"--help-all"});
  CHECK(help.arguments.exit_code == 0);
  CHECK_THAT(help.out, ContainsSubstring("--delay s") && ContainsSubstring("0 to 1 s") &&
                           ContainsSubstring("1 to 1000 Hz") && ContainsSubstring("0 to 0.2 m") &&
                           ContainsSubstring("3 the server never"));
}

TEST_CASE("Help shows what most people need, and says where the rest is") {
  const Parsed help = parse({"--help"});
  CHECK_THAT(help.out, ContainsSubstring("--world FILE") && ContainsSubstring("--help-all") &&
                           !ContainsSubstring("--follow-damping"));
}

}  // namespace
}  // namespace hlm::ve
