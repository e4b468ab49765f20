// Entry of every test executable: prints the seed of its random tests, so that a failure can be
// repeated with --rng-seed.
#include <chrono>
#include <iostream>

#define CATCH_CONFIG_RUNNER
#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::test {
namespace {
unsigned seed = 1;
}
unsigned random_seed() { return seed; }
}  // namespace hlm::test

int main(int argc, char** argv) {
  Catch::Session session;
  if (const int error = session.applyCommandLine(argc, argv); error != 0) return error;
  if (session.configData().rngSeed != 0) hlm::test::seed = session.configData().rngSeed;
  std::cerr << "seed of random tests: " << hlm::test::seed << " (set with --rng-seed)\n";
  return session.run();
}
