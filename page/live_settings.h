// What a page can change while the client runs, and within which bounds.
#pragma once

#include <array>

#include "hlm/page/frame_options.h"
#include "hlm/protocol/messages.h"
#include "hlm/protocol/transport/impaired_link.h"

namespace hlm::ve {

struct LiveSettings {
  FrameOptions frame;
  double rate = 60;  ///< Hz.
  NetworkConditions network;
  Tuning tuning;  ///< Tuning of the server.
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
struct EnvironmentRange : Range {
  const char* name;
  double& (*number)(LiveSettings&);
};
inline constexpr std::array<EnvironmentRange, 7> kEnvironmentRanges{{
    {kEpsilons, "epsilon", [](LiveSettings& s) -> double& { return s.frame.epsilon; }},
    {{5, 200, "Hz"}, "rate", [](LiveSettings& s) -> double& { return s.rate; }},
    {{0, kLongestDelay, "s"}, "delay", [](LiveSettings& s) -> double& { return s.network.delay; }},
    {{0, kLongestJitter, "s"},
     "jitter",
     [](LiveSettings& s) -> double& { return s.network.jitter; }},
    {{0, 1}, "opening", [](LiveSettings& s) -> double& { return s.frame.opening; }},
    {{0, 1}, "pace", [](LiveSettings& s) -> double& { return s.frame.pace; }},
    {{0, kLargestLoss}, "loss", [](LiveSettings& s) -> double& { return s.network.loss; }},
}};

}  // namespace hlm::ve
