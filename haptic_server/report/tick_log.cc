#include "hlm/haptic_server/report/tick_log.h"

#include <cerrno>
#include <chrono>
#include <stdexcept>
#include <utility>

#include "hlm/haptic_server/report/tick_csv.h"

namespace hlm::server {
namespace {

/// Text is given to the file in pieces of about this size, bytes. Smaller ones cost a system call
/// more often.
constexpr std::size_t kPiece = 1 << 18;
/// Room for one more line, bytes: 68 columns of at most 25 characters.
constexpr std::size_t kLongestLine = 2048;

}  // namespace

TickLog::TickLog(std::string file, std::size_t capacity, Observer observer, FailureReport report)
    : file_name_(std::move(file)), ring_(capacity), observer_(std::move(observer)) {
  if (file_name_.empty()) return;
  file_.open(file_name_, std::ios::binary | std::ios::trunc);
  text_.reserve(kPiece + kLongestLine);
  text_ = tick_csv_header();
  write_text();
  if (error_) throw std::runtime_error(failure());
  report_ = std::move(report);
}

void TickLog::drain() {
  ring_.consume_all([this](const TickRecord& record) {
    if (observer_) observer_(record);
    if (!file_.is_open()) return;
    append_tick_csv(record, text_);
    if (text_.size() >= kPiece) write_text();
  });
  write_text();
}

void TickLog::close() {
  drain();
  if (file_.is_open()) file_.close();
  if (error_) throw std::runtime_error(failure());
}

void TickLog::write_text() {
  if (text_.empty()) return;
  if (!file_.write(text_.data(), static_cast<std::streamsize>(text_.size())).flush()) {
    error_ = std::error_code(errno, std::generic_category());
    file_.close();
    if (report_) report_(failure());
  }
  text_.clear();
}

std::string TickLog::failure() const {
  return "tick log " + file_name_ + " cannot be written: " + error_.message();
}

TickLogThread::TickLogThread(TickLog& log)
    : thread_([&log](const std::stop_token& stop) {
        constexpr auto kDrainPeriod = std::chrono::milliseconds(20);
        while (!stop.stop_requested()) {
          log.drain();
          std::this_thread::sleep_for(kDrainPeriod);
        }
      }) {}

}  // namespace hlm::server
