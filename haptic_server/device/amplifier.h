// The motor amplifier of a simulated device.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "hlm/common/spatial.h"

namespace hlm::server {

/// Holds the latest wrench that it was given, also when the process that gave it is gone, as a real
/// amplifier without a watchdog does: it is memory that forked processes share, and, if it has a
/// file, everybody who maps that. All but construction is async-signal-safe.
class Amplifier {
 public:
  /// What the file holds: native byte order.
  struct Memory {
    std::array<std::atomic<double>, 6> F{};   ///< Given to the motors, N and N·m, world axes.
    std::atomic<std::uint64_t> commands = 0;  ///< Wrenches given since it was switched on.
    std::atomic<std::uint64_t> halted = 0;    ///< 1 from halt() to resume().
  };
  static_assert(std::atomic<double>::is_always_lock_free);

  /// `file` is replaced; empty: none. Throws std::runtime_error naming it if it cannot be mapped.
  explicit Amplifier(const std::string& file);

  /// Returns what the motors give: zero while halted. A halt from another process just now may be
  /// overwritten; it comes again when this process is gone.
  Wrench give(const Wrench& F) noexcept;
  void halt() noexcept;
  void resume() noexcept { memory_->halted = 0; }

 private:
  struct Unmap {
    void operator()(Memory* memory) const noexcept;
  };

  std::unique_ptr<Memory, Unmap> memory_;
};

}  // namespace hlm::server
