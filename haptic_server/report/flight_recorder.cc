#include "hlm/haptic_server/report/flight_recorder.h"

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <ctime>
#include <fstream>
#include <limits>
#include <utility>

#include <spdlog/spdlog.h>

#include "hlm/common/settings/directories.h"
#include "hlm/haptic_server/report/tick_csv.h"

namespace hlm::server {
namespace {

constexpr std::uint64_t kNothing = std::numeric_limits<std::uint64_t>::max();
/// Text is given to the file in pieces of this many ticks.
constexpr std::uint64_t kPiece = 256;

/// A recording's name, for example flight-20261122T065512.250Z-overrun.csv.
std::string file_name(const std::string& cause) {
  using namespace std::chrono;
  const auto now = system_clock::now();
  const std::time_t seconds = system_clock::to_time_t(now);
  const auto ms = duration_cast<milliseconds>(now.time_since_epoch()).count() % 1000;
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  return fmt::format("{}{:04}{:02}{:02}T{:02}{:02}{:02}.{:03}Z-{}{}", settings::kRecordingPrefix,
                     utc.tm_year + 1900, utc.tm_mon + 1, utc.tm_mday, utc.tm_hour, utc.tm_min,
                     utc.tm_sec, ms, cause, settings::kRecordingSuffix);
}

std::size_t ticks_in(double seconds, double rate) {
  return static_cast<std::size_t>(std::ceil(seconds * rate));
}

std::error_code last_error() { return {errno != 0 ? errno : EIO, std::generic_category()}; }

}  // namespace

FlightRecorder::FlightRecorder(const FlightRecorderOptions& options)
    : options_(options),
      ring_(ticks_in(kBefore + kAfter + kSlack, options.rate)),
      needed_(kNothing),
      writer_([this](const std::stop_token& stop) { write_jobs(stop); }) {
  assert(options.kept >= 1);
}

FlightRecorder::~FlightRecorder() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return !job_; });
  lock.unlock();
  due_ = 0;
  write_if_due();
  lock.lock();
  changed_.wait(lock, [this] { return !job_; });
}

void FlightRecorder::observe(const TickRecord& record) {
  keep(record);
  if (requested_.exchange(false, std::memory_order_relaxed)) take_cause("request", record.time);
  if (record.fault != Fault::kNone && fault_ == Fault::kNone) {
    take_cause(std::string(name_of(record.fault)), record.time);
  }
  fault_ = record.fault;
  if (!cause_.empty() && record.time >= due_) write_if_due();
}

void FlightRecorder::keep(const TickRecord& record) {
  const std::uint64_t needed = needed_.load(std::memory_order_acquire);
  if (needed != kNothing && observed_ - needed >= ring_.size()) {
    ++lost_;
    return;
  }
  ring_[observed_ % ring_.size()] = record;
  ++observed_;
}

void FlightRecorder::take_cause(const std::string& cause, double time) {
  if (!cause_.empty()) return;
  cause_ = cause;
  due_ = time + kAfter;
}

/// Not while the writer is busy: a later tick comes back.
void FlightRecorder::write_if_due() {
  if (cause_.empty() || observed_ == 0) return;
  const std::scoped_lock lock(mutex_);
  if (job_) return;
  const std::uint64_t wanted = ticks_in(kBefore + kAfter, options_.rate);
  const std::uint64_t available = std::min<std::uint64_t>(observed_, ring_.size());
  const std::uint64_t first = observed_ - std::min(wanted, available);
  job_ = Job{first, observed_, std::exchange(cause_, {})};
  needed_.store(first, std::memory_order_relaxed);
  if (lost_ > reported_lost_) {
    spdlog::warn("{} ticks came while a recording was written and are missing in the next one",
                 lost_ - std::exchange(reported_lost_, lost_));
  }
  changed_.notify_all();
}

void FlightRecorder::write_jobs(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (changed_.wait(lock, stop, [this] { return job_.has_value(); })) {
    const Job job = *job_;
    lock.unlock();
    write(job);
    needed_.store(kNothing, std::memory_order_release);
    lock.lock();
    job_.reset();
    changed_.notify_all();
  }
}

void FlightRecorder::write(const Job& job) {
  const std::filesystem::path path = options_.directory / file_name(job.cause);
  const std::filesystem::path unfinished = path.string() + ".part";
  std::error_code error;
  std::filesystem::create_directories(options_.directory, error);
  if (!error) error = write_ticks(job, unfinished);
  if (!error) std::filesystem::rename(unfinished, path, error);
  if (error) {
    std::error_code ignored;
    std::filesystem::remove(unfinished, ignored);
    spdlog::error("recording {} cannot be written: {}; the session goes on", path.string(),
                  error.message());
    return;
  }
  spdlog::info("recording {}: {} ticks", path.string(), job.end - job.first);
  remove_oldest(path);
}

std::error_code FlightRecorder::write_ticks(const Job& job, const std::filesystem::path& path) {
  errno = 0;
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  std::string text = tick_csv_header();
  for (std::uint64_t number = job.first; number < job.end; ++number) {
    append_tick_csv(at(number), text);
    if (number % kPiece != 0) continue;
    if (!file.write(text.data(), static_cast<std::streamsize>(text.size()))) return last_error();
    text.clear();
    needed_.store(number + 1, std::memory_order_release);
  }
  file.write(text.data(), static_cast<std::streamsize>(text.size()));
  file.close();
  return file ? std::error_code() : last_error();
}

/// Names tell the age, unless the clock was set back meanwhile: the latest stays.
void FlightRecorder::remove_oldest(const std::filesystem::path& newest) const {
  std::vector<std::filesystem::path> all = settings::find_recordings(options_.directory);
  const std::size_t kept = static_cast<std::size_t>(options_.kept);
  std::error_code ignored;
  std::erase(all, newest);
  for (std::size_t i = 0; i + kept <= all.size(); ++i) std::filesystem::remove(all[i], ignored);
}

}  // namespace hlm::server
