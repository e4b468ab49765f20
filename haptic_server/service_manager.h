// What the server says to the service manager: systemd's notification protocol (sd_notify(3)).
#pragma once

#include <optional>
#include <string>

#include "hlm/haptic_server/report/tick_record.h"

namespace hlm::server {

/// Says when the server is ready, what it does, that its loop goes on, and that it ends. One
/// datagram each to $NOTIFY_SOCKET; nothing without that variable. Not for the servo thread.
///
/// The protocol is a line of text to a socket, so it takes no library.
class ServiceManager {
 public:
  ServiceManager();
  ~ServiceManager();
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;

  /// Every tick, in order. The watchdog is kept quiet by ticks alone: if the loop or the thread
  /// that drains it stands still, the manager ends the program.
  void observe(const TickRecord& record);
  void stopping() { send("STOPPING=1"); }

 private:
  void send(const std::string& text) const;

  int socket_ = -1;           ///< -1: there is no service manager.
  double watchdog_ = 0;       ///< Period of the watchdog, s; 0: none.
  double quieted_at_ = -1e9;  ///< When the watchdog was quieted last, s.
  std::optional<ServerState> shown_;
};

}  // namespace hlm::server
