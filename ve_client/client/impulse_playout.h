// When the simulator applies the tool's impulses on movable bodies.
#pragma once

#include <cstdint>
#include <deque>
#include <map>

#include "protocol/messages.h"

namespace hlm {

using DueImpulses = StaticVector<protocol::BodyImpulse, kMaxBodies>;

/// The server reports totals, at the steps in which it took updates. Applied as they arrive they
/// would come in uneven portions: two in one frame and none in the next, and a body on a table
/// would hop, as the table stops it and does not pull it back. So they are played out at an even
/// rate, as much of the server's time in a frame as the frame takes, about a frame behind the
/// newest.
class ImpulsePlayout {
 public:
  /// A session begins, and with it the totals.
  void reset();
  /// The server is known to have come to this step of its loop.
  void hear(std::uint64_t step);
  void receive(const protocol::Impulses& totals);
  /// A frame of so many steps of the server begins: what is due in it.
  DueImpulses take(double steps);

  /// Step of the server up to which impulses were taken, as far as they were reported; may lie
  /// between two.
  double step() const noexcept { return step_; }
  /// Sum of all that was taken for a body.
  Vector6 taken(std::uint32_t body) const;

 private:
  using Totals = std::map<std::uint32_t, Vector6>;
  struct Report {
    double step = 0;
    Totals totals;
  };

  void advance(double steps);
  void forget_played();

  double newest_ = 0;
  double step_ = 0;
  std::deque<Report> reports_{Report{}};  ///< The last that was played out, and those after it.
  Totals taken_;
  bool idle_ = true;  ///< The latest report brought nothing new.
};

}  // namespace hlm
