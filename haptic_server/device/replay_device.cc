#include "haptic_server/device/replay_device.h"

#include <array>
#include <cassert>
#include <charconv>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <utility>

// The reader would otherwise start a thread for each file.
#define CSV_IO_NO_THREAD
#include <libfccp/csv.h>

namespace hlm::server {
namespace {

/// The tick log's columns that a replay needs.
constexpr std::array kColumns{"session",
                              "step",
                              "device_x_m",
                              "device_y_m",
                              "device_z_m",
                              "device_qw",
                              "device_qx",
                              "device_qy",
                              "device_qz",
                              "device_vx_m_per_s",
                              "device_vy_m_per_s",
                              "device_vz_m_per_s",
                              "device_wx_rad_per_s",
                              "device_wy_rad_per_s",
                              "device_wz_rad_per_s",
                              "hand_measured",
                              "hand_force_x_N",
                              "hand_force_y_N",
                              "hand_force_z_N",
                              "hand_torque_x_N_m",
                              "hand_torque_y_N_m",
                              "hand_torque_z_N_m"};

/// Allowed deviation of a recorded quaternion's length from 1: far above rounding, far below any
/// other mistake.
constexpr double kUnitTolerance = 1e-6;

using CsvReader = io::CSVReader<kColumns.size()>;
using Cells = std::array<char*, kColumns.size()>;

template <std::size_t... i>
void read_header(CsvReader& csv, std::index_sequence<i...>) {
  csv.read_header(io::ignore_extra_column, kColumns[i]...);
}

template <std::size_t... i>
bool read_cells(CsvReader& csv, Cells& cells, std::index_sequence<i...>) {
  return csv.read_row(cells[i]...);
}

/// One line of the log, taken cell by cell in the order of kColumns.
class Row {
 public:
  Row(const std::string& path, unsigned line, const Cells& cells)
      : path_(path), line_(line), cells_(cells) {}

  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(path_ + ':' + std::to_string(line_) + ": " + what);
  }

  std::uint64_t whole() { return take<std::uint64_t>("a whole number"); }
  double number() {
    const std::string_view column = kColumns[next_];
    const std::string_view text = cells_[next_];
    const double value = take<double>("a number");
    if (!std::isfinite(value)) fail_at(column, text, "a finite number");
    return value;
  }
  template <class Vector>
  void vector(Vector& v) {
    for (Eigen::Index i = 0; i < v.size(); ++i) v[i] = number();
  }

 private:
  template <class Number>
  Number take(std::string_view what) {
    const std::string_view column = kColumns[next_];
    const std::string_view text = cells_[next_++];
    Number value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size()) fail_at(column, text, what);
    return value;
  }
  [[noreturn]] void fail_at(std::string_view column, std::string_view text,
                            std::string_view what) const {
    fail("column " + std::string(column) + ": '" + std::string(text) + "' must be " +
         std::string(what));
  }

  const std::string& path_;
  unsigned line_;
  const Cells& cells_;
  std::size_t next_ = 0;
};

DeviceState read_state(Row& row) {
  DeviceState state;
  row.vector(state.X_WD.p);
  Quaternion& R = state.X_WD.R;
  for (double* component : {&R.w(), &R.x(), &R.y(), &R.z()}) *component = row.number();
  if (std::abs(R.norm() - 1) > kUnitTolerance) {
    row.fail("columns device_qw to device_qz must be a unit quaternion, its length is " +
             std::to_string(R.norm()));
  }
  row.vector(state.V_WD);
  const bool measured = row.whole() != 0;
  Wrench F_hand;
  row.vector(F_hand);
  if (measured) state.F_hand = F_hand;
  return state;
}

void read_row(Row row, std::vector<RecordedStep>& steps) {
  RecordedStep recorded;
  recorded.session = row.whole();
  recorded.step = row.whole();
  if (recorded.step == 0) return;
  const bool goes_on = !steps.empty() && steps.back().session == recorded.session;
  const std::uint64_t expected = goes_on ? steps.back().step + 1 : 1;
  if (recorded.step != expected) {
    row.fail("column step: '" + std::to_string(recorded.step) + "' must be " +
             std::to_string(expected) + "; a replay needs every step of a session");
  }
  recorded.state = read_state(row);
  steps.push_back(recorded);
}

}  // namespace

std::vector<RecordedStep> read_recorded_steps(const std::string& path) {
  constexpr auto kAll = std::make_index_sequence<kColumns.size()>{};
  std::vector<RecordedStep> steps;
  try {
    CsvReader csv(path);
    read_header(csv, kAll);
    Cells cells{};
    while (read_cells(csv, cells, kAll)) read_row(Row(path, csv.get_file_line(), cells), steps);
  } catch (const io::error::base& error) {
    throw std::runtime_error("tick log " + path + ": " + error.what());
  }
  if (steps.empty()) throw std::runtime_error("tick log " + path + ": holds no step of a session");
  return steps;
}

ReplayDevice::ReplayDevice(std::vector<RecordedStep> steps, const DeviceRatings& ratings)
    : steps_(std::move(steps)), ratings_(ratings) {
  assert(!steps_.empty());
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
