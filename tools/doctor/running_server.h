// What a haptic_server that runs on this machine says of itself in its state file.
//
// A state file counts where the user whose folder it is in owns it, too, and has the UDP socket at
// the address that it names; which process that is says the kernel, by the server's socket beside
// the file. So nobody can say anything of another user's server.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <sys/types.h>

#include "hlm/common/force_chain.h"
#include "hlm/protocol/datagram_link.h"

namespace hlm::server {

struct RunningServer {
  pid_t process = 0;
  uid_t owner = 0;               ///< User whose server it is.
  std::filesystem::path folder;  ///< Where its state file and its socket are.
  double age = 0;      ///< Age of the state file, s. A server that goes on replaces it each second.
  std::string listen;  ///< ADDRESS:PORT.
  std::string capture;  ///< File to which it records all datagrams; empty: none.
  double rate = 0;      ///< Hz.
  bool session = false;
  std::string client;                 ///< ADDRESS:PORT of the session's; empty: none.
  std::string state;                  ///< Its name; empty from older versions.
  std::string fault;                  ///< Its name, "none" without one.
  double silence = 0;                 ///< Time since anything usable came, s.
  std::optional<double> update_rate;  ///< Hz.
  double contact_age = 0;             ///< Age of the latest contacts, s.
  double datagrams = 0;
  std::map<std::string, double> dropped;  ///< Datagrams by reason.
  double ticks = 0;                       ///< Ticks in the second before the file was written.
  double missed = 0;                      ///< Periods, then.
  double overruns = 0;                    ///< Periods missed since it started.
  double load = 0;                        ///< Share of one processor, then.
  double lateness_p50 = 0;                ///< s, then.
  double lateness_p99 = 0;                ///< s, then.
  double lateness_max = 0;                ///< s, then.
  std::string device;
  std::string health;
  double max_force = 0;              ///< N; 0: not rated.
  bool halts = false;                ///< The motors can be taken off from outside.
  std::optional<double> time_guard;  ///< s.
  double force = 0;                  ///< Commanded, N.
  std::vector<ChainLink> chain;

  /// Its loop does nothing: it would have replaced the file.
  bool stands_still() const noexcept { return age > 3; }
};

/// The server that listens there, if it runs on this machine and its state can be read.
std::optional<RunningServer> find_running(const protocol::Endpoint& server);

/// All that run on this machine and whose state can be read, by port.
std::vector<RunningServer> find_all_running();

}  // namespace hlm::server
