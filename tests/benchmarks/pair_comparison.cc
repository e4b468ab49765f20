// What does a pair cost here, its contacts included, and what its signed distance alone in FCL and
// in Bullet, and how far off is that? Prints a table; takes some seconds.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btCapsuleShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btCylinderShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkEpaPenetrationDepthSolver.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkPairDetector.h>
#include <BulletCollision/NarrowPhaseCollision/btPointCollector.h>
#include <BulletCollision/NarrowPhaseCollision/btVoronoiSimplexSolver.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/convex.h>
#include <fcl/geometry/shape/cylinder.h>
#include <fcl/geometry/shape/ellipsoid.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/narrowphase/distance.h>

#include "hlm/geometry/hull.h"
#include "hlm/geometry/manifold.h"

namespace hlm::geometry {
namespace {

constexpr double kEpsilon = 0.005;  // m.
constexpr double kDeepest = 0.002;  // m.
constexpr int kPoses = 100;         // Of each pair, half of them apart; of ellipsoids all.
constexpr int kRounds = 15;         // Of which the median counts.

using Geometry = std::shared_ptr<fcl::CollisionGeometryd>;
using BulletShape = std::shared_ptr<btConvexShape>;

/// One shape three times.
struct Trio {
  std::string name;
  Convex ours;
  Geometry fcl;
  BulletShape bullet;  ///< None where Bullet has no such shape.
};

/// Points on an ellipsoid of 40 × 60 × 80 mm.
Trio hull(int vertices, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Hull shape;
  for (int i = 0; i < vertices; ++i) {
    const Vector3 n = Vector3(normal(random), normal(random), normal(random)).normalized();
    shape.vertices.push_back(n.cwiseProduct(Vector3(0.02, 0.03, 0.04)));
  }
  const HullFaces faces = convex_hull(shape.vertices);
  std::vector<int> loops;
  for (const auto& loop : faces.loops) {
    loops.push_back(static_cast<int>(loop.size()));
    loops.insert(loops.end(), loop.begin(), loop.end());
  }
  auto bullet = std::make_shared<btConvexHullShape>();
  for (const Vector3& p : faces.vertices) bullet->addPoint({p.x(), p.y(), p.z()}, false);
  bullet->recalcLocalAabb();
  bullet->setMargin(0);
  return {
      "hull of " + std::to_string(vertices), Convex(shape),
      std::make_shared<fcl::Convexd>(std::make_shared<const std::vector<Vector3>>(faces.vertices),
                                     static_cast<int>(faces.loops.size()),
                                     std::make_shared<const std::vector<int>>(loops)),
      bullet};
}

std::vector<Trio> shapes(std::mt19937_64& random) {
  std::vector<Trio> all;
  all.push_back({"sphere", Convex(Sphere{0.03}), std::make_shared<fcl::Sphered>(0.03),
                 std::make_shared<btSphereShape>(0.03)});
  all.push_back({"capsule", Convex(Capsule{0.02, 0.06}),
                 std::make_shared<fcl::Capsuled>(0.02, 0.06),
                 std::make_shared<btCapsuleShapeZ>(0.02, 0.06)});
  all.push_back({"cylinder", Convex(Cylinder{0.03, 0.08}),
                 std::make_shared<fcl::Cylinderd>(0.03, 0.08),
                 std::make_shared<btCylinderShapeZ>(btVector3(0.03, 0.03, 0.04))});
  all.push_back({"box", Convex(Box{Vector3(0.04, 0.06, 0.08)}),
                 std::make_shared<fcl::Boxd>(0.04, 0.06, 0.08),
                 std::make_shared<btBoxShape>(btVector3(0.02, 0.03, 0.04))});
  for (Trio& trio : all) {
    const bool is_round = trio.name == "sphere" || trio.name == "capsule";
    if (!is_round) trio.bullet->setMargin(0);
  }
  all.push_back(hull(32, random));
  all.push_back(hull(200, random));
  all.push_back({"ellipsoid", Convex(Ellipsoid{Vector3(0.02, 0.03, 0.04)}),
                 std::make_shared<fcl::Ellipsoidd>(0.02, 0.03, 0.04), nullptr});
  return all;
}

fcl::Transform3d in_fcl(const Pose& X) {
  fcl::Transform3d T = fcl::Transform3d::Identity();
  T.translation() = X.p;
  T.linear() = X.R.toRotationMatrix();
  return T;
}

btTransform in_bullet(const Pose& X) {
  return btTransform(btQuaternion(X.R.x(), X.R.y(), X.R.z(), X.R.w()),
                     btVector3(X.p.x(), X.p.y(), X.p.z()));
}

/// Two shapes at poses of the first, the second being at the origin.
class Case {
 public:
  Case(const Trio& a, const Trio& b, std::mt19937_64& random) : a_(a), b_(b) {
    std::normal_distribution<double> normal;
    ProximityStatistics statistics;
    for (int i = 0; i < kPoses; ++i) {
      const bool apart = i % 2 == 0 || !has_overlaps();
      const double target = apart ? std::uniform_real_distribution(0.0, kEpsilon)(random)
                                  : -std::uniform_real_distribution(0.0, kDeepest)(random);
      const Quaternion R =
          Quaternion(normal(random), normal(random), normal(random), normal(random)).normalized();
      const Vector3 away = Vector3(normal(random), normal(random), normal(random)).normalized();
      Pose X{0.2 * away, R};
      const Manifold far = find_contacts(a.ours, X, b.ours, Pose{}, 1, statistics);
      double s = far.front().separation;
      for (const ManifoldPoint& point : far) s = std::min(s, point.separation);
      X.p += (target - s) * far.front().n_W;
      poses_.push_back(X);
      fcl_poses_.push_back(in_fcl(X));
      bullet_poses_.push_back(in_bullet(X));
    }
  }

