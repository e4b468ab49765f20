#include "hlm/devices/exchange_device.h"

#include <algorithm>
#include <csignal>
#include <set>
#include <stdexcept>
#include <utility>

#include <sched.h>
#include <spdlog/spdlog.h>

#include "hlm/common/one_line.h"
#include "hlm/haptic_server/device/saturate.h"

namespace hlm::server {
namespace {

using std::chrono::duration;
using std::chrono::steady_clock;

/// A state this share of the oldest one is late already.
constexpr int kLateShare = 3;

/// Longest wait before the thread looks whether a force has to end.
constexpr std::chrono::milliseconds kLook{1};

/// Between two tries to open the line, s. Less asks an absent service more often; more lets a
/// person wait who has plugged the device in again.
constexpr duration<double> kRetry{0.25};

/// Time for which a line must work again to be back, s. Less reports every try of a broken one.
constexpr duration<double> kSteady{0.5};

/// No such handle reaches farther, m: a position beyond it has another unit.
constexpr double kFarthest = 2;

constexpr const char* kLate = "its newest state is too old";
constexpr const char* kSaturated = "its motors are at their limit";

std::chrono::nanoseconds nanoseconds(double seconds) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(duration<double>(seconds));
}

std::string milliseconds(std::chrono::nanoseconds time) {
  return fmt::format("{:.3g} ms", 1e-6 * static_cast<double>(time.count()));
}

/// A thread that gets no signals: they are for the program's own threads.
template <class Function>
std::thread thread_without_signals(Function function) {
  sigset_t all;
  sigset_t before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  std::thread thread(std::move(function));
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  return thread;
}

/// Longest cause that is logged and kept, bytes; what a service says can be long.
constexpr std::size_t kLongestCause = 200;

/// The text in one line that is not too long, cut between two characters.
std::string shortened(const std::string& text) {
  std::string line = one_line(text);
  if (line.size() <= kLongestCause) return line;
  std::size_t end = kLongestCause;
  while (end > 0 && (static_cast<unsigned char>(line[end]) & 0xC0) == 0x80) --end;
  return line.substr(0, end) + "...";
}

/// The text for as long as the program runs; there are not many.
const char* kept(const std::string& text) {
  static std::set<std::string> texts;
  constexpr std::size_t kMost = 1000;
  return texts.size() < kMost ? texts.insert(text).first->c_str() : "it failed too often";
}

}  // namespace

std::optional<std::string> find_error(const ExchangeOptions& options) {
  const double least = kLateShare / options.rate;
  if (options.oldest >= least) return std::nullopt;
  return fmt::format(
      "oldest {} s must be at least {:.3g} s, the time of {} requests at the rate {} Hz",
      options.oldest, least, kLateShare, options.rate);
}

void add_keys(settings::Table& table, ExchangeOptions& options) {
  table.number("rate", options.rate, {100, 8000, "Hz"}, "Requests, at most");
  table.number("oldest", options.oldest, {0.002, 0.5, "s"},
               "An older state is a failure, an older force is not sent");
}

ExchangeDevice::ExchangeDevice(std::string name, const DeviceRatings& ratings,
                               const ExchangeOptions& options, std::unique_ptr<DeviceLine> line)
    : name_(std::move(name)),
      ratings_(ratings),
      period_(nanoseconds(1 / options.rate)),
      oldest_(nanoseconds(options.oldest)),
      first_state_(options.first_state),
      line_(std::move(line)) {
  ratings_.exchange_rate = options.rate;
}

ExchangeDevice::~ExchangeDevice() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void ExchangeDevice::calibrate() {
  thread_ = thread_without_signals([this] { run(); });
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, first_state_, [this] { return has_state_ || !cause_.empty(); });
  if (has_state_) return;
  if (!cause_.empty()) throw std::runtime_error(name_ + ": " + cause_);
  throw std::runtime_error(fmt::format("{}: no state within {} s", name_, first_state_.count()));
}

void ExchangeDevice::enable() noexcept {
  failures_seen_ = failures_.load(std::memory_order_acquire);
  force_.put({});
  halted_ = false;
  enabled_ = true;
}

void ExchangeDevice::disable() noexcept { enabled_ = false; }

void ExchangeDevice::halt() noexcept {
  halted_ = true;
  line_->halt();
}

std::optional<DeviceState> ExchangeDevice::read() noexcept {
  const TimedState& newest = state_.get();
  const auto age = steady_clock::now() - newest.asked;
  if (failures_.load(std::memory_order_acquire) != failures_seen_) {
    cause_now_ = told_;
    return std::nullopt;
  }
  if (newest.asked == SteadyTime{}) {  // Enabled while the line is down.
    cause_now_ = told_;
    return std::nullopt;
  }
  const bool is_late = kLateShare * age > oldest_;
  cause_now_ = newest.handle.saturated ? kSaturated : "";
  if (is_late) cause_now_ = kLate;
  if (newest.handle.force_off != nullptr) cause_now_ = newest.handle.force_off;
  if (age > oldest_) return std::nullopt;
  DeviceState state;
  state.X_WD = newest.handle.X;
  state.V_WD = newest.handle.V;
  state.buttons = newest.handle.buttons;
  if (newest.handle.saturated) state.health = DeviceHealth::kSaturated;
  if (is_late) state.health = DeviceHealth::kLate;
  if (newest.handle.force_off != nullptr) state.health = DeviceHealth::kForceOff;
  return state;
}

bool ExchangeDevice::write(const Wrench& F) noexcept {
  if (!F.allFinite()) return false;
  force_.put(
      {.force = saturated(F, ratings_.max_force, 0).head<3>(), .written = steady_clock::now()});
  return true;
}

