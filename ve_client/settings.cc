#include "ve_client/settings.h"

#include <iostream>
#include <sstream>

#include <CLI/CLI.hpp>

namespace hlm::ve {
namespace {

std::string number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

/// The command line, bound to the settings.
class CommandLine {
 public:
  CommandLine() {
    app_.option_defaults()->always_capture_default();
    app_.set_config("--config", "", "File with any of these options, as printed by --print-config");
    app_.allow_config_extras(CLI::config_extras_mode::error);
    app_.add_flag("--print-config", print_config_, "Print the effective configuration and end")
        ->configurable(false);
    add_connection();
    add_page();
    add_world();
    add_frame();
    add_follow();
  }

  ParsedArguments parse(int argc, const char* const* argv) {
    try {
      app_.parse(argc, argv);
      finish();
    } catch (const CLI::ParseError& error) {
      if (error.get_exit_code() == 0) return {{}, app_.exit(error)};
      std::cerr << "ve_client: " << error.what() << '\n';
      return {{}, error.get_exit_code()};
    }
    if (print_config_) {
      std::cout << app_.config_to_str(true, true);
      return {};
    }
    return {settings_, 0};
  }

 private:
  void add_connection() {
    app_.add_option("--server", settings_.server, "Haptic server, HOST:PORT");
    app_.add_option("--connect-timeout", settings_.connect_timeout,
                    "Give up when the server has not answered for this long at the start, s; "
                    "0 waits for ever")
        ->check(CLI::Range(0.0, 1e6));
    app_.add_option("--record", settings_.record,
                    "Write all datagrams to this capture file (pcap)");
    app_.add_option("--duration", settings_.duration, "End after this long, s; 0: until stopped")
        ->check(CLI::Range(0.0, 1e9));
    app_.add_option("--log-level", settings_.log_level, "trace, debug, info, warn, error or off")
        ->check(CLI::IsMember({"trace", "debug", "info", "warn", "error", "off"}));
    app_.add_flag("--quiet", quiet_, "Log warnings and errors only");
  }

  void add_page() {
    app_.add_option("--page", settings_.page,
                    "Serve the live page at this ADDRESS:PORT, for example 127.0.0.1:8080. Other "
                    "addresses than "
                    "loopback let the network move the device");
    app_.add_option("--page-root", settings_.page_root, "Folder of the page's files");
    app_.add_option("--network-delay", settings_.network.delay,
                    "Hold every datagram this long, in both directions, s")
        ->check(CLI::Range(0.0, kLongestDelay));
    app_.add_option("--network-jitter", settings_.network.jitter,
                    "Hold each up to this much longer, s")
        ->check(CLI::Range(0.0, kLongestJitter));
    app_.add_option("--network-loss", settings_.network.loss, "Portion of datagrams that are lost")
        ->check(CLI::Range(0.0, kLargestLoss));
  }

  void add_world() {
    app_.add_option("--world", settings_.world, "World, an SDFormat file (required)");
    app_.add_option("--tool", settings_.tool, "Model of the world that is the virtual tool");
    app_.add_option(
        "--start", settings_.start,
        "Where the tool begins: the name of one of its <haptic:start>; otherwise as the "
        "file places it");
    app_.add_option("--epsilon", settings_.frame.epsilon,
                    "Report contacts up to this separation, m; 0: touching ones only")
        ->check(CLI::Range(0.0, 0.1));
    app_.add_option("--largest-epsilon", settings_.frame.largest_epsilon,
                    "Above --epsilon: that separation grows with the tool's speed and the delay, "
                    "up to this, m")
        ->check(CLI::Range(0.0, 0.1));
  }

  void add_frame() {
    app_.add_option("--rate", rate_, "Frames per second, Hz")->check(CLI::Range(1.0, 1000.0));
    app_.add_option(
            "--rate-range", rate_range_,
            "LOW HIGH: instead of --rate, draw the rate of each frame uniformly between these, "
            "Hz")
        ->expected(2)
        ->default_str("")
        ->run_callback_for_default(false)
        ->check(CLI::Range(1.0, 1000.0));
    app_.add_option("--seed", settings_.seed, "Seed of the drawn rates");
    app_.add_option("--delay", settings_.frame.delay,
                    "Hold each update this long before sending, as a slow engine would, s; at most "
                    "the shortest frame")
        ->check(CLI::Range(0.0, 1.0));
  }

  void add_follow() {
    app_.add_option("--follow", follow_,
                    "implicit: springs draw the tool to the proxy, walls stop it; kinematic: it is "
                    "carried there through everything")
        ->check(CLI::IsMember({"implicit", "kinematic"}));
    app_.add_option("--follow-frequency", settings_.follow.frequency,
                    "Natural frequency of those springs, Hz")
        ->check(CLI::Range(1.0, 1000.0));
    app_.add_option("--follow-damping", settings_.follow.damping_ratio,
                    "Damping ratio of those springs; 1 is critical")
        ->check(CLI::Range(0.0, 10.0));
    app_.add_option("--follow-force", settings_.follow.max_force,
                    "Largest force of those springs on a link, N")
        ->check(CLI::Range(0.1, 1e6));
  }

  /// Settings that several options make together, and checks across options.
  void finish() {
    settings_.rate_low = settings_.rate_high = rate_;
    if (!rate_range_.empty()) {
      settings_.rate_low = rate_range_[0];
      settings_.rate_high = rate_range_[1];
    }
    settings_.follow.mode = follow_ == "kinematic" ? FollowMode::kKinematic : FollowMode::kImplicit;
    if (quiet_) settings_.log_level = "warn";

    if (settings_.rate_low > settings_.rate_high) {
      throw CLI::ValidationError("--rate-range", "LOW must not be above HIGH");
    }
    if (settings_.frame.delay * settings_.rate_high > 1) {
      throw CLI::ValidationError("--delay", number(settings_.frame.delay) +
                                                " s must be at most the shortest frame, " +
                                                number(1 / settings_.rate_high) + " s");
    }
    // Not by CLI11, so that --print-config works without a world.
    if (!print_config_ && settings_.world.empty()) throw CLI::RequiredError("--world");
  }

  CLI::App app_{
      "Virtual environment: simulates a world and tells the haptic server what its tool "
      "touches, or nearly touches."};
  Settings settings_;
  double rate_ = 60;
  std::vector<double> rate_range_;
  std::string follow_ = "implicit";
  bool quiet_ = false;
  bool print_config_ = false;
};

}  // namespace

ParsedArguments parse_arguments(int argc, const char* const* argv) {
  return CommandLine().parse(argc, argv);
}

}  // namespace hlm::ve
