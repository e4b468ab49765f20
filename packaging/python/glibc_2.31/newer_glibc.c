// What the standard library of GCC 12 calls in glibc, and glibc 2.31 does not have.
#include <stdint.h>
#include <stdlib.h>
#include <sys/random.h>

#pragma GCC visibility push(hidden)

// Since glibc 2.32: whether the process has one thread only. No is always safe.
char __libc_single_threaded = 0;

// Since glibc 2.36, which ends the process too where the kernel gives no random bits.
uint32_t arc4random(void) {
  uint32_t number;
  if (getrandom(&number, sizeof number, 0) != sizeof number) abort();
  return number;
}
