// What both programs' command lines and configuration files do with every kind of setting.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>

#include <unistd.h>

#include "hlm/common/settings/command_line.h"
#include "hlm/common/settings/nearest.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::settings {
namespace {

using Catch::Matchers::ContainsSubstring;

/// A section with one key.
class Engine final : public Section {
 public:
  Engine() { table_.number("power", power, {0, 100, "W"}, "Power of the engine"); }

  void set(const std::vector<Assignment>& assignments) override {
    for (const Assignment& each : assignments) {
      const Setting* const setting = table_.find(each.key);
      if (setting == nullptr) throw UsageError(each.name + " is unknown");
      settings::set(*setting, each);
    }
  }
  std::string to_toml(bool described) const override { return table_.to_toml(described); }

  double power = 10;

 private:
  Table table_;
};

/// A program with a setting of each kind.
class Mill {
 public:
  Mill() {
    Table& table = command_line_.table();
    table.group("Grain");
    table.number("grain-size", size, {1e-4, 0.01, "m"}, "Size of the grain");
    table.whole("stones", stones, {1, 4, "stones"}, "How many stones turn");
    table.group("Rest");
    table.choice("update-rule", rule, "How grain is replaced");
    table.text("miller", miller, "NAME", "Who mills");
    table.interval("speeds", speeds, {0, 10, "rad/s"}, "Speeds of the stone");
    table.yes_no("wind", wind, "Whether there is wind");
    table.flag("quiet", quiet, "Say nothing");
    table.group("Engine");
    table.yes_no("engine-on", engine_on, "Whether the engine runs");
    command_line_.section({"engine", "Engine", &engine, "engine-option", "Sets a key", {}});
  }

  std::optional<int> parse(std::vector<const char*> arguments) {
    arguments.insert(arguments.begin(), "mill");
    std::ostringstream new_out;
    std::ostringstream new_err;
    std::streambuf* const old_out = std::cout.rdbuf(new_out.rdbuf());
    std::streambuf* const old_err = std::cerr.rdbuf(new_err.rdbuf());
    const auto code = command_line_.parse(static_cast<int>(arguments.size()), arguments.data());
    std::cout.rdbuf(old_out);
    std::cerr.rdbuf(old_err);
    out = new_out.str();
    err = new_err.str();
    return code;
  }

  double size = 0.001;
  int stones = 2;
  UpdateRule rule = UpdateRule::kRetain;
  std::string miller = "Anna";
  std::vector<double> speeds;
  bool wind = true;
  bool quiet = false;
  bool engine_on = false;
  Engine engine;
  std::string out;
  std::string err;

 private:
  CommandLine command_line_{{"mill", "Mills grain.", "Exit codes: 0 finished.\n"}};
};

/// A configuration file that goes with its owner.
class File {
 public:
  explicit File(const std::string& text) { std::ofstream(path_) << text; }
  ~File() { std::filesystem::remove(path_); }
  const char* path() const { return path_.c_str(); }

