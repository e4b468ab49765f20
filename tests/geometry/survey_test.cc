// Separations and identities of pairs of every kind, at random sizes and poses, against bounds that
// prove the signed distance.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "tests/geometry/signed_distance.h"
#include "tests/support/catch.h"

namespace hlm::geometry::test {
namespace {

constexpr double kTolerance = 1e-6;   // m: what is promised.
constexpr double kEpsilon = 0.006;    // m.
constexpr double kDeepest = -0.02;    // m.
constexpr double kMicrometre = 1e-6;  // m: a step.
constexpr double kLeaving = 1e-5;     // m: nearer to ε than this a contact may end.
constexpr int kStepsOfWalk = 1000;
constexpr int kPosesOfPair = 10;  // Of the same two shapes.
constexpr int kHalfSpaceKind = kShapeKinds;

const char* const kNames[] = {"sphere", "capsule", "cylinder", "box", "ellipsoid", "hull", "plane"};

double log_uniform(double low, double high, Random& random) {
  return std::exp(random.uniform(std::log(low), std::log(high)));
}

/// 8 to 512 vertices: half of them anywhere on an ellipsoid, half of them on two round faces.
Hull hull_of_any_size(Random& random) {
  const int vertices = static_cast<int>(std::lround(log_uniform(8, 512, random)));
  const auto half = [&] { return log_uniform(0.005, 0.1, random); };
  const Vector3 radii(half(), half(), half());
  const bool is_bar = random.integer(0, 1) == 0;
  Hull hull;
  for (int i = 0; i < vertices; ++i) {
    const double angle = 4 * std::numbers::pi * (i / 2) / vertices;
    const Vector3 on_bar(std::cos(angle), std::sin(angle), i % 2 == 0 ? -1 : 1);
    hull.vertices.emplace_back(radii.cwiseProduct(is_bar ? on_bar : random.direction()));
  }
  return hull;
}

/// 10 to 200 mm in each direction.
Shape shape_of_any_size(int kind, Random& random) {
  const auto size = [&] { return log_uniform(0.01, 0.2, random); };
  if (kind == 0) return Sphere{size() / 2};
  if (kind == 1) return Capsule{size() / 2, size()};
  if (kind == 2) return Cylinder{size() / 2, size()};
  if (kind == 3) return Box{Vector3(size(), size(), size())};
  if (kind == 4) return Ellipsoid{Vector3(size(), size(), size()) / 2};
  if (kind == 5) return hull_of_any_size(random);
  return HalfSpace{};
}

/// Two shapes, built once for many poses.
struct Pair {
  Placed tool;
  Placed body;
  Convex tool_convex{tool.shape};
  Convex body_convex{body.shape};

