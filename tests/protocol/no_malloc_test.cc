// The guard that the other tests trust.
#include "tests/support/no_malloc.h"

#include <cstdlib>
#include <thread>

#include <Eigen/Core>

#include "tests/support/catch.h"

namespace hlm::test {
namespace {

/// Made by `action` in this thread.
template <class Action>
std::size_t allocations_of(Action action) {
  const NoMalloc guard;
  action();
  return guard.allocations();
}

/// Keeps the compiler from leaving an allocation out.
void* volatile kept = nullptr;

TEST_CASE("The guard sees every way to allocate, in its own scope and thread only") {
  CHECK(allocations_of([] {}) == 0);
  CHECK(allocations_of([] {
          kept = ::operator new(100);
          ::operator delete(kept);
        }) == 1);
  CHECK(allocations_of([] {
          kept = std::malloc(100);
          std::free(kept);
        }) == 1);
  CHECK(allocations_of([] {
          kept = std::calloc(10, 10);
          std::free(kept);
        }) == 1);
  CHECK(allocations_of([] {
          kept = std::aligned_alloc(64, 128);
          std::free(kept);
        }) == 1);
  CHECK(allocations_of([] {
          Eigen::VectorXd vector(100);
          kept = vector.data();
        }) == 1);

  std::size_t outside = 0;
  std::thread other([&] {
    kept = std::malloc(100);
    std::free(kept);
    outside = allocations_of([] {});
  });
  other.join();
  CHECK(outside == 0);
}

}  // namespace
}  // namespace hlm::test
