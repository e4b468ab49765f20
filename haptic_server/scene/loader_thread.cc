#include "hlm/haptic_server/scene/loader_thread.h"

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "hlm/common/range.h"
#include "hlm/geometry/interruption.h"

namespace hlm::server {
namespace {

using Clock = std::chrono::steady_clock;

/// How often the reading thread looks for chunks.
constexpr std::chrono::milliseconds kLooksEach{1};
/// Threads that were told to end and work on. With as many the next session waits for one: less
/// memory for who begins sessions quickly with scenes that take long.
constexpr std::size_t kMostLeft = 2;
/// How long the end waits for threads to end in order.
constexpr std::chrono::milliseconds kPatience{20};

/// Threads that make scenes.
std::atomic<int> makers = 0;

// Thrown by interruption_point().
struct Abandoned {};
struct TooLong {};

}  // namespace

/// A thread, what it makes, and for whom: it goes with the last of the two that know it.
class SceneLoaderThread::Bench {
 public:
  /// Throws std::system_error if there can be no thread.
  static std::shared_ptr<Bench> open(std::chrono::milliseconds longest) {
    auto bench = std::make_shared<Bench>(longest);
    ++makers;
    try {
      std::thread([bench]() mutable {
        bench->run();
        bench->ended_ = true;
        bench.reset();
        --makers;
      }).detach();
    } catch (...) {
      --makers;
      throw;
    }
    return bench;
  }

  explicit Bench(std::chrono::milliseconds longest) : longest_(longest) {}

  void give_up() {
    given_up_ = true;
    const std::scoped_lock lock(mutex_);
    changed_.notify_all();
  }
  bool has_ended() const { return ended_; }

  bool is_busy() {
    const std::scoped_lock lock(mutex_);
    return busy_;
  }
  void start(SceneOrder order) {
    const std::scoped_lock lock(mutex_);
    order_ = std::move(order);
    busy_ = true;
    changed_.notify_all();
  }
  /// Once.
  std::optional<SceneOutcome> outcome() {
    const std::scoped_lock lock(mutex_);
    if (!outcome_) return std::nullopt;
    busy_ = false;
    return std::exchange(outcome_, std::nullopt);
  }

 private:
  void run() {
    SceneMaker maker;
    try {
      while (const auto order = next()) {
        auto outcome = make(maker, *order);
        const std::scoped_lock lock(mutex_);
        outcome_ = std::move(outcome);
      }
    } catch (const Abandoned&) {
    }
  }

  std::optional<SceneOrder> next() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return order_ || given_up_; });
    if (given_up_) return std::nullopt;
    return std::exchange(order_, std::nullopt);
  }

  SceneOutcome make(SceneMaker& maker, const SceneOrder& order) {
    const Clock::time_point latest = Clock::now() + longest_;
    try {
      const geometry::Interruptible interruptible([&] {
        if (given_up_) throw Abandoned{};
        if (Clock::now() > latest) throw TooLong{};
      });
      return maker.make(order);
    } catch (const TooLong&) {
      const auto text = "its surfaces took more than " +
                        shortest_text(std::chrono::duration<double>(longest_).count()) +
                        " s to make: leave out what the tool cannot reach, or give shapes of fewer "
                        "pieces and corners";
      return {order.session, nullptr, protocol::SceneFault{protocol::SceneError::kLimit, 0, text}};
    }
  }

  const std::chrono::milliseconds longest_;
  std::atomic<bool> given_up_ = false;
  std::atomic<bool> ended_ = false;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool busy_ = false;  ///< From an order to its outcome, as who orders sees it.
  std::optional<SceneOrder> order_;
  std::optional<SceneOutcome> outcome_;
};

SceneLoaderThread::SceneLoaderThread(SceneLoader& loader, std::chrono::milliseconds longest_making)
    : loader_(loader),
      longest_making_(longest_making),
      thread_([this](const std::stop_token& stop) { run(stop); }) {}

SceneLoaderThread::~SceneLoaderThread() {
  thread_.request_stop();
  thread_.join();
  if (bench_) bench_->give_up();
  if (bench_) left_.push_back(std::move(bench_));
  const Clock::time_point latest = Clock::now() + kPatience;
  for (forget_ended(); !left_.empty() && Clock::now() < latest; forget_ended()) {
    std::this_thread::sleep_for(kLooksEach);
  }
}

bool SceneLoaderThread::leaves_any() noexcept { return makers > 0; }

void SceneLoaderThread::run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    work();
    std::this_thread::sleep_for(kLooksEach);
  }
}

void SceneLoaderThread::work() {
  loader_.read();
  forget_ended();
  if (bench_) {
    if (auto outcome = bench_->outcome()) loader_.finish(std::move(*outcome));
  }
  const bool is_new = std::exchange(session_, loader_.reads()) != loader_.reads();
  if (is_new || !bench_) change_bench();
  if (!bench_ || bench_->is_busy()) return;
  if (auto order = loader_.next_order()) bench_->start(std::move(*order));
}

/// Another session's scenes are made by a thread that is free.
void SceneLoaderThread::change_bench() {
  if (bench_ && !bench_->is_busy()) return;
  if (bench_) {
    bench_->give_up();
    left_.push_back(std::move(bench_));
    bench_.reset();
  }
  if (left_.size() >= kMostLeft) return;
  try {
    bench_ = Bench::open(longest_making_);
  } catch (const std::system_error&) {  // No thread now: at the next look.
  }
}

void SceneLoaderThread::forget_ended() {
  std::erase_if(left_, [](const auto& bench) { return bench->has_ended(); });
}

}  // namespace hlm::server
