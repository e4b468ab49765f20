// Brings a device back that was lost, off the servo thread.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <thread>
#include <utility>

namespace hlm::server {

/// While the device is there it belongs to the servo thread; from lose() on to this one's thread,
/// which closes it and tries to open it again, without force, until that succeeds.
class Reopener {
 public:
  /// reopen: closes what is open, at once, then opens it with its motors off; whether it did.
  explicit Reopener(std::function<bool()> reopen)
      : reopen_(std::move(reopen)), thread_([this](const std::stop_token& stop) { run(stop); }) {}
  ~Reopener() {
    thread_.request_stop();
    lose();
  }
  Reopener(const Reopener&) = delete;
  Reopener& operator=(const Reopener&) = delete;

  /// Whether the device is there, from the servo thread.
  bool is_there() const noexcept { return is_there_.load(std::memory_order_acquire); }
  /// Called by the servo thread, which uses the device no more until it is back. Never waits.
  void lose() noexcept {
    is_there_.store(false, std::memory_order_release);
    is_there_.notify_one();
  }

 private:
  /// Between two tries. Less loads a bus that has just failed, more keeps a person waiting.
  static constexpr std::chrono::milliseconds kPause{200};

  void run(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      is_there_.wait(true, std::memory_order_acquire);
      if (stop.stop_requested()) return;
      if (reopen_()) {
        is_there_.store(true, std::memory_order_release);
      } else {
        std::this_thread::sleep_for(kPause);
      }
    }
  }

  std::function<bool()> reopen_;
  std::atomic<bool> is_there_ = true;
  std::jthread thread_;
};

}  // namespace hlm::server
