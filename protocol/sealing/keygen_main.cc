// haptic_keygen: makes the key that server and client share.
#include <iostream>
#include <stdexcept>

#include "hlm/common/settings/command_line.h"
#include "hlm/protocol/sealing/key_file.h"

namespace {

const char* const kFooter =
    R"(Example, for two machines:
  haptic_keygen haptic.key
  scp -p haptic.key OTHER:
  haptic_server --listen 0.0.0.0:47800 --key-file haptic.key     here
  ve_client --server HOST:47800 --key-file haptic.key …          there

Whoever has the file can move the device. Exit codes: 0 written; 1 the file exists or cannot be
written; 2 wrong usage.
)";

}  // namespace

int main(int argc, char** argv) {
  std::string path;
  hlm::settings::CommandLine command_line(
      {.name = "haptic_keygen",
       .purpose = "Writes a new random key to FILE, readable by its owner alone. haptic_server, "
                  "ve_client and haptic_replay with the same key talk in sealed datagrams.",
       .footer = kFooter});
  command_line.positional("FILE", path, "New file");
  if (const auto code = command_line.parse(argc, argv)) return *code;
  try {
    hlm::protocol::write_new_key(path);
  } catch (const std::runtime_error& error) {
    std::cerr << "haptic_keygen: " << error.what() << '\n';
    return 1;
  }
  return 0;
}
