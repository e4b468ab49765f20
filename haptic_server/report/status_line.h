// The live status line: how the session is going, a few times a second.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <optional>
#include <string>

#include "hlm/haptic_server/report/tick_record.h"

namespace hlm::server {

/// One line without its end, for example "12.0 s active | 1000.0 Hz, 0 missed | 420 datagrams,
/// 1 dropped (1 stale) | contacts 2 active, 3 predicted | 0.50 N | device-proxy 0.33 mm, proxy-tool
/// 0.01 mm". rate: of the ticks since the line before, Hz.
std::string format_status(const TickRecord& record, double rate);

/// Shows the latest of the ticks that it observes.
class StatusLine {
 public:
  /// On a terminal, one line is overwritten every 0.25 s; elsewhere, lines follow each other every
  /// second. `out` must outlive this.
  StatusLine(std::ostream& out, bool terminal) noexcept : out_(out), terminal_(terminal) {}

  /// Every tick, in order.
  void observe(const TickRecord& record);
  /// Leaves the terminal on a fresh line.
  void close();

 private:
  void show(const std::string& line);

  std::ostream& out_;
  bool terminal_;
  bool open_ = false;           ///< The terminal's line holds a status.
  std::optional<double> last_;  ///< Time of the tick last shown, s.
  std::uint64_t ticks_ = 0;     ///< Ticks since then.
};

}  // namespace hlm::server
