// Preloaded into a program, sets its clock of the day: CLOCK_REALTIME is off by as many seconds as
// the file HLM_CLOCK_OFFSET holds, a double that may change at any time. The machine's own clock,
// and the steady ones, stay as they are.
#include <cmath>
#include <cstdlib>
#include <ctime>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <unistd.h>

namespace {

const double* open_offset() {
  static const double none = 0;
  const char* const path = std::getenv("HLM_CLOCK_OFFSET");
  const int file = path != nullptr ? open(path, O_RDONLY | O_CLOEXEC) : -1;
  if (file < 0) return &none;
  void* const memory = mmap(nullptr, sizeof none, PROT_READ, MAP_SHARED, file, 0);
  close(file);
  return memory != MAP_FAILED ? static_cast<const double*>(memory) : &none;
}

const volatile double* const offset = open_offset();

}  // namespace

extern "C" {

int clock_gettime(clockid_t clock, timespec* time) noexcept {
  const long result = syscall(SYS_clock_gettime, clock, time);
  if (result != 0 || clock != CLOCK_REALTIME || offset == nullptr) return static_cast<int>(result);
  const double whole = std::floor(*offset);
  time->tv_sec += static_cast<time_t>(whole);
  time->tv_nsec += static_cast<long>(1e9 * (*offset - whole));
  if (time->tv_nsec >= 1'000'000'000) {
    ++time->tv_sec;
    time->tv_nsec -= 1'000'000'000;
  }
  return 0;
}

int gettimeofday(timeval* time, void*) noexcept {
  timespec precise{};
  clock_gettime(CLOCK_REALTIME, &precise);
  *time = {.tv_sec = precise.tv_sec, .tv_usec = precise.tv_nsec / 1000};
  return 0;
}

time_t time(time_t* also) noexcept {
  timespec precise{};
  clock_gettime(CLOCK_REALTIME, &precise);
  if (also != nullptr) *also = precise.tv_sec;
  return precise.tv_sec;
}
}
