// The client's frame: what the virtual environment does 30 to 60 times a second.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "hlm/client/haptic_client.h"
#include "hlm/geometry/select.h"
#include "hlm/geometry/skin_contacts.h"
#include "hlm/page/frame_options.h"
#include "hlm/ve_client/run/clock.h"
#include "hlm/ve_client/run/shared_bodies.h"
#include "hlm/ve_client/run/world_pace.h"
#include "hlm/ve_client/world/proximity.h"
#include "hlm/ve_client/world/surroundings.h"
#include "hlm/ve_client/world/virtual_tool.h"
#include "hlm/ve_client/world/world.h"

namespace hlm::ve {

/// A virtual tool in a world, and the queries for what it touches.
struct HeldTool {
  HeldTool(World& world, ToolAssembly assembled, const FollowOptions& follow);

  ToolAssembly assembly;
  VirtualTool tool;
  Proximity proximity;
  SkinContacts skin_contacts;
  Surroundings surroundings;
  ContactSelection selection;
};

/// A world and the tools in it, each of which somebody may hold. Tools do not touch each other.
struct VirtualEnvironment {
  /// tool_names: models, one at least, each once. Throws std::runtime_error as assemble_tool()
  /// does.
  VirtualEnvironment(const WorldDescription& description,
                     const std::vector<std::string>& tool_names, const FollowOptions& follow);

  World world;
  std::deque<HeldTool> tools;
  SharedBodies shared;
  WorldPace pace;
  /// Mean wrench of FrameOptions::pull on its body during the latest step, N and N·m about the
  /// body's centre of mass, world axes.
  Wrench pulled = Wrench::Zero();

 private:
  VirtualEnvironment(const WorldDescription& description, std::vector<ToolAssembly> assemblies,
                     const FollowOptions& follow);
};

/// What a frame brought, for the caller to report.
struct FrameResult {
  HapticClient::Inbox inbox;  ///< `state` is valid until the next frame.
  /// The proxy state could not be followed (VirtualTool::can_follow), or an impulse was on a body
  /// that there is not.
  bool state_refused = false;
  /// Why the world stands still (World::fault); nothing is sent any more, so force fades. Null as
  /// long as it moves.
  const std::string* fault = nullptr;
  std::size_t found = 0;      ///< Contacts of the tool within ε, before any was left out.
  std::size_t active = 0;     ///< Of these with σ <= 0.
  std::size_t predicted = 0;  ///< Of these with σ > 0.
  std::size_t bodies = 0;     ///< Movable bodies sent.
  std::size_t supports = 0;   ///< Contacts sent of bodies without the tool.
  double epsilon = 0;         ///< ε of this frame, m.
};

/// One frame of `period` seconds of the hand's time, with a client for each tool, in their order.
/// The clients' links and `clock` decide whether it runs on UDP and real time or in memory and
/// virtual time. What the frame brought for each tool.
std::vector<FrameResult> run_frame(VirtualEnvironment& environment,
                                   std::span<HapticClient* const> clients, Clock& clock,
                                   double period, const FrameOptions& options);

/// Periods of frames: rates drawn uniformly, repeatable from a seed.
class FramePeriods {
 public:
  /// Rates in [low, high], Hz, 0 < low <= high; low = high gives a fixed rate.
  FramePeriods(double low, double high, std::uint64_t seed)
      : low_(low), high_(high), engine_(seed) {}

  /// s.
  double next();

 private:
  double low_;
  double high_;
  std::mt19937_64 engine_;
};

}  // namespace hlm::ve
