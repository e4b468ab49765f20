// What the tool has done to movable bodies since the session began, and when: the environment moves
// its bodies by the totals, and an update is brought to the present by what came after it
// (docs/method.md 11).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "hlm/common/spatial.h"
#include "hlm/common/static_vector.h"
#include "hlm/haptic_server/local_model/local_body.h"

namespace hlm::server {

/// Impulses are those of the tool on a body about its centre of mass, world axes, N·s and N·m·s.
/// Bodies are named by the slot that they were given. An environment that falls silent has no time
/// for its bodies: its silence is left out of `world steps`, and so is what came after the latest
/// report before it.
class BodyImpulses {
 public:
  /// Bodies that the tool may touch in one session; others are moving constraints to it.
  static constexpr std::size_t kMaxTouched = 1024;
  /// Steps that are remembered: longer than the loop from an impulse to the update that contains
  /// it.
  static constexpr std::uint64_t kHistory = 2048;

  struct Total {
    std::uint32_t body = 0;  ///< The environment's number for it.
    Vector6 P_W = Vector6::Zero();
    std::uint64_t last_step = 0;  ///< Step in which it changed last; 0: never.
    Vector6 reported_W = Vector6::Zero();
  };

  using Slots = StaticVector<std::size_t, kMaxBodiesAhead>;

  /// The slot of a body, the same for the whole session. Empty if there is no room for another.
  std::optional<std::size_t> enrol(std::uint32_t body) noexcept;
  /// Adds an impulse in the step that has begun, for at most kMaxBodiesAhead bodies in a step.
  void add(std::size_t slot, const Vector6& P_W) noexcept;
  void end_step() noexcept;
  /// `steps` steps like the latest one pass.
  void repeat(std::uint64_t steps) noexcept;

  /// The totals are reported to the environment, which plays out at an even rate what came since
  /// the report before: between() tells it so of these bodies from here on.
  void report(const Slots& evenly = {}) noexcept;
  void begin_silence() noexcept;
  void end_silence() noexcept { silent_ = false; }

  /// An update is about bodies in this world step, which may lie between two. Returns that of the
  /// update before.
  double adopt(double world_step) noexcept { return std::exchange(adopted_, world_step); }

  /// Steps that have ended.
  std::uint64_t step() const noexcept { return step_ + left_out_; }
  /// The same in world steps.
  std::uint64_t world_step() const noexcept { return step_; }
  /// A step in world steps; may lie between two.
  double world_step(double step) const noexcept;
  /// What the environment gives the body in the world steps (from, to], as far as they are
  /// remembered.
  Vector6 between(std::size_t slot, std::uint64_t from, std::uint64_t to) const noexcept;
  /// First world step from which between() is complete.
  std::uint64_t oldest() const noexcept { return step_ < kHistory ? 0 : step_ - kHistory + 1; }
  /// Total since the session began.
  const Vector6& total(std::size_t slot) const noexcept { return totals_[slot].P_W; }

  using Totals = StaticVector<Total, kMaxTouched>;
  /// The totals by slot.
  const Totals& totals() const noexcept { return totals_; }

 private:
  struct Impulse {
    std::size_t slot;
    Vector6 P_W;
  };
  using Step = StaticVector<Impulse, kMaxBodiesAhead>;
  void even_out(const Slots& slots) noexcept;
  Step& at(std::uint64_t step) noexcept { return history_[step % kHistory]; }
  const Step& at(std::uint64_t step) const noexcept { return history_[step % kHistory]; }

  std::uint64_t step_ = 0;             ///< World step.
  std::uint64_t reported_ = 0;         ///< World step of the latest report.
  std::uint64_t left_out_ = 0;         ///< Steps that are no world steps,
  std::uint64_t left_out_before_ = 0;  ///< and those of them before the latest silence,
  std::uint64_t silence_ = 0;          ///< which began at this world step.
  bool silent_ = false;
  double adopted_ = 0;
  std::array<Step, kHistory> history_;  ///< The step that has begun is step_ + 1.
  Totals totals_;
};

}  // namespace hlm::server
