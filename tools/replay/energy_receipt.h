// What a session's device port gave and took, update by update, from wrenches and poses alone.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <optional>
#include <string>

#include "hlm/haptic_server/report/tick_record.h"

namespace hlm::server {

/// Adds up F · Δx of the wrench commanded in one tick and the handle's way to the next; it does not
/// read the ledger that the server keeps (docs/method.md 13).
class EnergyReceipt {
 public:
  /// Writes a CSV: a line for each update that was adopted, with what passed the port since the one
  /// before. `out` must outlive this.
  explicit EnergyReceipt(std::ostream& out);

  /// Every tick of a session, in order.
  void observe(const TickRecord& record);
  /// The total in a sentence, with its end.
  std::string total() const;
  /// Largest difference of the sums from the server's own ledger, J.
  double largest_difference() const noexcept { return largest_difference_; }

 private:
  struct Sums {
    double given = 0;  ///< J.
    double taken = 0;  ///< J.
  };

  std::ostream& out_;
  std::optional<TickRecord> before_;
  Sums all_;
  Sums since_update_;
  double explained_ = 0;    ///< J, at the latest update.
  double largest_net_ = 0;  ///< Largest given - taken - explained, above its least value before, J.
  double least_net_ = 0;    ///< J.
  std::optional<double> begin_;  ///< Time of the first step, s.
  double closest_ = 0;           ///< Largest given - taken - power · t, J.
  double largest_difference_ = 0;
};

}  // namespace hlm::server
