#include "hlm/ve_client/run/settings.h"

#include <vector>

#include "hlm/common/settings/command_line.h"
#include "hlm/protocol/sealing/key_file.h"

namespace hlm::ve {
namespace {

using settings::Table;
using settings::UsageError;

constexpr Range kFrameRates{1, 1000, "Hz"};

const char* const kFooter =
    R"(Examples:
  ve_client --world worlds/testbed.sdf --server HOST:47800 --key-file haptic.key
                                                                for a server elsewhere
  ve_client --world worlds/testbed.sdf --page 127.0.0.1:8080    with the live page
  ve_client --world worlds/push.sdf --tool brick                with another tool than the world's
  ve_client --world worlds/bimanual.sdf --second-server HOST2:47800
                                                                two hands in one world
  ve_client --world worlds/testbed.sdf --network-delay 0.02     as over a slow network
  ve_client --world robot.urdf --check                          what would be used of a file

Exit codes: 0 finished, or the world can be used; 1 failed while running; 2 wrong usage,
configuration or world; 3 the server never answered.
)";

/// The command line, bound to the settings.
class CommandLine {
 public:
  CommandLine() {
    Table& table = command_line_.table();
    add_connection(table);
    add_environment(table);
    add_frame(table);
    add_tool(table);
    add_network(table);
    add_page(table);
    add_recording(table);
  }

  ParsedArguments parse(int argc, const char* const* argv) {
    const auto code = command_line_.parse(argc, argv, [this] { finish(); });
    if (code) return {{}, *code};
    return {settings_, 0};
  }

 private:
  void add_connection(Table& table) {
    table.group("Connection");
    table.text("server", first_.server, "HOST:PORT", "Haptic server");
    table.text("second-server", second_.server, "HOST:PORT",
               "Another one, where a second tool of the same world is held");
    settings_.key_file = protocol::key_of_service();
    table.file("key-file", settings_.key_file,
               "The server's key, if it has one: made by haptic_keygen, copied here; one for both "
               "servers");
    table.number("connect-timeout", settings_.connect_timeout, {0, 1e6, "s"},
                 "Give up when the server has not answered for this long at the start; 0 waits for "
                 "ever");
    table.number("duration", settings_.duration, {0, 1e9, "s"}, "End after this long; 0 is never");
  }

  void add_environment(Table& table) {
    table.group("Environment");
    table.file("world", settings_.world, "World or model, an SDFormat or URDF file (required)");
    table.text("tool", first_.tool, "MODEL",
               "Model of the world that is the virtual tool; otherwise the world's <haptic:tool>");
    table.text("start", first_.start, "NAME",
               "Where the tool begins, one of its <haptic:start>; otherwise as the file places it");
    table.text("second-tool", second_.tool, "MODEL",
               "Model that is the tool of --second-server; otherwise the world's "
               "<haptic:second_tool>");
    table.text("second-start", second_.start, "NAME", "Where that begins");
    table.flag("check", settings_.check,
               "Say what of the world would be used, approximated, ignored or refused, and end");
  }

  void add_frame(Table& table) {
    table.group("Contacts and frames");
    table.flag(
        "contacts", contacts_,
        "Send the contacts of each frame, as the paper has it and as is always done with two "
        "tools; otherwise the server has the world's shapes and finds their contacts at "
        "every tick, also across long delays");
    table.number("epsilon", settings_.frame.epsilon, kEpsilons,
                 "With --contacts: report them up to this separation; 0 is touching ones only");
    table.number("rate", rate_, kFrameRates, "Frames per second");
    table.interval("rate-range", rate_range_, kFrameRates,
                   "Instead of --rate, draw the rate of each frame uniformly between these");
    table.whole("seed", settings_.seed, {0, 1e9}, "Seed of the drawn rates");
    table.number("delay", settings_.frame.delay, {0, 1, "s"},
                 "Hold each update this long before sending, as a slow engine would, at most the "
                 "shortest frame");
  }

  void add_tool(Table& table) {
    table.group("Virtual tool");
    table.choice("follow", settings_.follow.mode,
                 "How the tool follows the proxy: drawn by springs, walls stop it, or carried "
                 "there through everything");
    table.number("follow-frequency", settings_.follow.frequency, {1, 1000, "Hz"},
                 "Natural frequency of those springs");
    table.number("follow-damping", settings_.follow.damping_ratio, {0, 10},
                 "Damping ratio of those springs, 1 is critical");
    table.number("follow-force", settings_.follow.max_force, {0.1, 1e6, "N"},
                 "Largest force of those springs on a link");
  }

