// When the simulator applies the tool's impulses on movable bodies.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>

#include "hlm/protocol/messages.h"

namespace hlm {

using DueImpulses = StaticVector<protocol::BodyImpulse, kMaxBodies>;

/// The server reports totals at the steps in which it took updates. Applied as they arrive they
/// would come unevenly, two in one frame and none in the next, and a body on a table would hop: the
/// table stops it but does not pull it back. So they are played out at an even rate, about one
/// frame behind the latest: each frame gets as much of the server's time as it takes itself.
class ImpulsePlayout {
 public:
  /// A session begins; its totals begin at zero.
  void reset();
  /// The server is known to have come to this step of its loop.
  void hear(std::uint64_t step);
  void receive(const protocol::Impulses& totals);
  /// The environment's time stood still between the latest report and the next: what comes in
  /// between is left out, because bodies do not get what they had no time for.
  void skip();
  /// Steps of the server that were reported and not taken yet.
  double reported() const;
  /// A frame of this many steps of the server begins: returns its impulses. usual: steps of most
  /// frames, if this one may be much shorter.
  DueImpulses take(double steps, double usual = 0);

  /// Step of the server up to which reported impulses were taken; may lie between two steps.
  double step() const noexcept { return step_; }
  /// Sum of all impulses taken for a body.
  Vector6 taken(std::uint32_t body) const;

 private:
  using Totals = std::map<std::uint32_t, Vector6>;
  struct Report {
    double step = 0;
    Totals totals;
  };

  /// Steps of the server that are left out. Where begin equals end, their number is not known yet.
  struct Gap {
    double begin;
    double end;
  };

  void give(DueImpulses& due);
  double next_step(double steps, double frame);
  void advance_to(double step);
  /// What was reported up to step_.
  Totals totals() const;
  void forget_played();

  double newest_ = 0;
  double step_ = 0;
  std::deque<Report> reports_{Report{}};  ///< The last that was played out, and those after it.
  Totals taken_;
  bool idle_ = true;  ///< The latest report brought nothing new.
  std::optional<Gap> gap_;
};

}  // namespace hlm