void ExchangeDevice::run() {
  const sched_param lowest{.sched_priority = 1};
  sched_setscheduler(0, SCHED_FIFO, &lowest);  // Where it may: above all that is not real-time.
  while (!stopping()) {
    try {
      line_->open();
      is_open_ = true;
      opened_ = asked_ = steady_clock::now();
      motion_.begin(0, line_->speed_source());
      given_.setZero();
      unanswered_ = 0;
      if (may_hold_force_) request_no_force();
      while (!stopping()) exchange();
      if (!given_.isZero()) send(std::nullopt);
    } catch (const std::exception& error) {
      fail(error.what());
    }
    is_open_ = false;
    line_->close();
    rest(kRetry);
  }
}

void ExchangeDevice::rest(duration<double> time) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, time, [this] { return stopping(); });
}

/// What holds a force must hear that it ends, whatever else is wrong.
void ExchangeDevice::fail(const std::string& text) {
  const std::string cause = shortened(text);
  told_ = kept(cause);
  const bool in_session = enabled_.exchange(false);
  state_.put({});  // Whoever enables now finds none.
  failures_.fetch_add(1, std::memory_order_release);
  try {
    if (is_open_ && !given_.isZero()) send(std::nullopt);
  } catch (const std::exception&) {
    line_->halt();  // It may have another way.
  }
  const std::lock_guard lock(mutex_);
  // A fault names it in a session.
  const bool is_news = is_open_ ? cause_.empty() : cause != refusal_;
  if (has_state_ && !in_session && is_news) spdlog::warn("{}: {}", name_, cause);
  if (!is_open_) refusal_ = cause;
  cause_ = cause;
  changed_.notify_all();
}

/// Waits until the next request must go out, or a force has to end.
void ExchangeDevice::pause() {
  const SteadyTime due = asked_ + period_;
  for (SteadyTime now = steady_clock::now(); now < due && !must_end(); now = steady_clock::now()) {
    std::this_thread::sleep_until(given_.isZero() ? due : std::min(due, now + kLook));
  }
}

bool ExchangeDevice::must_end() noexcept {
  return !given_.isZero() && wanted_force().value_or(Vector3::Zero()).isZero();
}

void ExchangeDevice::exchange() {
  pause();
  line_->expect_silence();
  send(wanted_force());
  while (unanswered_ > 0) await_reply();
}

/// The device may still hold the force that a lost line gave it: nothing is asked before that ends.
void ExchangeDevice::request_no_force() {
  send(std::nullopt);
  while (unanswered_ > 0) await_reply();
}

void ExchangeDevice::send(const std::optional<Vector3>& force) {
  const Vector3 given = force.value_or(Vector3::Zero());
  if (!given.isZero()) {
    given_ = given;
    may_hold_force_ = true;
  }
  line_->send(may_hold_force_ ? given : force);
  given_ = given;  // A request for zero that could not be sent ends nothing.
  (unanswered_++ == 0 ? asked_ : ended_) = steady_clock::now();
}

void ExchangeDevice::await_reply() {
  if (must_end()) send(std::nullopt);
  const SteadyTime now = steady_clock::now();
  if (const auto state = line_->receive(now + kLook)) {
    take(*state);
    if (--unanswered_ > 0) {
      asked_ = ended_;
    } else if (given_.isZero()) {
      may_hold_force_ = false;
    }
  } else if (now - asked_ > oldest_) {
    throw std::runtime_error("no reply for " + milliseconds(now - asked_));
  }
}

void ExchangeDevice::take(const HandleState& state) {
  const SteadyTime now = steady_clock::now();
  if (state.X.p.norm() > kFarthest) {
    throw std::runtime_error(
        fmt::format("its handle is {:.3g} m away, must be 0 to {} m", state.X.p.norm(), kFarthest));
  }
  const double time = duration<double>(now.time_since_epoch()).count();
  const double age = duration<double>(now - asked_).count();
  const Matrix3 R = state.X.R.toRotationMatrix();
  if (const char* const why = motion_.find_error(time, state.X.p, R, state.V, false, age)) {
    throw std::runtime_error(why);
  }
  state_.put({.handle = state, .asked = asked_});
  measure(now - asked_);
  observe(now);
}

/// Measures how late the replies in a session came; said when it is over.
void ExchangeDevice::measure(std::chrono::nanoseconds lateness) {
  if (enabled_) {
    ++replies_;
    lateness_ += lateness;
    worst_ = std::max(worst_, lateness);
  } else if (replies_ > 0) {
    spdlog::info("{}: {} replies, after {} on average, {} at most", name_, replies_,
                 milliseconds(lateness_ / replies_), milliseconds(worst_));
    replies_ = 0;
    lateness_ = worst_ = {};
  }
}

/// Once it has a state that `now` came, calibrate() goes on; a line that works again says so.
void ExchangeDevice::observe(SteadyTime now) {
  const bool is_back = !cause_.empty() && now - opened_ > kSteady;
  if (has_state_ && !is_back) return;
  const std::lock_guard lock(mutex_);
  if (is_back) {
    spdlog::info("{} is back", name_);
    if (const char* const warning = line_->warning_after_reopening(); *warning != '\0') {
      spdlog::warn("{}: {}", name_, warning);
    }
    cause_.clear();
    refusal_.clear();
  }
  has_state_ = true;
  changed_.notify_all();
}

/// A force that has not come too late; zero instead of one that has; empty: none is rendered.
std::optional<Vector3> ExchangeDevice::wanted_force() noexcept {
  if (!enabled_ || halted_ || stopping()) return std::nullopt;
  const TimedForce& newest = force_.get();
  const bool is_fresh = steady_clock::now() - newest.written <= oldest_;
  return is_fresh ? newest.force : Vector3(Vector3::Zero());
}

}  // namespace hlm::server
