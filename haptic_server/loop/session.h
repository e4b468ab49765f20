// What the servo knows of the client's session: its steps, and how old its updates are.
#pragma once

#include <cstdint>
#include <optional>

#include "hlm/common/freedoms.h"
#include "hlm/protocol/messages.h"

namespace hlm::server {

/// Ages are counted in steps and told by the client, not read from clocks, so that a replay finds
/// the same.
class Session {
 public:
  /// dt: servo period, s.
  explicit Session(double dt) noexcept : dt_(dt) {}

  /// A session begins. missing: freedoms of its tool that the device lacks.
  void begin(const protocol::Hello& hello, Freedoms missing) noexcept;
  /// Periods go by.
  void advance(std::uint64_t periods) noexcept { step_ += periods; }
  /// An update came, whether it is adopted or not.
  void hear(const protocol::ContactUpdate& update) noexcept;
  /// The update was adopted.
  void adopted(const protocol::ContactUpdate& update) noexcept;

  /// A control is in effect with its stiffness lowered by such a share, as protocol::ProxyState
  /// says.
  void lower(double share) noexcept { lowered_ = share; }

  std::uint64_t step() const noexcept { return step_; }
  std::uint64_t updates() const noexcept { return updates_; }
  /// Of the client's frames, as its hello says, s.
  double period() const noexcept { return period_; }
  /// Step of the impulses in the state of the latest adopted update.
  double contained_impulses() const noexcept { return contained_impulses_; }
  Freedoms missing_freedoms() const noexcept { return missing_freedoms_; }
  double lowered() const noexcept { return lowered_; }

  /// The age of an update's contacts, s: what the environment says it took, and half the round
  /// trip.
  double age_of(const protocol::ContactUpdate& update) const noexcept;
  /// The age of the latest update that decides whether its contacts give force, s. Whatever a round
  /// trip is longer than the session's shortest may have been the update's way alone: a network
  /// that holds everything and then delivers it at once is no slower on the way back.
  double oldest() const noexcept { return oldest_; }

 private:
  std::optional<double> travel_of(const protocol::ContactUpdate& update) const noexcept;

  double dt_;
  double period_ = 0;
  std::uint64_t step_ = 0;                 ///< Periods of the session so far, missed ones, too.
  std::uint64_t updates_ = 0;              ///< Adopted in the session.
  std::optional<double> shortest_travel_;  ///< Round trip of the session, s.
  double oldest_ = 0;
  double contained_impulses_ = 0;
  double lowered_ = 0;
  Freedoms missing_freedoms_ = 0;
};

}  // namespace hlm::server
