#include "hlm/device/replay_device.h"

#include <array>
#include <cassert>
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <string_view>
#include <tuple>
#include <utility>

// The reader would otherwise start a thread for each file.
#define CSV_IO_NO_THREAD
#include <libfccp/csv.h>

#include "hlm/device/device_columns.h"

namespace hlm::server {
namespace {

/// The signals of a tick that a replay needs.
struct RecordedSignals {
  std::uint64_t session = 0;
  std::uint64_t step = 0;
  Pose X_WD;
  Twist V_WD = Twist::Zero();
  bool hand_measured = false;
  bool hand_observed = false;
  Wrench F_hand = Wrench::Zero();
};

template <class Visit>
constexpr void visit_needed(Visit&& visit) {
  visit_step<RecordedSignals>(visit);
  visit_device<RecordedSignals>(visit);
}

constexpr std::size_t kColumnCount = [] {
  std::size_t count = 0;
  visit_needed([&](auto, auto, const auto& suffixes) { count += suffixes.size(); });
  return count;
}();

const std::array<std::string, kColumnCount>& needed_columns() {
  static const std::array columns = [] {
    std::array<std::string, kColumnCount> names;
    auto next = names.begin();
    visit_needed([&](std::string_view name, auto, const auto& suffixes) {
      for (const std::string_view suffix : suffixes) *next++ = std::string(name).append(suffix);
    });
    return names;
  }();
  return columns;
}

/// Allowed deviation of a recorded quaternion's length from 1: far above rounding, far below any
/// other mistake.
constexpr double kUnitTolerance = 1e-6;

using CsvReader = io::CSVReader<kColumnCount>;
using Cells = std::array<char*, kColumnCount>;

void read_header(CsvReader& csv) {
  std::apply([&](const auto&... names) { csv.read_header(io::ignore_extra_column, names...); },
             needed_columns());
}

bool read_cells(CsvReader& csv, Cells& cells) {
  return std::apply([&](auto&... cell) { return csv.read_row(cell...); }, cells);
}

/// One line of the log.
class Row {
 public:
  Row(const std::string& path, unsigned line, const Cells& cells)
      : path_(path), line_(line), cells_(cells) {}

  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(path_ + ':' + std::to_string(line_) + ": " + what);
  }

  RecordedSignals signals() const {
    RecordedSignals signals;
    std::size_t column = 0;
    visit_needed([&](auto, auto member, const auto& suffixes) {
      for (std::size_t i = 0; i < suffixes.size(); ++i) {
        read(column++, component(signals.*member, i));
      }
    });
    return signals;
  }

 private:
  void read(std::size_t column, double& value) const {
    parse(column, value, "a number");
    if (!std::isfinite(value)) fail_at(column, "a finite number");
  }
  void read(std::size_t column, std::uint64_t& value) const {
    parse(column, value, "a whole number");
  }
  void read(std::size_t column, bool& value) const {
    std::uint64_t number = 0;
    parse(column, number, "0 or 1");
    if (number > 1) fail_at(column, "0 or 1");
    value = number == 1;
  }

  template <class Number>
  void parse(std::size_t column, Number& value, std::string_view what) const {
    const std::string_view text = cells_[column];
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size()) fail_at(column, what);
  }
  [[noreturn]] void fail_at(std::size_t column, std::string_view what) const {
    fail("column " + needed_columns()[column] + ": '" + cells_[column] + "' must be " +
         std::string(what));
  }

  const std::string& path_;
  unsigned line_;
  const Cells& cells_;
};

void read_row(const Row& row, std::vector<RecordedStep>& steps) {
  const RecordedSignals signals = row.signals();
  if (signals.step == 0) return;
  const bool goes_on = !steps.empty() && steps.back().session == signals.session;
  const std::uint64_t expected = goes_on ? steps.back().step + 1 : 1;
  if (signals.step != expected) {
    row.fail("column step: '" + std::to_string(signals.step) + "' must be " +
             std::to_string(expected) + "; a replay needs every step of a session");
  }
  if (std::abs(signals.X_WD.R.norm() - 1) > kUnitTolerance) {
    row.fail("columns device_qw to device_qz must be a unit quaternion, its length is " +
             std::to_string(signals.X_WD.R.norm()));
  }
  RecordedStep step;
  step.session = signals.session;
  step.step = signals.step;
  step.state.X_WD = signals.X_WD;
  step.state.V_WD = signals.V_WD;
  if (signals.hand_measured) step.state.F_hand = signals.F_hand;
  step.state.hand_observed = signals.hand_observed;
  steps.push_back(step);
}

}  // namespace

std::vector<RecordedStep> read_recorded_steps(const std::string& path) {
  std::vector<RecordedStep> steps;
  try {
    CsvReader csv(path);
    read_header(csv);
    Cells cells{};
    while (read_cells(csv, cells)) read_row(Row(path, csv.get_file_line(), cells), steps);
  } catch (const io::error::base& error) {
    throw std::runtime_error("tick log " + path + ": " + error.what());
  }
  if (steps.empty()) throw std::runtime_error("tick log " + path + ": holds no step of a session");
  return steps;
}

ReplayDevice::ReplayDevice(std::vector<RecordedStep> steps, const DeviceRatings& ratings)
    : steps_(std::move(steps)), ratings_(ratings) {
  assert(!steps_.empty());
  ratings_.halts = true;  // It has no motors.
}

void ReplayDevice::align(const Pose&) noexcept {
  present_ = session_end_;
  while (session_end_ < steps_.size() && steps_[session_end_].session == steps_[present_].session) {
    ++session_end_;
  }
  aligned_ = true;
}

std::optional<DeviceState> ReplayDevice::read() noexcept {
  if (!aligned_) return steps_.front().state;
  if (present_ == session_end_) return std::nullopt;
  return steps_[present_].state;
}

bool ReplayDevice::write(const Wrench&) noexcept {
  if (!aligned_) return true;
  if (present_ == session_end_) return false;
  ++present_;
  return true;
}

}  // namespace hlm::server