  void add_network(Table& table) {
    table.group("Network, made worse on purpose");
    table.number("network-delay", settings_.network.delay, {0, kLongestDelay, "s"},
                 "Hold every datagram this long, in both directions");
    table.number("network-jitter", settings_.network.jitter, {0, kLongestJitter, "s"},
                 "Hold each up to this much longer");
    table.number("network-loss", settings_.network.loss, {0, kLargestLoss},
                 "Portion of datagrams that are lost");
  }

  void add_page(Table& table) {
    table.group("Live page");
    table.text(
        "page", settings_.page, "ADDRESS:PORT",
        "Serve the live page there, for example at 127.0.0.1:8080; with --key-file, and at "
        "other addresses than loopback, only to those who have the token in the log; else to "
        "the user who starts this, and root");
    table.flag("insecure", settings_.insecure,
               "Serve the page at any address, to anybody: whoever reaches it can move the device. "
               "For closed networks");
    table.whole("page-partner", settings_.page_partner, {0, 65535},
                "Port of this machine whose pages may look on and set here, too, as one that shows "
                "two clients side by side does; 0 is none");
    table.text("page-root", settings_.page_root, "FOLDER", "Folder of the page's files");
    table.text(
        "recordings", settings_.recordings, "DIRECTORY",
        "What haptic_server was given as --recordings, where it runs on this machine: the page "
        "offers the newest");
  }

  void add_recording(Table& table) {
    table.group("Recording");
    table.file("record", first_.record,
               "Write all datagrams of the session with --server to this capture file, .pcap or "
               "packed .pcap.gz");
    table.file("second-record", second_.record, "And of that with --second-server to this one");
    table.choice("log-level", settings_.log_level,
                 {"trace", "debug", "info", "warn", "error", "off"},
                 "What to say on standard error");
    table.flag("quiet", quiet_, "Log warnings and errors only");
  }

  /// Settings that several options make together, and checks across options.
  void finish() {
    settings_.rate_low = settings_.rate_high = rate_;
    if (!rate_range_.empty()) {
      settings_.rate_low = rate_range_[0];
      settings_.rate_high = rate_range_[1];
    }
    if (quiet_) settings_.log_level = "warn";
    settings_.frame.shapes = !contacts_ && second_.server.empty();
    settings_.tools = {first_};
    if (!second_.server.empty()) {
      settings_.tools.push_back(second_);
    } else {
      refuse_without_second_server("--second-tool", second_.tool);
      refuse_without_second_server("--second-start", second_.start);
      refuse_without_second_server("--second-record", second_.record);
    }

    const FrameOptions& frame = settings_.frame;
    if (const auto error =
            find_error("--delay", frame.delay, Range{0, 1 / settings_.rate_high, "s"})) {
      throw UsageError(*error + ", the shortest frame");
    }
    // A configuration can be printed without a world.
    if (!command_line_.prints_configuration() && settings_.world.empty()) {
      throw UsageError("--world is missing: which world to simulate, an SDFormat or URDF file");
    }
  }

  static void refuse_without_second_server(const std::string& option, const std::string& value) {
    if (value.empty()) return;
    throw UsageError(option + " " + value + " needs --second-server: the tool's server, HOST:PORT");
  }

  settings::CommandLine command_line_{
      {.name = "ve_client",
       .purpose = "Simulates a virtual environment and sends the haptic server what its tool "
                  "touches, or nearly touches.",
       .footer = kFooter,
       .usual = {"world", "tool", "server", "key-file", "page", "rate", "contacts", "epsilon",
                 "record", "duration", "check"}}};
  Settings settings_;
  ToolSettings first_{{}, "127.0.0.1:47800", {}};
  ToolSettings second_;
  double rate_ = 60;
  std::vector<double> rate_range_;
  bool contacts_ = false;
  bool quiet_ = false;
};

}  // namespace

ParsedArguments parse_arguments(int argc, const char* const* argv) {
  return CommandLine().parse(argc, argv);
}

}  // namespace hlm::ve
