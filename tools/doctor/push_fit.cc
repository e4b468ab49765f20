#include "hlm/tools/doctor/push_fit.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/QR>

namespace hlm::server {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kLongestDelay = 0.06;  // s.
constexpr double kDelayStep = 0.25e-3;  // s.
constexpr double kLeastFitWay = 1e-4;   // m.
/// A handle slower than this share of its fastest, after that, counts as at rest.
constexpr double kRestShare = 0.1;
constexpr double kSpeedTime = 0.01;  ///< Time over which speed is found from the way, s.

/// The push along one direction.
struct Track {
  VectorXd time;     ///< s.
  VectorXd way;      ///< m, from the mean before the push.
  VectorXd once;     ///< Integral of the way, m·s.
  VectorXd pull;     ///< Second integral of the force, N·s².
  double begin = 0;  ///< Begin of the force, s.
};

VectorXd integral(const VectorXd& time, const VectorXd& values) {
  VectorXd sum = VectorXd::Zero(values.size());
  for (Index k = 1; k < values.size(); ++k) {
    sum[k] = sum[k - 1] + (time[k] - time[k - 1]) * (values[k] + values[k - 1]) / 2;
  }
  return sum;
}

/// A command acts until the next one.
VectorXd second_integral_of_held(const VectorXd& time, const VectorXd& force) {
  VectorXd twice = VectorXd::Zero(force.size());
  double once = 0;
  for (Index k = 1; k < force.size(); ++k) {
    const double h = time[k] - time[k - 1];
    twice[k] = twice[k - 1] + h * once + h * h / 2 * force[k - 1];
    once += h * force[k - 1];
  }
  return twice;
}

/// How many samples there are until the handle rests again.
Index count_until_rest(const VectorXd& time, const VectorXd& way) {
  const double period = (time[time.size() - 1] - time[0]) / static_cast<double>(time.size() - 1);
  const Index step = std::max<Index>(1, std::llround(kSpeedTime / period));
  double fastest = 0;
  for (Index k = step; k < way.size(); ++k) {
    const double speed = way[k] - way[k - step];
    fastest = std::max(fastest, speed);
    const bool has_moved = fastest > kLeastFitWay / 2;
    if (has_moved && speed < kRestShare * fastest) return k;
  }
  return way.size();
}

std::optional<Track> track_of(const std::vector<HandleSample>& samples, const Vector3& direction) {
  const auto first = std::find_if(samples.begin(), samples.end(),
                                  [](const HandleSample& s) { return !s.force.isZero(0); });
  if (first == samples.end() || first - samples.begin() < 2) return std::nullopt;
  const Index n = static_cast<Index>(samples.size());
  VectorXd time(n);
  VectorXd way(n);
  VectorXd force(n);
  for (Index k = 0; k < n; ++k) {
    const HandleSample& sample = samples[static_cast<std::size_t>(k)];
    time[k] = sample.time;
    way[k] = direction.dot(sample.p);
    force[k] = direction.dot(sample.force);
  }
  way.array() -= way.head(first - samples.begin()).mean();
  const Index count = count_until_rest(time, way);
  if (way.head(count).maxCoeff() < kLeastFitWay) return std::nullopt;
  Track track;
  track.time = time.head(count);
  track.way = way.head(count);
  track.once = integral(track.time, track.way);
  track.pull = second_integral_of_held(track.time, force.head(count));
  track.begin = first->time;
  return track;
}

/// The track's pull, `delay` later.
VectorXd later(const Track& track, double delay) {
  VectorXd values = VectorXd::Zero(track.time.size());
  Index from = 0;
  for (Index k = 0; k < values.size(); ++k) {
    const double t = track.time[k] - delay;
    if (t <= track.time[0]) continue;
    while (track.time[from + 1] < t) ++from;
    const double share = (t - track.time[from]) / (track.time[from + 1] - track.time[from]);
    values[k] = track.pull[from] + share * (track.pull[from + 1] - track.pull[from]);
  }
  return values;
}

/// The fit with that delay and of least error whose parts all resist; a mass of 0 is none.
PushFit fit_with(const Track& track, double delay) {
  const VectorXd since = (track.time.array() - track.begin - delay).max(0);
  Eigen::MatrixXd all(track.time.size(), 3);
  all << later(track, delay), -track.once, -since.cwiseAbs2() / 2;
  static const std::array<std::vector<int>, 4> kParts{{{0}, {0, 1}, {0, 2}, {0, 1, 2}}};
  const double largest = track.way.cwiseAbs().maxCoeff();
  PushFit best{.delay = delay, .unexplained = 1};
  for (const std::vector<int>& parts : kParts) {
    const Eigen::MatrixXd some = all(Eigen::all, parts);
    const VectorXd shares = some.colPivHouseholderQr().solve(track.way);
    if (!shares.allFinite() || shares[0] <= 0 || shares.minCoeff() < 0) continue;
    const double error = (some * shares - track.way).norm() /
                         std::sqrt(static_cast<double>(track.way.size())) / largest;
    if (error >= best.unexplained) continue;
    best = {.mass = 1 / shares[0], .delay = delay, .unexplained = error};
    for (std::size_t i = 1; i < parts.size(); ++i) {
      const double value = shares[static_cast<Index>(i)] / shares[0];
      (parts[i] == 1 ? best.damping : best.friction) = value;
    }
  }
  return best;
}

}  // namespace

std::optional<PushFit> fit_push(const std::vector<HandleSample>& samples,
                                const Vector3& direction) {
  const std::optional<Track> track = track_of(samples, direction);
  if (!track) return std::nullopt;
  PushFit best{.unexplained = 1};
  for (int i = 0; i * kDelayStep <= kLongestDelay; ++i) {
    const PushFit fit = fit_with(*track, i * kDelayStep);
    if (fit.unexplained < best.unexplained) best = fit;
  }
  return best.mass > 0 ? std::optional(best) : std::nullopt;
}

}  // namespace hlm::server
