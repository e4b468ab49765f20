#include "hlm/client/impulse_playout.h"

#include <algorithm>

namespace hlm {
namespace {

/// How far behind the latest report a frame ends, frames. Less runs dry when a datagram is late.
constexpr double kLag = 1;
/// Farther behind than this, frames, what has gathered is skipped to.
constexpr double kLargestLag = 4;
/// What is no deviation from that distance but jitter, frames: a report that comes just before or
/// just after a frame begins.
constexpr double kJitter = 1;
/// How much faster or slower than the server's time the playout may run to keep its distance. More
/// is felt as a change of the impulses' force against the bodies' weight.
constexpr double kLargestSkew = 0.02;
/// Share of the deviation from the distance that one frame takes back.
constexpr double kGain = 0.1;

Vector6 total(const std::map<std::uint32_t, Vector6>& totals, std::uint32_t body) {
  const auto found = totals.find(body);
  return found != totals.end() ? found->second : Vector6(Vector6::Zero());
}

}  // namespace

void ImpulsePlayout::reset() { *this = {}; }

void ImpulsePlayout::hear(std::uint64_t step) {
  newest_ = std::max(newest_, static_cast<double>(step));
  if (gap_ && gap_->end == gap_->begin) gap_->end = newest_;
}

void ImpulsePlayout::receive(const protocol::Impulses& impulses) {
  hear(impulses.step);
  const auto step = static_cast<double>(impulses.step);
  if (step <= reports_.back().step) return;
  Report report{step, reports_.back().totals};
  for (const auto& [body, P_W] : impulses.bodies) report.totals[body] = P_W;
  idle_ = report.totals == reports_.back().totals;
  reports_.push_back(std::move(report));
}

DueImpulses ImpulsePlayout::take(double steps, double usual) {
  if (!(steps > 0)) return {};
  DueImpulses due;
  double step = next_step(steps, std::max(steps, usual));
  if (gap_ && gap_->end > gap_->begin && step >= gap_->begin) {
    advance_to(gap_->begin);
    give(due);
    const double length = gap_->end - gap_->begin;
    advance_to(step_ + length);
    for (const auto& [body, P] : totals()) taken_[body] = P;
    step += length;
    gap_.reset();
  }
  advance_to(step);
  give(due);
  return due;
}

void ImpulsePlayout::skip() {
  if (!gap_) gap_ = Gap{newest_, newest_};
}

double ImpulsePlayout::reported() const {
  const double left_out = gap_ ? gap_->end - gap_->begin : 0;
  return newest_ - left_out - step_;
}

/// Adds what bodies get up to step_.
void ImpulsePlayout::give(DueImpulses& due) {
  for (const auto& [body, P] : totals()) {
    Vector6& taken = taken_.try_emplace(body, Vector6::Zero()).first->second;
    if (P == taken) continue;
    auto item = std::ranges::find(due, body, &protocol::BodyImpulse::body);
    if (item == due.end()) {
      if (due.size() == due.capacity()) break;
      due.push_back({body, Vector6::Zero()});
      item = due.end() - 1;
    }
    item->P_W += P - taken;
    taken = P;
  }
}

ImpulsePlayout::Totals ImpulsePlayout::totals() const {
  const Report& before = reports_.front();
  const Report& after = reports_.size() > 1 ? reports_[1] : before;
  const double span = after.step - before.step;
  const double part = span > 0 ? std::clamp((step_ - before.step) / span, 0.0, 1.0) : 1;
  Totals totals;
  for (const auto& [body, P_W] : after.totals) {
    // For a body's first impulse, the report before, which may be long ago, says nothing.
    const auto known = before.totals.find(body);
    totals[body] =
        known != before.totals.end() ? Vector6(known->second + part * (P_W - known->second)) : P_W;
  }
  return totals;
}

Vector6 ImpulsePlayout::taken(std::uint32_t body) const { return total(taken_, body); }

/// frame: what distances are measured in, steps.
double ImpulsePlayout::next_step(double steps, double frame) {
  const double behind = (reported() - steps) / frame - kLag;
  const double astray = behind - std::clamp(behind, -kJitter, kJitter);
  double step = step_ + steps * (1 + std::clamp(kGain * astray, -kLargestSkew, kLargestSkew));
  const bool nothing_due = idle_ && reports_.back().totals == taken_;
  if (nothing_due || behind > kLargestLag) {
    step = newest_ - kLag * frame;
    gap_.reset();
  }
  return std::clamp(step, step_, std::max(step_, step_ + reported() + kLargestLag * frame));
}

void ImpulsePlayout::advance_to(double step) {
  step_ = std::max(step_, step);
  forget_played();
}

/// Keeps the latest report that step_ has passed, and those after it.
void ImpulsePlayout::forget_played() {
  while (reports_.size() > 1 && reports_[1].step <= step_) reports_.pop_front();
}

}  // namespace hlm
