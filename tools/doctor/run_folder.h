// A folder in which servers of one user say how they are, as far as that can be believed.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <sys/types.h>

#include "hlm/common/descriptor.h"
#include "hlm/protocol/datagram_link.h"

namespace hlm::server {

/// Whoever can write in the folder can put anything there, for a doctor that runs as root: nothing
/// here waits, follows a link or believes a name.
class RunFolder {
 public:
  /// Empty if it is no folder or cannot be read.
  explicit RunFolder(const std::filesystem::path& path);

  const std::filesystem::path& path() const noexcept { return path_; }
  uid_t owner() const noexcept { return owner_; }

  /// Names that end so: at most kMostNames, of any type.
  std::vector<std::string> names(const std::string& suffix) const;

  /// A regular file of the folder's owner, of at most kLargestFile; none of anything else.
  std::optional<std::string> read(const std::string& name) const;

  /// A process that listens at a socket there.
  struct Listener {
    Descriptor connection;  ///< None: nothing listens, or somebody else than the folder's owner.
    pid_t process = 0;      ///< As the kernel says.
    bool is_gone = false;   ///< There is something of that name, and nobody of the owner's listens.
  };
  Listener listener(const std::string& name) const;

  /// Whether the folder's owner, and nobody else, has a UDP socket bound at this very endpoint.
  bool owner_has_port(const protocol::Endpoint& endpoint) const;
  /// Whether the process is the folder's owner's.
  bool owner_runs(pid_t process) const;

 private:
  static constexpr std::size_t kMostNames = 256;          ///< Above the servers of a large machine.
  static constexpr std::size_t kLargestFile = 64 * 1024;  ///< Bytes: some ten state files.

  std::filesystem::path path_;
  Descriptor folder_;
  uid_t owner_ = 0;
};

/// Sends a server's operator socket a command. Whether it was done; false, too, where no answer
/// comes within 2 s.
bool command(const Descriptor& connection, const std::string& what);

}  // namespace hlm::server