 private:
  static inline int count_ = 0;
  std::string path_ = std::filesystem::temp_directory_path() /
                      ("hlm_mill_" + std::to_string(::getpid()) + '_' + std::to_string(count_++));
};

/// The one line on standard error of a program that ends with kUsageError.
std::string error_of(const std::vector<const char*>& arguments) {
  Mill mill;
  CHECK(mill.parse(arguments) == kUsageError);
  CHECK(mill.out.empty());
  CHECK(std::ranges::count(mill.err, '\n') == 1);
  CHECK(mill.err.starts_with("mill: "));
  return mill.err;
}

std::string error_in_file(const std::string& text) {
  const File file(text);
  const std::string error = error_of({"--config", file.path()});
  CHECK_THAT(error, ContainsSubstring(file.path()));
  return error;
}

TEST_CASE("Options set what they name, the last one of its kind wins") {
  Mill mill;
  REQUIRE_FALSE(mill.parse({"--grain-size", "0.002", "--stones=3", "--update-rule", "paper",
                            "--miller", "Ben", "--speeds", "1", "2.5", "--wind", "false", "--quiet",
                            "--stones", "4", "--engine-option", "power=99"}));
  CHECK(mill.size == 0.002);
  CHECK(mill.stones == 4);
  CHECK(mill.rule == UpdateRule::kPaper);
  CHECK(mill.miller == "Ben");
  CHECK(mill.speeds == std::vector<double>{1, 2.5});
  CHECK_FALSE(mill.wind);
  CHECK(mill.quiet);
  CHECK(mill.engine.power == 99);
}

TEST_CASE("What follows an option's value is not its own") {
  CHECK_THAT(error_of({"--stones", "3", "flour"}), ContainsSubstring("argument 'flour'"));
  CHECK_THAT(error_of({"--miller", "Ben", "flour"}), ContainsSubstring("argument 'flour'"));
}

TEST_CASE("The command line goes before the file") {
  const File file("stones = 3\nminutes = 1\n");
  Mill mill;
  CHECK(mill.parse({"--config", file.path()}) == kUsageError);
  const File good("stones = 3\ngrain-size = 0.002\n[engine]\npower = 5\n");
  REQUIRE_FALSE(mill.parse({"--stones", "1", "--config", good.path()}));
  CHECK(mill.stones == 1);
  CHECK(mill.size == 0.002);
  CHECK(mill.engine.power == 5);
}

TEST_CASE("A configuration is read from a pipe as from a file") {
  int ends[2];
  REQUIRE(::pipe(ends) == 0);
  const std::string text = "stones = 3\n[engine]\npower = 5\n";
  REQUIRE(::write(ends[1], text.data(), text.size()) == static_cast<ssize_t>(text.size()));
  ::close(ends[1]);
  Mill mill;
  CHECK_FALSE(mill.parse({"--config", ("/dev/fd/" + std::to_string(ends[0])).c_str()}));
  ::close(ends[0]);
  CHECK(mill.stones == 3);
  CHECK(mill.engine.power == 5);
}

TEST_CASE("A value out of range is named with its option and what is allowed") {
  CHECK(error_of({"--grain-size", "1"}) == "mill: --grain-size 1 m must be 0.0001 to 0.01 m\n");
  CHECK(error_of({"--grain-size", "-1"}) == "mill: --grain-size -1 m must be 0.0001 to 0.01 m\n");
  CHECK(error_of({"--grain-size", "small"}) ==
        "mill: --grain-size small must be a number, 0.0001 to 0.01 m\n");
  CHECK_THAT(error_of({"--grain-size", "nan"}), ContainsSubstring("nan m must be"));
  CHECK(error_of({"--stones", "2.5"}) ==
        "mill: --stones 2.5 must be a whole number, 1 to 4 stones\n");
  CHECK_THAT(error_of({"--stones", "5"}), ContainsSubstring("--stones 5 stones must be 1 to 4"));
  std::string rules;
  for (const Word<UpdateRule>& word : kWords<UpdateRule>) {
    rules += (rules.empty() ? "" : ", ") + std::string(word.name);
  }
  CHECK(error_of({"--update-rule", "magic"}) ==
        "mill: --update-rule magic must be one of " + rules + "\n");
  CHECK_THAT(error_of({"--speeds", "3", "2"}), ContainsSubstring("LOW not above HIGH"));
  CHECK(error_of({"--speeds", "3"}) == "mill: --speeds needs 2 values, not 1\n");
  CHECK_THAT(error_of({"--wind", "maybe"}), ContainsSubstring("maybe must be true or false"));
  CHECK(error_of({"--stones"}) == "mill: --stones needs a value (COUNT)\n");
  CHECK(error_of({"--print-config=maybe"}) ==
        "mill: --print-config takes no value: it is on where it stands\n");
  CHECK_THAT(error_of({"--engine-option", "power"}), ContainsSubstring("must be KEY=VALUE"));
  CHECK(error_of({"--engine-option", "power=200"}) ==
        "mill: --engine-option power 200 W must be 0 to 100 W\n");
}

TEST_CASE("Zero has no sign: what is divided by it would be infinitely wrong") {
  Mill mill;
  REQUIRE_FALSE(mill.parse({"--engine-option", "power=-0.0"}).has_value());
  CHECK_FALSE(std::signbit(mill.engine.power));
}

TEST_CASE("An unknown option brings the nearest known one") {
  CHECK(error_of({"--grain-siez", "1"}) ==
        "mill: unknown option --grain-siez; did you mean '--grain-size'?\n");
  CHECK_THAT(error_of({"--quite"}), ContainsSubstring("did you mean '--quiet'?"));
  CHECK_THAT(error_of({"--verison"}), ContainsSubstring("did you mean '--version'?"));
  CHECK(error_of({"--zzzzzzzz"}) == "mill: unknown option --zzzzzzzz; see --help\n");
  CHECK_THAT(error_of({"flour"}), ContainsSubstring("unexpected argument 'flour'"));
}

TEST_CASE("A mistake in a file is named with file and line") {
  CHECK_THAT(error_in_file("stones = 2\ngrain-siz = 1\n"),
             ContainsSubstring(":2: unknown key 'grain-siz'; did you mean 'grain-size'?"));
  CHECK_THAT(error_in_file("# one\n\nstones = 9\n"),
             ContainsSubstring(":3: stones 9 stones must be 1 to 4 stones"));
  CHECK_THAT(error_in_file("stones = \n"), ContainsSubstring(":1: "));
  CHECK_THAT(error_in_file("stones = 1\nstones = 2\n"), ContainsSubstring(":2: "));
  CHECK_THAT(error_in_file("stones = [1, 2]\n"),
             ContainsSubstring(":1: stones needs one value, not 2"));
  CHECK_THAT(error_in_file("speeds = [1, 2, 3]\n"),
             ContainsSubstring("speeds needs 2 values, not 3"));
  CHECK_THAT(error_in_file("miller = 2020-01-01\n"), ContainsSubstring(":1: miller must be"));
  CHECK_THAT(error_in_file("[engin]\npower = 1\n"),
             ContainsSubstring("unknown table [engin]; there is [engine] only"));
  CHECK_THAT(error_in_file("[engine]\npower = 1000\n"),
             ContainsSubstring(":2: power 1000 W must be 0 to 100 W"));
  CHECK_THAT(error_in_file("[engine.more]\npower = 1\n"), ContainsSubstring("[engine.more]"));
  CHECK_THAT(error_of({"--config", "/nowhere.toml"}), ContainsSubstring("/nowhere.toml"));
  CHECK_THAT(error_of({"--config", "/tmp"}), ContainsSubstring("/tmp: is a folder"));
}

TEST_CASE("The printed configuration gives every number back bit for bit") {
  test::Random random;
  for (int i = 0; i < 20; ++i) {
    const std::string size = shortest_text(random.uniform(1e-4, 1e-2));
    const std::string power = "power=" + shortest_text(random.uniform(0, 100));
    Mill mill;
    REQUIRE(mill.parse({"--grain-size", size.c_str(), "--engine-option", power.c_str(), "--miller",
                        "C:\\\"Dora\" #1", "--speeds", "0.1", "0.3", "--update-rule", "paper",
                        "--print-config"}) == 0);
    const File file(mill.out);
    Mill again;
    INFO(mill.out);
    REQUIRE_FALSE(again.parse({"--config", file.path()}));
    CHECK(again.size == mill.size);
    CHECK(again.engine.power == mill.engine.power);
    CHECK(again.miller == mill.miller);
    CHECK(again.speeds == mill.speeds);
    CHECK(again.rule == UpdateRule::kPaper);
  }
}

TEST_CASE("Defaults print as they were written") {
  Mill mill;
  CHECK(mill.parse({"--print-config"}) == 0);
  CHECK_THAT(mill.out, ContainsSubstring("grain-size = 0.001\n"));
  CHECK_THAT(mill.out, ContainsSubstring("speeds = []\n"));
}

TEST_CASE("Help has groups, units, ranges, defaults and exit codes, the version is a line") {
  Mill mill;
  CHECK(mill.parse({"--help", "--unknown"}) == 0);
  CHECK_THAT(mill.out, ContainsSubstring("Usage: mill [OPTIONS]") &&
                           ContainsSubstring("\nGrain:\n") && ContainsSubstring("\nEngine:\n") &&
                           ContainsSubstring("--grain-size m") &&
                           ContainsSubstring("0.0001 to 0.01 m (default 0.001)") &&
                           ContainsSubstring("Exit codes"));
  Mill other;
  CHECK(other.parse({"--version"}) == 0);
  CHECK_THAT(other.out, Catch::Matchers::StartsWith("mill "));
}

TEST_CASE("Only words that are near are suggested") {
  const std::vector<std::string> known{"stiffness", "damping", "rate"};
  CHECK(suggestion("stifness", known) == "; did you mean 'stiffness'?");
  CHECK(suggestion("rat", known) == "; did you mean 'rate'?");
  CHECK(suggestion("colour", known).empty());
  CHECK(suggestion("", known).empty());
}

}  // namespace
}  // namespace hlm::settings