  /// Signed distance at the pose of that number, m; so the others.
  double ours(std::size_t i) const {
    ProximityStatistics statistics;
    double s = kEpsilon;
    for (const ManifoldPoint& point :
         find_contacts(a_.ours, poses_[i], b_.ours, Pose{}, kEpsilon, statistics)) {
      s = std::min(s, point.separation);
    }
    return s;
  }

  double fcl(std::size_t i) const {
    const fcl::DistanceRequestd request(true, true);
    fcl::DistanceResultd result;
    return fcl::distance(a_.fcl.get(), fcl_poses_[i], b_.fcl.get(), fcl::Transform3d::Identity(),
                         request, result);
  }

  /// FCL aborts at an assertion of its own in some overlaps of ellipsoids.
  bool has_overlaps() const { return !a_.ours.is_ellipsoid() && !b_.ours.is_ellipsoid(); }
  bool has_bullet() const { return a_.bullet && b_.bullet; }
  double bullet(std::size_t i) const {
    btVoronoiSimplexSolver simplex;
    btGjkEpaPenetrationDepthSolver epa;
    btGjkPairDetector detector(a_.bullet.get(), b_.bullet.get(), &simplex, &epa);
    btGjkPairDetector::ClosestPointInput input;
    input.m_transformA = bullet_poses_[i];
    input.m_transformB.setIdentity();
    btPointCollector result;
    detector.getClosestPoints(input, result, nullptr);
    return result.m_distance;
  }

 private:
  const Trio& a_;
  const Trio& b_;
  std::vector<Pose> poses_;
  std::vector<fcl::Transform3d> fcl_poses_;
  std::vector<btTransform> bullet_poses_;
};

/// Answers of one of the three at all poses, m.
using Answers = std::array<double, kPoses>;

/// Time of the processor that the answers take, µs a pose.
template <class Answer>
double time_of(const Answer& answer, Answers& answers) {
  timespec begin{};
  timespec end{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &begin);
  for (std::size_t i = 0; i < kPoses; ++i) answers[i] = answer(i);
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &end);
  return (1e6 * double(end.tv_sec - begin.tv_sec) + 1e-3 * double(end.tv_nsec - begin.tv_nsec)) /
         kPoses;
}

/// Largest difference of two, m.
double difference(const Answers& a, const Answers& b) {
  double largest = 0;
  for (std::size_t i = 0; i < kPoses; ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

void compare(const Trio& a, const Trio& b, std::mt19937_64& random) {
  const Case both(a, b, random);
  std::array<std::vector<double>, 3> times;
  std::array<Answers, 3> answers;
  for (int round = 0; round < kRounds; ++round) {
    times[0].push_back(time_of([&](std::size_t i) { return both.ours(i); }, answers[0]));
    times[1].push_back(time_of([&](std::size_t i) { return both.fcl(i); }, answers[1]));
    if (!both.has_bullet()) continue;
    times[2].push_back(time_of([&](std::size_t i) { return both.bullet(i); }, answers[2]));
  }
  const double ours = median(times[0]);
  const double fcl = median(times[1]);
  std::printf("| %s, %s | %.2f | %.2f |", a.name.c_str(), b.name.c_str(), ours, fcl);
  const double fcl_off = 1e6 * difference(answers[0], answers[1]);
  if (both.has_bullet()) {
    const double bullet = median(times[2]);
    std::printf(" %.2f | %.2f | %.2f | %.1f | %.1f |\n", bullet, ours / fcl, ours / bullet, fcl_off,
                1e6 * difference(answers[0], answers[2]));
  } else {
    std::printf(" - | %.2f | - | %.1f | - |\n", ours / fcl, fcl_off);
  }
  std::fflush(stdout);
}

}  // namespace
}  // namespace hlm::geometry

int main() {
  std::mt19937_64 random(1);
  const auto shapes = hlm::geometry::shapes(random);
  std::puts(
      "| pair | here, µs | FCL, µs | Bullet, µs | of FCL's | of Bullet's | FCL differs by, µm | "
      "Bullet by, µm |");
  // The pairs without an ellipsoid, which is the last, come first: their poses are those of before.
  for (const std::size_t end : {shapes.size() - 1, shapes.size()}) {
    for (std::size_t i = 0; i < end; ++i) {
      for (std::size_t k = end < shapes.size() ? i : end - 1; k < end; ++k) {
        hlm::geometry::compare(shapes[i], shapes[k], random);
      }
    }
  }
}
