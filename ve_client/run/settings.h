// What the user sets of the client, from the command line or a configuration file.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hlm/protocol/transport/impaired_link.h"
#include "hlm/ve_client/run/frame.h"
#include "hlm/ve_client/scene/scene.h"
#include "hlm/ve_client/world/virtual_tool.h"

namespace hlm::ve {

/// A tool, and the server at whose device it is held.
struct ToolSettings : ToolChoice {
  std::string server;  ///< HOST:PORT.
  std::string record;  ///< Capture file; empty: none.
};

struct Settings {
  std::string key_file;             ///< The servers'; empty: none.
  std::string world;                ///< SDF file.
  std::vector<ToolSettings> tools;  ///< 1 to kMostTools.
  FrameOptions frame;
  FollowOptions follow;
  double rate_low = 60;            ///< Hz. The rate of each frame is drawn between these.
  double rate_high = 60;           ///< Hz.
  std::uint64_t seed = 1;          ///< Seed of the drawn rates.
  double duration = 0;             ///< s; 0: until stopped.
  double connect_timeout = 0;      ///< s; 0: wait for ever.
  std::string page;                ///< ADDRESS:PORT of the live page; empty: none.
  bool insecure = false;           ///< The page asks nobody for a token.
  std::uint16_t page_partner = 0;  ///< Port whose pages are taken, too; 0: none.
  std::string page_root;           ///< Folder of its files; empty: where they were built.
  std::string recordings;  ///< Server's recordings on this machine; empty: where they usually are.
  NetworkConditions network;
  std::string log_level = "info";
  bool check = false;  ///< Only say what would be used of the world.
};

/// Which tools, and where they begin.
inline std::vector<ToolChoice> choices(const Settings& settings) {
  return {settings.tools.begin(), settings.tools.end()};
}

/// What the arguments ask for.
struct ParsedArguments {
  std::optional<Settings> settings;  ///< Empty if the program shall end, with `exit_code`.
  int exit_code = 0;
};

/// Reads the arguments. Prints help, the version, the effective configuration or, on stderr, one
/// line naming the option, its value and what is allowed.
ParsedArguments parse_arguments(int argc, const char* const* argv);

}  // namespace hlm::ve
