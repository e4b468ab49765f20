#include "hlm/tools/replay/signal_stream.h"

#include <algorithm>
#include <array>
#include <bit>
#include <iostream>
#include <stdexcept>
#include <string_view>
#include <type_traits>

#include <spdlog/fmt/fmt.h>

#include "hlm/haptic_server/report/tick_numbers.h"

namespace hlm::server {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::uint32_t kTicksOfBlock = 4096;

/// As visit(name, type, value): of a tick, what is not among its numbers.
template <class Visit>
void visit_extra(const TickRecord& record, std::uint32_t contacts, Visit&& visit) {
  visit("session_id", "<u8", record.session);
  visit("contacts", "<u4", contacts);
  visit("buttons", "<u4", record.buttons);
  visit("gripper", "<f8", record.gripper);
}

/// Of a contact: its sides, and where and how it pushes side a.
template <class Visit>
void visit_contact(const LocalContact& contact, Visit&& visit) {
  visit("identity", "<u8", contact.identity);
  visit("a_kind", "u1", static_cast<std::uint8_t>(contact.a.kind));
  visit("b_kind", "u1", static_cast<std::uint8_t>(contact.b.kind));
  visit("a", "<u4", contact.a.index);
  visit("b", "<u4", contact.b.index);
  visit("separation_m", "<f4", static_cast<float>(contact.now.s));
  const auto vector = [&](const std::array<const char*, 3>& names, const Vector3& value) {
    for (Eigen::Index i = 0; i < 3; ++i) {
      visit(names[static_cast<std::size_t>(i)], "<f4", static_cast<float>(value[i]));
    }
  };
  vector({"point_x_m", "point_y_m", "point_z_m"}, contact.now.p_W);
  vector({"normal_x", "normal_y", "normal_z"}, contact.now.n_W);
  vector({"force_x_N", "force_y_N", "force_z_N"}, contact.latest.f_W);
}

void add_field(std::string& fields, std::string_view name, std::string_view type) {
  fields += fields.empty() ? "[" : ", ";
  fields.append("[\"").append(name).append("\", \"").append(type).append("\"]");
}

/// `names`: of tick_number_names().
void add_numbers(std::string_view names, std::string& fields) {
  while (!names.empty()) {
    const std::string_view column = names.substr(0, names.find(','));
    names.remove_prefix(std::min(names.size(), column.size() + 1));
    add_field(fields, column.substr(0, column.find('=')), "<f8");
  }
}

std::string description(double period) {
  std::string ticks;
  std::string contacts;
  visit_extra({}, 0, [&](auto name, auto type, auto) { add_field(ticks, name, type); });
  add_numbers(tick_number_names(), ticks);
  visit_contact({}, [&](auto name, auto type, auto) { add_field(contacts, name, type); });
  return fmt::format("{{\"period_s\": {}, \"ticks\": {}], \"contacts\": {}]}}\n", period, ticks,
                     contacts);
}

template <class Value>
void append(std::vector<char>& bytes, const Value& value) {
  const char* const begin = reinterpret_cast<const char*>(&value);
  bytes.insert(bytes.end(), begin, begin + sizeof(Value));
}

bool is_loaded(const LocalContact& contact) { return !contact.latest.f_W.isZero(0); }

}  // namespace

SignalStream::SignalStream(const std::string& file, double period)
    : name_(file == "-" ? "standard output" : file),
      out_(file == "-" ? std::cout : file_),
      numbers_(tick_number_count()) {
  if (file != "-") file_.open(file, std::ios::binary | std::ios::trunc);
  const std::string line = description(period);
  write(line.data(), line.size());
}

void SignalStream::observe(const TickRecord& record, const Servo& servo) {
  std::uint32_t count = 0;
  if (servo.local_model()) {
    for (const LocalContact& contact : servo.local_model()->contacts()) {
      if (!is_loaded(contact)) continue;
      visit_contact(contact, [&](auto, auto, auto value) { append(contacts_, value); });
      ++count;
    }
  }
  visit_extra(record, count, [&](auto, auto, auto value) { append(ticks_, value); });
  copy_numbers(record, numbers_.data());
  const char* const numbers = reinterpret_cast<const char*>(numbers_.data());
  ticks_.insert(ticks_.end(), numbers, numbers + numbers_.size() * sizeof(double));
  contact_count_ += count;
  if (++tick_count_ == kTicksOfBlock) write_block();
}

void SignalStream::close() {
  if (tick_count_ > 0) write_block();
  out_.flush();
  check();
}

void SignalStream::write_block() {
  const std::array<std::uint32_t, 2> counts{tick_count_, contact_count_};
  write(reinterpret_cast<const char*>(counts.data()), sizeof counts);
  write(ticks_.data(), ticks_.size());
  write(contacts_.data(), contacts_.size());
  ticks_.clear();
  contacts_.clear();
  tick_count_ = contact_count_ = 0;
}

void SignalStream::write(const char* data, std::size_t size) {
  out_.write(data, static_cast<std::streamsize>(size));
  check();
}

void SignalStream::check() const {
  if (!out_) throw std::runtime_error(name_ + " cannot be written");
}

}  // namespace hlm::server
