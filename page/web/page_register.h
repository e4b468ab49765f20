// What the thread of the page server and its callers share: which pages are open, and their
// requests.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace hlm::ve {

/// A message from a page, or the notice that it closed (then without text).
struct PageRequest {
  std::uint64_t page = 0;
  std::string text;
  bool closed = false;
};

/// Open pages and their requests, at most kMaxRequests and one notice for each page. Thread-safe;
/// its lock is held briefly.
class PageRegister {
 public:
  /// Messages kept until they are taken. A caller that takes them 30 times a second gets up to 7680
  /// a second, far more than pages send. More gives a caller that was blocked older messages; less
  /// loses messages when it is blocked briefly.
  static constexpr std::size_t kMaxRequests = 256;

  void open(std::uint64_t page);
  /// Adds the notice, always; none for a page that is not open.
  void close(std::uint64_t page);
  /// Adds a message; counts it as dropped if there are kMaxRequests.
  void add(std::uint64_t page, std::string text);
  /// Whether a message would be dropped.
  bool full() const;
  /// All that was added since the last call, in order.
  std::vector<PageRequest> take();
  std::uint64_t dropped() const;

  std::size_t pages() const;
  /// Ignored for a page that is not open.
  void set_telemetry(std::uint64_t page, bool on);
  bool telemetry(std::uint64_t page) const;
  bool telemetry_wanted() const;

 private:
  mutable std::mutex mutex_;
  std::map<std::uint64_t, bool> open_;  ///< Pages by number: whether telemetry is on.
  std::vector<PageRequest> requests_;
  std::uint64_t dropped_ = 0;
};

}  // namespace hlm::ve
