#include "hlm/protocol/scene_pace.h"

#include <algorithm>
#include <cmath>

namespace hlm::protocol {
namespace {

/// Nothing is sent again sooner, s: a server answers once in a frame of the client.
constexpr double kShortestTimeout = 0.02;
/// Before the first measurement, s: a far network must not be filled with copies.
constexpr double kFirstTimeout = 3;
constexpr double kLongestTimeout = 4;  ///< After several in a row, s.
/// Chunks overtake each other by no more than this, s. Less sends again what is only late, more
/// finds out later what is lost.
constexpr double kReordering = 0.02;
/// Losses within a round trip, and within this time, s, have one cause.
constexpr double kOneLoss = 0.1;

}  // namespace

std::size_t ScenePace::begin(double now, std::size_t budget) noexcept {
  if (begun_at_) share_ += std::max(0.0, now - *begun_at_) / kRecovery;
  share_ = std::min(share_, 1.0);
  begun_at_ = now;
  const auto allowed = static_cast<std::size_t>(share_ * static_cast<double>(budget));
  return std::min(budget, std::max<std::size_t>(allowed, 1));
}

void ScenePace::arrived(double now, double sent_at, bool was_repeated) noexcept {
  timeouts_ = 0;
  const double since = now - sent_at;
  // Which of several copies has come is not known; not the last one if too little time has passed.
  if (was_repeated && since < least_) return;
  if (!was_repeated && sent_at > latest_) measure(since);
  latest_ = std::max(latest_, sent_at);
}

bool ScenePace::is_overtaken(double sent_at) const noexcept {
  return sent_at + kReordering < latest_;
}

void ScenePace::lose(double now, bool late) noexcept {
  if (late) ++timeouts_;
  if (slowed_at_ && now - *slowed_at_ < std::max(round_trip(), kOneLoss)) return;
  slowed_at_ = now;
  share_ /= 2;
}

/// As TCP smooths its round trip (RFC 6298).
void ScenePace::measure(double sample) noexcept {
  if (!round_trip_) {
    round_trip_ = least_ = sample;
    variation_ = sample / 2;
    return;
  }
  variation_ += (std::abs(sample - *round_trip_) - variation_) / 4;
  *round_trip_ += (sample - *round_trip_) / 8;
  least_ = std::min(least_, sample);
}

double ScenePace::timeout() const noexcept {
  const double once = round_trip_ ? 1.25 * *round_trip_ + 4 * variation_ : kFirstTimeout;
  const double least = std::max(once, kShortestTimeout);
  return std::max(least, std::min(kLongestTimeout, std::ldexp(least, timeouts_)));
}

}  // namespace hlm::protocol
