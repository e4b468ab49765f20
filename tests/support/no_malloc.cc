#include "tests/support/no_malloc.h"

#include <cerrno>
#include <cstdlib>

namespace hlm::test {
namespace {

thread_local int guards = 0;
thread_local std::size_t allocations_seen = 0;

void count_allocation() noexcept {
  if (guards > 0) ++allocations_seen;
}

}  // namespace

NoMalloc::NoMalloc() noexcept : before_(allocations_seen) { ++guards; }

NoMalloc::~NoMalloc() { --guards; }

std::size_t NoMalloc::allocations() const noexcept { return allocations_seen - before_; }

}  // namespace hlm::test

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)

// A sanitizer brings its own allocator and calls hooks for it.
extern "C" int __sanitizer_install_malloc_and_free_hooks(void (*malloc_hook)(const volatile void*,
                                                                             std::size_t),
                                                         void (*free_hook)(const volatile void*));

namespace {
[[maybe_unused]] const int hooks_installed = __sanitizer_install_malloc_and_free_hooks(
    [](const volatile void*, std::size_t) { hlm::test::count_allocation(); },
    [](const volatile void*) {});
}  // namespace

#else

// These take the place of the C library's functions, which stay reachable by their second names.
// operator new calls malloc.
extern "C" {

void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* block, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
  hlm::test::count_allocation();
  return __libc_malloc(size);
}

void* calloc(std::size_t count, std::size_t size) {
  hlm::test::count_allocation();
  return __libc_calloc(count, size);
}

void* realloc(void* block, std::size_t size) {
  hlm::test::count_allocation();
  return __libc_realloc(block, size);
}

void* aligned_alloc(std::size_t alignment, std::size_t size) {
  hlm::test::count_allocation();
  return __libc_memalign(alignment, size);
}

int posix_memalign(void** block, std::size_t alignment, std::size_t size) {
  hlm::test::count_allocation();
  *block = __libc_memalign(alignment, size);
  return *block ? 0 : ENOMEM;
}

}  // extern "C"

#endif
