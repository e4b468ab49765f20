// Random values for tests, repeatable from one printed seed.
#pragma once

#include <cstdint>
#include <random>

#include "hlm/common/spatial.h"

namespace hlm::test {

/// The seed of this run: 1, or what --rng-seed says.
unsigned random_seed();

class Random {
 public:
  Random() : engine_(random_seed()) {}
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  int integer(int low, int high) { return std::uniform_int_distribution<int>(low, high)(engine_); }
  Vector3 vector(double size) {
    return {uniform(-size, size), uniform(-size, size), uniform(-size, size)};
  }
  // In an order that no compiler chooses: all have the same cases.
  Vector3 direction() {
    std::normal_distribution<double> normal;
    Vector3 n;
    for (Eigen::Index i : {2, 1, 0}) n[i] = normal(engine_);
    return n.normalized();
  }
  Quaternion rotation() {
    std::normal_distribution<double> normal;
    const double z = normal(engine_);
    const double y = normal(engine_);
    const double x = normal(engine_);
    return Quaternion(normal(engine_), x, y, z).normalized();
  }
  Pose pose(double size) { return {vector(size), rotation()}; }
  std::mt19937_64& engine() { return engine_; }

 private:
  std::mt19937_64 engine_;
};

}  // namespace hlm::test
