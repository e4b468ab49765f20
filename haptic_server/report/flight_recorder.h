// The last seconds of every tick, kept in memory and written to a file when something went wrong.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "hlm/haptic_server/report/tick_record.h"

namespace hlm::server {

struct FlightRecorderOptions {
  std::filesystem::path directory;  ///< Directory of the recordings; made where it is missing.
  int kept = 20;                    ///< Recordings that stay there: the latest, at least 1.
  double rate = 1000;               ///< Rate of the ticks, Hz.
};

/// Keeps ticks in a ring that is allocated once. A fault, or request(), has a thread of its own
/// write kBefore seconds before it and kAfter seconds after it, in the form of the tick log
/// (tick_csv.h). Causes that come until that is written share one further recording.
///
/// Ticks that come while a recording is written go on into the ring, which has room for kSlack
/// seconds of them and for what the writer is done with. Once it is full, ticks are not kept, and
/// the log says how many; they are missing in the next recording only.
///
/// It is fed by the thread that drains the tick log, never by the servo thread.
class FlightRecorder {
 public:
  static constexpr double kBefore = 10;  ///< s.
  static constexpr double kAfter = 0.5;  ///< s: what became of it.
  /// More endures a slower disk, for memory: 0.8 MB per second at 1 kHz.
  static constexpr double kSlack = 4;  ///< s.

  explicit FlightRecorder(const FlightRecorderOptions& options);
  /// Writes what is still due, and waits for that.
  ~FlightRecorder();
  FlightRecorder(const FlightRecorder&) = delete;
  FlightRecorder& operator=(const FlightRecorder&) = delete;

  /// Every tick, in order.
  void observe(const TickRecord& record);
  /// Asks for a recording from the next tick observed on. From any thread or a signal handler.
  void request() noexcept { requested_.store(true, std::memory_order_relaxed); }

  /// Ticks that were not kept.
  std::uint64_t lost() const noexcept { return lost_; }

 private:
  /// Ticks [first, end) by the number under which they were observed.
  struct Job {
    std::uint64_t first = 0;
    std::uint64_t end = 0;
    std::string cause;
  };

  void keep(const TickRecord& record);
  void take_cause(const std::string& cause, double time);
  void write_if_due();
  void write_jobs(const std::stop_token& stop);
  void write(const Job& job);
  std::error_code write_ticks(const Job& job, const std::filesystem::path& path);
  void remove_oldest(const std::filesystem::path& newest) const;
  const TickRecord& at(std::uint64_t number) const { return ring_[number % ring_.size()]; }

  FlightRecorderOptions options_;
  std::vector<TickRecord> ring_;
  std::uint64_t observed_ = 0;  ///< Ticks put into the ring.
  /// First tick that the writer still needs; none: the largest number.
  std::atomic<std::uint64_t> needed_;
  std::uint64_t lost_ = 0;
  std::uint64_t reported_lost_ = 0;
  Fault fault_ = Fault::kNone;  ///< Fault of the latest tick.
  std::atomic<bool> requested_ = false;
  std::string cause_;  ///< Cause of the recording that waits to be written.
  double due_ = 0;     ///< When to write it, s; counts while there is a cause.

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::optional<Job> job_;  ///< Being written, or to be.
  std::jthread writer_;
};

}  // namespace hlm::server
