// Datagrams under way: each must come out at its own time.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "hlm/protocol/datagram_link.h"

namespace hlm::protocol {

/// The datagrams in the order of their times, and of arrival where these are equal.
class DatagramQueue {
 public:
  /// Room for this many without allocation.
  void reserve(std::size_t count) { waiting_.reserve(count); }

  void hold(double due, const Datagram& datagram) {
    const auto later =
        std::upper_bound(waiting_.begin(), waiting_.end(), due,
                         [](double time, const Waiting& other) { return time < other.due; });
    waiting_.insert(later, Waiting{due, datagram});
  }

  /// Whether one must come out at `now` (s, on the clock of the times held).
  bool has_due(double now) const noexcept {
    return !waiting_.empty() && waiting_.front().due <= now;
  }

  /// Puts the first that must come out into `datagram`; false if there is none.
  bool take(double now, Datagram& datagram) noexcept {
    if (!has_due(now)) return false;
    datagram = waiting_.front().datagram;
    datagram.waited = now - waiting_.front().due;
    waiting_.erase(waiting_.begin());
    return true;
  }

 private:
  struct Waiting {
    double due = 0;  ///< s.
    Datagram datagram;
  };
  std::vector<Waiting> waiting_;
};

}  // namespace hlm::protocol
