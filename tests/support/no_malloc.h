// Counts the heap allocations of a scope, to show that a function of the tick makes none.
#pragma once

#include <cstddef>

namespace hlm::test {

/// While it lives, allocations of this thread (malloc, operator new and their kin) are counted.
/// Works with and without sanitizers. Two at a time in one thread count together.
class NoMalloc {
 public:
  NoMalloc() noexcept;
  ~NoMalloc();
  NoMalloc(const NoMalloc&) = delete;
  NoMalloc& operator=(const NoMalloc&) = delete;

  /// Since the construction.
  std::size_t allocations() const noexcept;

 private:
  std::size_t before_;
};

}  // namespace hlm::test
