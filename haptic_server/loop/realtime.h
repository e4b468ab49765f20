// Which real-time rights the servo thread gets, and what happens without them.
#pragma once

#include <optional>
#include <string>

#include "hlm/common/range.h"
#include "hlm/common/vocabulary.h"

namespace hlm::server {

enum class RealtimePolicy {
  kRequire,  ///< Refuse to start without the rights.
  kPrefer,   ///< Take what the system grants and report what is missing.
  kOff,      ///< An ordinary thread. For development only: lateness reaches milliseconds.
};

}  // namespace hlm::server

namespace hlm {

template <>
inline constexpr std::array<Word<server::RealtimePolicy>, 3> kWords<server::RealtimePolicy>{{
    {server::RealtimePolicy::kRequire, "require", "refuse to start without the rights"},
    {server::RealtimePolicy::kPrefer, "prefer", "take what is granted and say what is missing"},
    {server::RealtimePolicy::kOff, "off", "an ordinary thread"},
}};

}  // namespace hlm

namespace hlm::server {

struct RealtimeOptions {
  RealtimePolicy policy = RealtimePolicy::kPrefer;
  /// SCHED_FIFO priority, 1 to 99. Above those of the machine's network interrupts (50) they wait
  /// for the tick; above 98 it competes with the kernel's own watchdogs.
  int priority = 40;
};

inline constexpr Range kPriorities{1, 99};

/// Why options cannot be used, naming the option, its value and its range; empty if valid.
std::optional<std::string> find_error(const RealtimeOptions& options);

struct RealtimeGrant {
  bool fifo = false;           ///< The thread runs under SCHED_FIFO.
  bool locked_memory = false;  ///< All memory of the process stays in RAM.
  /// One line on what was asked for and refused, and how to get it; empty if nothing was.
  std::string warning;
};

/// Makes the calling thread real-time: SCHED_FIFO (threads it starts are ordinary again), the
/// process' present memory locked and the stack's next pages in RAM, wake-ups not coalesced. To be
/// called when everything has been allocated. Throws std::runtime_error if the policy requires what
/// the system refuses.
RealtimeGrant enter_realtime(const RealtimeOptions& options);

}  // namespace hlm::server
