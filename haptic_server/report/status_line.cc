#include "hlm/haptic_server/report/status_line.h"

#include <ostream>

#include <spdlog/fmt/fmt.h>

#include "hlm/protocol/messages.h"

namespace hlm::server {
namespace {

constexpr double kTerminalPeriod = 0.25;  // s.
constexpr double kPlainPeriod = 1;        // s.

// Terminal control: no wrapping of long lines, so that the line can be overwritten as a whole.
constexpr const char* kBeginLine = "\r\x1b[?7l";
constexpr const char* kEndLine = "\x1b[K\x1b[?7h";

std::string state(const TickRecord& record) {
  std::string text(name_of(record.server));
  if (record.fault != Fault::kNone) text += fmt::format(" ({})", name_of(record.fault));
  if (record.fade != Fade::kNone) text += fmt::format(" ({})", name_of(record.fade));
  return text;
}

std::string scene(const TickRecord& r) {
  if (r.scene == 0) return "";
  std::string text =
      fmt::format(" | scene {}: {} placements, {} pieces", r.scene, r.placements, r.pieces);
  if (r.left_out > 0) text += fmt::format(", {} left out", r.left_out);
  return text;
}

}  // namespace

std::string format_status(const TickRecord& r, double rate) {
  constexpr double kMillimetres = 1e3;
  const std::string line = fmt::format(
      "{:.1f} s {} | {:.1f} Hz, {} missed | {} datagrams, {} | contacts {} active, {} predicted "
      "| {:.2f} N, hand {} | device-proxy {:.2f} mm, proxy-tool {:.2f} mm",
      r.time, state(r), rate, r.overruns, r.datagrams, protocol::describe_drops(r.dropped_for),
      r.active_contacts, r.predicted_contacts, r.F_command.head<3>().norm(),
      protocol::hand_source(r.hand_measured, r.hand_observed),
      kMillimetres * (r.X_WD.p - r.X_WP.p).norm(), kMillimetres * (r.X_WP.p - r.X_WT.p).norm());
  return line + scene(r);
}

void StatusLine::observe(const TickRecord& record) {
  if (!last_) {
    last_ = record.time;
    return;
  }
  ++ticks_;
  const double interval = record.time - *last_;
  if (interval < (terminal_ ? kTerminalPeriod : kPlainPeriod)) return;
  show(format_status(record, static_cast<double>(ticks_) / interval));
  last_ = record.time;
  ticks_ = 0;
}

void StatusLine::show(const std::string& line) {
  if (terminal_) {
    out_ << kBeginLine << line << kEndLine;
  } else {
    out_ << line << '\n';
  }
  out_.flush();
  open_ = terminal_;
}

void StatusLine::close() {
  if (open_) out_ << '\n' << std::flush;
  open_ = false;
}

}  // namespace hlm::server
