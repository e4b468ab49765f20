// What a page can change while the client runs, and within which bounds.
#pragma once

#include <array>

#include "protocol/messages.h"
#include "ve_client/client/impaired_link.h"
#include "ve_client/frame.h"

namespace hlm::ve {

struct LiveSettings {
  FrameOptions frame;
  double rate = 60;  ///< Hz.
  NetworkConditions network;
  Tuning tuning;  ///< Of the server.
};

/// What was changed of one server's own tuning, changed of another's.
inline Tuning carried_over(const Tuning& changed, const Tuning& from, const Tuning& to) {
  Tuning tuning = to;
  const auto carry = [&](auto member) {
    if (changed.*member != from.*member) tuning.*member = changed.*member;
  };
  carry(&Tuning::update_rule);
  carry(&Tuning::controller);
  for (const TuningRange& range : kTuningRanges) carry(range.number);
  return tuning;
}

/// A number of the environment that pages may set.
struct EnvironmentRange {
  const char* name;
  double least;
  double most;
  const char* unit;
  double& (*number)(LiveSettings&);
};
inline constexpr std::array<EnvironmentRange, 6> kEnvironmentRanges{{
    {"epsilon", 0, 0.1, "m", [](LiveSettings& s) -> double& { return s.frame.epsilon; }},
    {"largest_epsilon", 0, 0.1, "m",
     [](LiveSettings& s) -> double& { return s.frame.largest_epsilon; }},
    {"rate", 5, 200, "Hz", [](LiveSettings& s) -> double& { return s.rate; }},
    {"delay", 0, kLongestDelay, "s", [](LiveSettings& s) -> double& { return s.network.delay; }},
    {"jitter", 0, kLongestJitter, "s", [](LiveSettings& s) -> double& { return s.network.jitter; }},
    {"loss", 0, kLargestLoss, "", [](LiveSettings& s) -> double& { return s.network.loss; }},
}};

}  // namespace hlm::ve
