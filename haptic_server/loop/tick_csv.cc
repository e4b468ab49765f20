#include "haptic_server/loop/tick_csv.h"

#include <array>
#include <charconv>
#include <string_view>

namespace hlm::server {
namespace {

constexpr std::array<std::string_view, 3> kPosition{"_x_m", "_y_m", "_z_m"};
constexpr std::array<std::string_view, 6> kTwist{"_vx_m_per_s",   "_vy_m_per_s",   "_vz_m_per_s",
                                                 "_wx_rad_per_s", "_wy_rad_per_s", "_wz_rad_per_s"};
constexpr std::array<std::string_view, 6> kWrench{
    "_force_x_N", "_force_y_N", "_force_z_N", "_torque_x_N_m", "_torque_y_N_m", "_torque_z_N_m"};

/// Calls visit(subject, suffix, component) for each component.
template <std::size_t count, class Vector, class Visit>
void visit_vector(std::string_view subject, const std::array<std::string_view, count>& suffixes,
                  const Vector& vector, Visit&& visit) {
  for (std::size_t i = 0; i < count; ++i) {
    visit(subject, suffixes[i], vector[static_cast<Eigen::Index>(i)]);
  }
}

template <class Visit>
void visit_pose(std::string_view subject, const Pose& X, Visit&& visit) {
  visit_vector(subject, kPosition, X.p, visit);
  visit(subject, "_qw", X.R.w());
  visit(subject, "_qx", X.R.x());
  visit(subject, "_qy", X.R.y());
  visit(subject, "_qz", X.R.z());
}

/// Calls visit(subject, suffix, value) for each column in order. The column's name is subject
/// followed by suffix.
template <class Visit>
void visit_columns(const TickRecord& r, Visit&& visit) {
  visit("session", "", r.session);
  visit("step", "", r.step);
  visit("time", "_s", r.time);
  visit("server_state", "", name_of(r.server));
  visit("fault", "", name_of(r.fault));
  visit("contact_state", "", name_of(r.contact_state));
  visit_pose("device", r.X_WD, visit);
  visit_vector("device", kTwist, r.V_WD, visit);
  visit("hand_measured", "", static_cast<int>(r.hand_measured));
  visit_vector("hand", kWrench, r.F_hand, visit);
  visit_pose("proxy", r.X_WP, visit);
  visit_vector("proxy", kTwist, r.V_WP, visit);
  visit_pose("tool", r.X_WT, visit);
  visit_vector("env", kWrench, r.F_env, visit);
  visit_vector("command", kWrench, r.F_command, visit);
  visit("active_contacts", "", r.active_contacts);
  visit("predicted_contacts", "", r.predicted_contacts);
  visit("smallest_separation", "_m", r.smallest_separation);
  visit("adopted", "", r.adopted);
  visit("age", "_s", r.age);
  visit("lateness", "_s", r.lateness);
  visit("execution", "_s", r.execution);
  visit("overruns", "", r.overruns);
  visit("datagrams", "", r.datagrams);
  visit("dropped", "", r.dropped);
}

void append_value(std::string_view word, std::string& text) { text += word; }

template <class Number>
void append_value(Number number, std::string& text) {
  std::array<char, 32> digits;  // The longest double has 24 characters, the longest integer 20.
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), number).ptr;
  text.append(digits.data(), end);
}

/// A line of comma-separated columns, each appended by append(subject, suffix, value).
template <class Append>
void append_line(const TickRecord& record, std::string& text, Append&& append) {
  visit_columns(record, [&](std::string_view subject, std::string_view suffix, const auto& value) {
    append(subject, suffix, value);
    text += ',';
  });
  text.back() = '\n';
}

}  // namespace

std::string tick_csv_header() {
  std::string text;
  append_line(TickRecord{}, text,
              [&](std::string_view subject, std::string_view suffix, const auto&) {
                text += subject;
                text += suffix;
              });
  return text;
}

void append_tick_csv(const TickRecord& record, std::string& text) {
  append_line(record, text, [&](std::string_view, std::string_view, const auto& value) {
    append_value(value, text);
  });
}

}  // namespace hlm::server