  Manifold contacts(double epsilon, ProximityStatistics& statistics) const {
    return find_contacts(tool_convex, tool.X_WS, body_convex, body.X_WS, epsilon, statistics);
  }
};

Pair random_pair(int tool_kind, int body_kind, Random& random) {
  return {.tool = {shape_of_any_size(tool_kind, random), {}},
          .body = {shape_of_any_size(body_kind, random), {}}};
}

/// Places the tool at the separation `target`, as nearly as one move along the normal does; gives
/// bounds of what it is then.
DistanceBounds place(Pair& pair, Turn turn, double target, Random& random) {
  pair.body.X_WS = random.pose(0.5);
  const bool on_plane = std::holds_alternative<HalfSpace>(pair.body.shape);
  const Vector3 n = on_plane ? pair.body.X_WS.R * Vector3::UnitZ() : random.direction();
  pair.tool.X_WS = {pair.body.X_WS.p + random.vector(0.05),
                    pair.body.X_WS.R * random_turn(turn, random)};
  pair.tool.X_WS.p += (0.005 - gap_along(pair.tool, pair.body, n)) * n;
  const DistanceBounds apart = signed_distance(pair.tool, pair.body);
  pair.tool.X_WS.p += (target - apart.lower) * apart.n_W;
  return signed_distance(pair.tool, pair.body);
}

/// What the poses of one pair of kinds came to.
struct Tally {
  long poses = 0;       ///< Between -20 mm and ε.
  long unresolved = 0;  ///< Of these, where the reference itself was not sure to 0.1 µm.
  long refused = 0;
  long missed = 0;
  double error = 0;  ///< Largest, m.
};

void compare(const Pair& pair, const DistanceBounds& exact, Tally& tally) {
  if (exact.lower < kDeepest || exact.lower > kEpsilon - kTolerance) return;
  ++tally.poses;
  if (exact.width() > 1.01e-7) {
    ++tally.unresolved;
    return;
  }
  ProximityStatistics statistics;
  const Manifold manifold = pair.contacts(kEpsilon, statistics);
  tally.refused += static_cast<long>(statistics.failures);
  if (manifold.empty()) {
    tally.missed += 1 - static_cast<long>(statistics.failures);
    return;
  }
  const double s = smallest_separation(manifold);
  tally.error = std::max({tally.error, s - exact.upper, exact.lower - s,
                          std::abs(gap_along(pair.tool, pair.body, manifold[0].n_W) - s)});
}

/// From 20 mm deep to ε apart; one in four within 2 µm of touch.
Tally survey_distances(int first, int second, int poses, Random& random) {
  Tally tally;
  for (int i = 0; tally.poses < poses; i += kPosesOfPair) {
    const bool swap = second != kHalfSpaceKind && i / kPosesOfPair % 2 == 1;
    Pair pair = swap ? random_pair(second, first, random) : random_pair(first, second, random);
    for (int k = 0; k < kPosesOfPair; ++k) {
      const double target =
          k % 4 == 0 ? random.uniform(-2e-6, 2e-6) : random.uniform(kDeepest, kEpsilon);
      compare(pair, place(pair, kTurns[(i / kPosesOfPair + k) % 4], target, random), tally);
    }
  }
  return tally;
}

using Identity = std::pair<Feature, Feature>;
using Keys = std::map<Identity, double>;

/// Identities of the contacts with their separations, m.
Keys keys_of(const Manifold& manifold) {
  Keys keys;
  for (const ManifoldPoint& point : manifold) {
    keys[{point.tool_feature, point.body_feature}] = point.separation;
  }
  return keys;
}

/// Identities that contacts lost over walks of a thousand steps of a micrometre.
struct Walks {
  int walks = 0;
  int steady = 0;  ///< Walks that lost at most one.
  int lost = 0;
  int back = 0;  ///< Of these, found again later in the walk.
};

/// The tool of a pair near touch goes straight on, and turns as fast as moves its surface by up to
/// a micrometre a step.
void walk(int first, int second, Turn turn, Random& random, Walks& walks) {
  Pair pair = random_pair(first, second, random);
  place(pair, turn, random.uniform(-1e-4, 1e-3), random);
  const Vector3 step = kMicrometre * random.direction();
  const double reach = pair.tool_convex.half_extents().maxCoeff();
  const Quaternion turned =
      rotation_from_vector(random.uniform(0, kMicrometre / reach) * random.direction());
  ProximityStatistics statistics;
  Keys before = keys_of(pair.contacts(kEpsilon, statistics));
  std::set<Identity> lost;
  const int lost_before = walks.lost;
  for (int i = 0; i < kStepsOfWalk; ++i) {
    pair.tool.X_WS.p += step;
    pair.tool.X_WS.R = (turned * pair.tool.X_WS.R).normalized();
    Keys now = keys_of(pair.contacts(kEpsilon, statistics));
    for (const auto& [identity, separation] : now) {
      if (!before.contains(identity) && lost.contains(identity)) ++walks.back;
    }
    for (const auto& [identity, separation] : before) {
      if (separation > kEpsilon - kLeaving || now.contains(identity)) continue;
      ++walks.lost;
      lost.insert(identity);
    }
    before = std::move(now);
  }
  ++walks.walks;
  walks.steady += walks.lost - lost_before <= 1;
}

Walks survey_identities(int first, int second, int count, Random& random) {
  Walks walks;
  for (int i = 0; i < count; ++i) walk(first, second, kTurns[i % 4], random, walks);
  return walks;
}

void survey(int poses, int walks, bool print) {
  Random random;
  Walks all;
  if (print) {
    std::puts(
        "| pair | poses | missed | refused | largest error, µm | unsure reference | "
        "identities lost per 1000 steps | of these found again | walks with at most one, % |");
  }
  for (int first = 0; first < kShapeKinds; ++first) {
    for (int second = first; second <= kHalfSpaceKind; ++second) {
      const Tally tally = survey_distances(first, second, poses, random);
      const Walks walked = survey_identities(first, second, walks, random);
      const std::string name = std::string(kNames[first]) + ", " + kNames[second];
      if (print) {
        std::printf("| %s | %ld | %ld | %ld | %.3f | %ld | %.2f | %.2f | %.0f |\n", name.c_str(),
                    tally.poses, tally.missed, tally.refused, 1e6 * tally.error, tally.unresolved,
                    double(walked.lost) / walked.walks, double(walked.back) / walked.walks,
                    100.0 * walked.steady / walked.walks);
        std::fflush(stdout);
      }
      CAPTURE(name);
      CHECK(tally.missed == 0);
      CHECK(tally.refused == 0);
      CHECK(tally.error < kTolerance);
      CHECK(tally.unresolved <= 2 + tally.poses / 1000);
      all.walks += walked.walks;
      all.back += walked.back;
      all.steady += walked.steady;
    }
  }
  CHECK(all.steady >= 0.9 * all.walks);
  CHECK(all.back <= 5 * all.walks);
}

}  // namespace

TEST_CASE(
    "Pairs of every kind of 10 to 200 mm: no contact missed or refused, each right to a "
    "micrometre, identities that last",
    "[optimised]") {
  survey(100, 12, false);
}

TEST_CASE(
    "Cylinders and ellipsoids on boxes and hulls lose about one identity in 1000 steps of a "
    "micrometre, and few that they find again",
    "[optimised]") {
  Random random;
  for (const auto& [first, second] : {std::pair(2, 3), {2, 5}, {3, 4}, {4, 5}}) {
    const Walks walked = survey_identities(first, second, 100, random);
    CAPTURE(kNames[first], kNames[second], walked.lost, walked.back);
    // 0.1 to 0.9 over 400 walks; over 100 with seeds 1 to 5 up to 1.12.
    CHECK(walked.lost <= 1.3 * walked.walks);
    CHECK(walked.back <= walked.walks / 4);
  }
}

// test_geometry "[survey]"
TEST_CASE("The same over 100,000 poses of each pair", "[.][survey]") { survey(100'000, 400, true); }

}  // namespace hlm::geometry::test
