// What the user sets of the client, from the command line or a configuration file.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "ve_client/client/impaired_link.h"
#include "ve_client/frame.h"
#include "ve_client/world/virtual_tool.h"

namespace hlm::ve {

struct Settings {
  std::string server = "127.0.0.1:47800";  ///< HOST:PORT.
  std::string key_file;                    ///< The server's; empty: none.
  std::string world;                       ///< SDF file.
  std::string tool;                        ///< Model of the world; empty: the one that it names.
  std::string start;                       ///< One of its <haptic:start>; empty: as placed.
  FrameOptions frame;
  FollowOptions follow;
  double rate_low = 60;        ///< Hz. The rate of each frame is drawn between these.
  double rate_high = 60;       ///< Hz.
  std::uint64_t seed = 1;      ///< Of the drawn rates.
  std::string record;          ///< Capture file; empty: none.
  double duration = 0;         ///< s; 0: until stopped.
  double connect_timeout = 0;  ///< s; 0: wait for ever.
  std::string page;            ///< ADDRESS:PORT of the live page; empty: none.
  std::string page_root;       ///< Folder of its files; empty: where they were built.
  std::string recordings;      ///< Of the server, on this machine; empty: where they usually are.
  NetworkConditions network;
  std::string log_level = "info";
  bool check = false;  ///< Only say what would be used of the world.
};

/// What the arguments ask for.
struct ParsedArguments {
  std::optional<Settings> settings;  ///< Empty if the program shall end, with `exit_code`.
  int exit_code = 0;
};

/// Reads the arguments. Prints help, the version, the effective configuration or, on stderr, one
/// line naming the option, its value and what is allowed.
ParsedArguments parse_arguments(int argc, const char* const* argv);

}  // namespace hlm::ve
