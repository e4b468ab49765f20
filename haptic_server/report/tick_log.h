// How every tick's signals leave the servo thread without making it wait, and become a CSV file.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <functional>
#include <string>
#include <system_error>
#include <thread>

#include <boost/lockfree/spsc_queue.hpp>

#include "hlm/haptic_server/report/tick_record.h"

namespace hlm::server {

/// A wait-free ring between the servo thread, which records, and one other thread, which drains.
class TickLog {
 public:
  using Observer = std::function<void(const TickRecord&)>;
  using FailureReport = std::function<void(const std::string& reason)>;

  /// file: the CSV to write, empty for none; an existing one is replaced. capacity: ticks that the
  /// ring holds; kRingTime times the servo rate is usual. observer: called for every record when it
  /// is drained, in order; it feeds status line and summary. report: called while draining, once,
  /// if the file can no longer be written. Throws std::runtime_error if it cannot be written now.
  TickLog(std::string file, std::size_t capacity, Observer observer, FailureReport report = {});

  /// How long the draining side may pause before ticks are lost, s. Memory grows with it: 3 MB at
  /// 1 kHz.
  static constexpr double kRingTime = 4;

  /// Servo thread: hands over one tick. Never waits or allocates; a full ring loses the tick.
  void record(const TickRecord& record) noexcept {
    if (!ring_.push(record)) lost_.fetch_add(1, std::memory_order_relaxed);
  }
  /// Ticks that found the ring full.
  std::uint64_t lost() const noexcept { return lost_.load(std::memory_order_relaxed); }

  /// Draining thread: observes and writes all that was recorded. A file that can no longer be
  /// written is reported and given up; the observer goes on.
  void drain();
  /// Drains the rest, completes and closes the file. Throws std::runtime_error if any of it could
  /// not be written.
  void close();

 private:
  void write_text();
  std::string failure() const;

  std::string file_name_;
  std::ofstream file_;
  std::error_code error_;  ///< Why the file was given up.
  std::string text_;       ///< Lines not yet given to the file.
  boost::lockfree::spsc_queue<TickRecord> ring_;
  std::atomic<std::uint64_t> lost_ = 0;
  Observer observer_;
  FailureReport report_;
};

/// Drains a tick log from a thread of its own during its life.
class TickLogThread {
 public:
  /// `log` must outlive this.
  explicit TickLogThread(TickLog& log);

 private:
  std::jthread thread_;
};

}  // namespace hlm::server
