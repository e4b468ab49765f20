// How much a search for contacts has done: counted, not timed, so that it ends in the same place on
// every machine, and in a replay.
#pragma once

#include <cstdint>
#include <limits>

namespace hlm::geometry {

/// What this thread has done, in units of about a nanosecond (haptic_server/scene/scene.cc), and
/// how much it may do. What computes adds to it; what may take long looks whether it is spent,
/// ends, and then gives no answer of use.
class Work {
 public:
  static void add(std::uint64_t units) noexcept { done_ += units; }
  static std::uint64_t done() noexcept { return done_; }
  static bool is_spent() noexcept { return done_ > limit_; }

  /// Allows so much more during its life, and never more than the one around it.
  class Allowance {
   public:
    explicit Allowance(std::uint64_t units) noexcept : before_(limit_) {
      const std::uint64_t room = std::numeric_limits<std::uint64_t>::max() - done_;
      const std::uint64_t limit = done_ + (units < room ? units : room);
      if (limit < limit_) limit_ = limit;
    }
    ~Allowance() { limit_ = before_; }
    Allowance(const Allowance&) = delete;
    Allowance& operator=(const Allowance&) = delete;

   private:
    std::uint64_t before_;
  };

 private:
  static inline thread_local std::uint64_t done_ = 0;
  static inline thread_local std::uint64_t limit_ = std::numeric_limits<std::uint64_t>::max();
};

}  // namespace hlm::geometry
