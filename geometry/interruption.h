// Lets somebody else end work that takes long.
#pragma once

#include <functional>
#include <utility>

namespace hlm::geometry {

/// While one lives, interruption_point() asks it in the thread that made it: it throws to end the
/// work there. What it throws should be no std::exception, which is taken for a fault of the shape.
class Interruptible {
 public:
  explicit Interruptible(std::function<void()> ask)
      : ask_(std::move(ask)), before_(std::exchange(present_, this)) {}
  ~Interruptible() { present_ = before_; }
  Interruptible(const Interruptible&) = delete;
  Interruptible& operator=(const Interruptible&) = delete;

 private:
  friend void interruption_point();

  std::function<void()> ask_;
  Interruptible* before_;
  inline static thread_local Interruptible* present_ = nullptr;
};

/// In loops that make shapes, surfaces and scenes, at least each millisecond; never in the tick.
inline void interruption_point() {
  if (Interruptible::present_ != nullptr) Interruptible::present_->ask_();
}

}  // namespace hlm::geometry
