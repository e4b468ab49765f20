// Does the status line say how the session is going?
#include "hlm/haptic_server/report/status_line.h"

#include <sstream>
#include <string>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;

/// Ticks at 1 kHz from `begin` to `end` (ms), all but those between `gap_begin` and `gap_end`.
void observe(StatusLine& status, int begin, int end, int gap_begin = 0, int gap_end = 0) {
  for (int millisecond = begin; millisecond <= end; ++millisecond) {
    if (millisecond > gap_begin && millisecond < gap_end) continue;
    TickRecord record;
    record.time = 1e-3 * millisecond;
    status.observe(record);
  }
}

std::size_t occurrences(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

TEST_CASE("The line names state, rate, datagrams, contacts, force and drift") {
  TickRecord r;
  r.time = 12.04;
  r.server = ServerState::kActive;
  r.overruns = 2;
  r.datagrams = 420;
  r.dropped_for[static_cast<std::size_t>(protocol::DropReason::kMalformed)] = 1;
  r.dropped_for[static_cast<std::size_t>(protocol::DropReason::kIncomplete)] = 2;
  r.active_contacts = 2;
  r.predicted_contacts = 3;
  r.hand_measured = r.hand_observed = true;
  r.F_command << 0.3, 0, -0.4, 5, 5, 5;
  r.X_WD.p = {0.1, 0.12433, 0};
  r.X_WP.p = {0.1, 0.124, 0};
  r.X_WT.p = {0.1001, 0.124, 0};
  CHECK(format_status(r, 999.97) ==
        "12.0 s active | 1000.0 Hz, 2 missed | 420 datagrams, 3 dropped (1 malformed, 2 "
        "incomplete) | contacts 2 active, 3 predicted | 0.50 N, hand observed | device-proxy 0.33 "
        "mm, "
        "proxy-tool 0.10 mm");
}

TEST_CASE("A scene in force is named with its placements and pieces") {
  TickRecord r;
  CHECK_THAT(format_status(r, 1000), !ContainsSubstring("scene"));
  r.scene = 2;
  r.placements = 12;
  r.pieces = 340;
  CHECK_THAT(format_status(r, 1000), ContainsSubstring(" | scene 2: 12 placements, 340 pieces"));
}

TEST_CASE("A fault is named") {
  TickRecord r;
  r.server = ServerState::kFault;
  r.fault = Fault::kNonFinite;
  CHECK_THAT(format_status(r, 1000), ContainsSubstring("fault (non_finite)"));
}

TEST_CASE("Off a terminal there is one line a second with the rate since the line before") {
  std::ostringstream out;
  StatusLine status(out, false);
  observe(status, 0, 3400, 1200, 1701);
  status.close();
  CHECK(occurrences(out.str(), "\n") == 3);
  CHECK(occurrences(out.str(), "1000.0 Hz") == 2);
  CHECK(occurrences(out.str(), "2.0 s off | 500.0 Hz") == 1);
  CHECK(occurrences(out.str(), "\r") == 0);
}

TEST_CASE("On a terminal one line is rewritten four times a second and ended once") {
  std::ostringstream out;
  StatusLine status(out, true);
  observe(status, 0, 2100);
  CHECK(occurrences(out.str(), "\r") == 8);
  CHECK(occurrences(out.str(), "\n") == 0);
  status.close();
  status.close();
  CHECK(occurrences(out.str(), "\n") == 1);
  CHECK(out.str().back() == '\n');
}

TEST_CASE("A run shorter than one interval shows nothing") {
  std::ostringstream out;
  StatusLine status(out, true);
  observe(status, 0, 100);
  status.close();
  CHECK(out.str().empty());
}

}  // namespace
}  // namespace hlm::server
