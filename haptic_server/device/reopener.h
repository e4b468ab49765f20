// Brings a device back that was lost, off the servo thread.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <thread>

namespace hlm::server {

/// While the device is there it belongs to the servo thread; from lose() on to this one's thread,
/// which tries to open it anew, without force, until that succeeds.
class Reopener {
 public:
  /// open: whether the device is open again, its motors off. Not from the servo thread.
  explicit Reopener(std::function<bool()> open)
      : open_(std::move(open)), thread_([this](const std::stop_token& stop) { run(stop); }) {}

  /// From the servo thread.
  bool is_there() const noexcept { return is_there_.load(std::memory_order_acquire); }
  /// From the servo thread, which uses the device no more until it is there again.
  void lose() noexcept { is_there_.store(false, std::memory_order_release); }

 private:
  /// Less loads a bus that has just failed, more keeps a person waiting.
  static constexpr int kLooksPerTry = 4;
  static constexpr std::chrono::milliseconds kLook{50};

  void run(const std::stop_token& stop) {
    for (int look = 0; !stop.stop_requested(); ++look) {
      std::this_thread::sleep_for(kLook);
      if (is_there() || look % kLooksPerTry != 0) continue;
      if (open_()) is_there_.store(true, std::memory_order_release);
    }
  }

  std::function<bool()> open_;
  std::atomic<bool> is_there_ = true;
  std::jthread thread_;
};

}  // namespace hlm::server
