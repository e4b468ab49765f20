// What is done with bodies that several tools push, each through a server of its own
// (docs/method.md 16).
#pragma once

#include <map>
#include <set>
#include <span>
#include <vector>

#include "hlm/common/contact.h"
#include "hlm/ve_client/world/world.h"

namespace hlm::ve {

/// The wrench of a tool on each body that it pushes, about the body's centre of mass, world axes.
using Pushes = std::map<int, Wrench>;

/// Each server moves a body by its own tool's impulses at once, and learns of the others' through
/// the environment, a loop later. So a body that several tools push resists acceleration more for
/// that time, in the world and in what the servers are given, and the others' wrenches reach a
/// server smoothly.
class SharedBodies {
 public:
  /// `world` outlives this.
  SharedBodies(World& world, std::size_t tools) : world_(world), of_tools_(tools) {}

  /// A frame of `period` seconds begins, in which each tool pushes so; `reported`: the bodies of
  /// reported to each tool's server. round_trip: the longest to a server, s, >= 0. several: whether
  /// more than one hand is there.
  void push(std::span<const Pushes> pushes, std::span<const MovableBodies> reported, double period,
            double round_trip, bool several);
  /// Adds what the other tools do to the bodies that are reported to a tool's server.
  void add_others(std::size_t tool, MovableBodies& bodies) const;

 private:
  /// What the other tools do to a body.
  struct Others {
    Wrench mean = Wrench::Zero();
    /// Velocity that they gave it in the world, and that its server is yet to learn.
    Twist unreported = Twist::Zero();
    double away = 0;  ///< Time since they pushed last, s.
  };
  using OthersOn = std::map<int, Others>;

  void estimate_loop(double period, double round_trip);
  std::set<int> moved(const Pushes& pushes, const MovableBodies& reported) const;
  void find_shared(std::span<const Pushes> pushes, std::span<const MovableBodies> reported);
  void add_inertia(double period, bool several);
  void learn(std::size_t tool, std::span<const Pushes> pushes, double period);

  World& world_;
  std::vector<OthersOn> of_tools_;
  double loop_ = 0;  ///< Mean way of an impulse from one server through a frame to another, s.
  std::map<int, double> added_;  ///< Mass that bodies have gained, kg.
  std::vector<int> now_;         ///< Those that are shared in this frame.
};

}  // namespace hlm::ve
