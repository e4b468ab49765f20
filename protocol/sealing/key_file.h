// The key that server and client share, and the file that it lies in.
#pragma once

#include <filesystem>
#include <string>

#include "hlm/protocol/sealing/noise.h"

namespace hlm::protocol {

/// Reads what write_new_key() has written. Throws std::runtime_error with one line that names the
/// file and what is wrong: it cannot be read, is no key or one byte repeated, others than its owner
/// have rights, or that owner is neither this process's user nor root.
noise::Key read_key(const std::filesystem::path& path);

/// The file of the key that systemd hands to a service, haptic.key among its credentials; empty: it
/// has none, or this is no service.
std::string key_of_service();

/// Draws a key from the system's random source and writes it to a new file that its owner alone
/// can read: a line that says what it is, and a line of 64 hexadecimal digits. Throws
/// std::runtime_error naming the file if it exists or cannot be written.
void write_new_key(const std::filesystem::path& path);

}  // namespace hlm::protocol
