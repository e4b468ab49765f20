#include "hlm/haptic_server/device/hand.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>
#include <utility>

#include "hlm/haptic_server/device/saturate.h"

namespace hlm::server {
namespace {

/// Where a minimum-jerk motion from 0 to 1 is at the fraction `time` of its duration.
struct Progress {
  double fraction;  ///< Progress, in [0, 1].
  double rate;      ///< Derivative of the fraction by `time`.
};

Progress minimum_jerk(double time) noexcept {
  if (time >= 1) return {1, 0};
  const double square = time * time;
  return {square * time * (10 - 15 * time + 6 * square), 30 * square * (1 - time) * (1 - time)};
}

Wrench push_wrench(const Push& push, double t) noexcept {
  return push.constant +
         push.amplitude * std::sin(2 * std::numbers::pi * push.frequency * t + push.phase);
}

Pose target(const Reach& reach, const Pose& X_WStart, const Pose& X_WFrom) noexcept {
  const Pose origin = reach.relative ? X_WStart : Pose{};
  Pose X_WTo = X_WFrom;
  if (reach.position) X_WTo.p = origin.p + *reach.position;
  if (reach.rotation) X_WTo.R = rotation_from_vector(*reach.rotation) * origin.R;
  return X_WTo;
}

}  // namespace

Wrench grip_wrench(const Grip& grip, const Vector6& e, const Twist& e_dot) noexcept {
  const Vector3 force = grip.stiffness * e.head<3>() + grip.damping * e_dot.head<3>();
  const Vector3 torque =
      grip.angular_stiffness * e.tail<3>() + grip.angular_damping * e_dot.tail<3>();
  Wrench F;
  F << force, torque;
  return saturated(F, grip.max_force, grip.max_torque);
}

Hand::Hand(HandScript script) : script_(std::move(script)) {
  for ([[maybe_unused]] const HandSegment& segment : script_.segments) assert(segment.duration > 0);
}

void Hand::start(const Pose& X_WD) noexcept {
  X_WStart_ = X_WD;
  segment_begin_ = 0;
  // No reach came before the first segment: its target starts where the handle is.
  segment_ = script_.segments.size();
  opening_from_ = opening_to_ = {};
  const auto has_one = [](const HandSegment& segment) { return segment.opening.has_value(); };
  const auto first = std::ranges::find_if(script_.segments, has_one);
  if (first != script_.segments.end()) opening_to_ = first->opening;
  if (!script_.segments.empty()) enter(0, X_WD);
}

void Hand::advance(double t, const Pose& X_WD) noexcept {
  while (!released()) {
    const double end = segment_begin_ + script_.segments[segment_].duration;
    if (t < end) return;
    const bool last = segment_ + 1 == script_.segments.size();
    if (last && script_.after == AfterLastSegment::kHold) return;
    segment_begin_ = end;
    enter(last && script_.after == AfterLastSegment::kRepeat ? 0 : segment_ + 1, X_WD);
  }
}

void Hand::enter(std::size_t segment, const Pose& X_WD) noexcept {
  const bool reached =
      !released() && std::holds_alternative<Reach>(script_.segments[segment_].action);
  X_WFrom_ = reached ? X_WTo_ : X_WD;
  segment_ = segment;
  opening_from_ = opening_to_;
  if (released()) return;
  if (script_.segments[segment_].opening) opening_to_ = script_.segments[segment_].opening;
  if (const auto* reach = std::get_if<Reach>(&script_.segments[segment_].action)) {
    X_WTo_ = target(*reach, X_WStart_, X_WFrom_);
  }
}

std::optional<double> Hand::opening(double t) const noexcept {
  if (!opening_to_ || released()) return opening_to_;
  const double time = (t - segment_begin_) / script_.segments[segment_].duration;
  return *opening_from_ + minimum_jerk(time).fraction * (*opening_to_ - *opening_from_);
}

Wrench Hand::wrench(double t, const Pose& X_WD, const Twist& V_WD) const noexcept {
  if (released()) return Wrench::Zero();
  const HandSegment& segment = script_.segments[segment_];
  if (const auto* push = std::get_if<Push>(&segment.action)) {
    return push_wrench(*push, t - segment_begin_);
  }
  const Progress progress = minimum_jerk((t - segment_begin_) / segment.duration);
  const Vector6 path = displacement(X_WFrom_, X_WTo_);
  const Pose X_WTarget{X_WFrom_.p + progress.fraction * path.head<3>(),
                       rotation_from_vector(progress.fraction * path.tail<3>()) * X_WFrom_.R};
  const Twist V_WTarget = (progress.rate / segment.duration) * path;
  return grip_wrench(std::get<Reach>(segment.action).grip, displacement(X_WD, X_WTarget),
                     V_WTarget - V_WD);
}

}  // namespace hlm::server
