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
  protocol::Tuning tuning;  ///< Of the server.
};

/// Words of a page for the enumerations, in the order of their values.
inline constexpr std::array<const char*, 4> kUpdateRules{
    "retain", "paper", "intermediate_representation", "plane_recovery"};
inline constexpr std::array<const char*, 7> kControllers{
    "four_channel",     "three_channel",  "virtual_coupler", "direct",
    "rotation_coupler", "engine_coupler", "engine_force"};

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
    {"delay", 0, 0.5, "s", [](LiveSettings& s) -> double& { return s.network.delay; }},
    {"jitter", 0, 0.2, "s", [](LiveSettings& s) -> double& { return s.network.jitter; }},
    {"loss", 0, 0.9, "", [](LiveSettings& s) -> double& { return s.network.loss; }},
}};

}  // namespace hlm::ve
