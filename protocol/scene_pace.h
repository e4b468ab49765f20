// When a chunk of the scene stream counts as lost, and how many may be sent.
#pragma once

#include <cstddef>
#include <limits>
#include <optional>

namespace hlm::protocol {

/// Of one session. Nothing allocates, waits or throws. Times are in s, of any steady origin.
///
/// A chunk counts as lost when one that was sent more than 20 ms later has come (networks reorder),
/// or when nothing is said of it for some round trips. Then half as many are sent in each call, and
/// more again with time: all after kRecovery.
class ScenePace {
 public:
  /// From no chunks in a call to the whole budget, s. Shorter fills a narrow network with what it
  /// drops, longer leaves one with chance losses unused.
  static constexpr double kRecovery = 1;

  /// How many of `budget` chunks may be sent now: one at least, if the budget is not 0.
  std::size_t begin(double now, std::size_t budget) noexcept;
  /// A chunk has come for the first time whose latest sending was at `sent_at`.
  void arrived(double now, double sent_at, bool was_repeated) noexcept;
  /// Whether what was sent then and has not come is lost, because of what has come.
  bool is_overtaken(double sent_at) const noexcept;
  /// Whether it is lost because nothing was heard of it.
  bool is_late(double now, double sent_at) const noexcept { return now - sent_at >= timeout(); }
  /// Some was lost. `late`: nothing was heard of it.
  void lose(double now, bool late) noexcept;

  /// Smoothed time from sending a chunk to hearing that it has come, s; 0 before the first.
  double round_trip() const noexcept { return round_trip_.value_or(0); }

 private:
  void measure(double sample) noexcept;
  double timeout() const noexcept;

  std::optional<double> round_trip_;
  double variation_ = 0;  ///< Smoothed deviation from it, s.
  double least_ = 0;      ///< Shortest round trip, s.
  /// When the latest sent of those that have come was sent, s.
  double latest_ = -std::numeric_limits<double>::infinity();
  int timeouts_ = 0;                 ///< In a row.
  double share_ = 1;                 ///< Of the budget that may be sent.
  std::optional<double> begun_at_;   ///< Latest begin(), s.
  std::optional<double> slowed_at_;  ///< s.
};

}  // namespace hlm::protocol
