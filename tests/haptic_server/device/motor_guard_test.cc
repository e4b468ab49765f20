// The process that takes the motors off when the one that commands them cannot: the guard alone, on
// processes that the tests fork. tests/system/crash_test.cc has it in the real server.
#include "hlm/haptic_server/device/motor_guard.h"

#include <atomic>
#include <chrono>
#include <csignal>
#include <functional>
#include <new>
#include <thread>

#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using Clock = std::chrono::steady_clock;

void sleep_for(double seconds) {
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// What the processes of a test share.
struct Shared {
  std::atomic<bool> halted = false;
  std::atomic<int> guard = 0;
  std::atomic<bool> killed = false;
};

class SharedMemory {
 public:
  SharedMemory()
      : shared_(new (mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE,
                          MAP_SHARED | MAP_ANONYMOUS, -1, 0)) Shared) {}
  ~SharedMemory() { munmap(shared_, sizeof(Shared)); }
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;
  Shared* operator->() const { return shared_; }

  /// Whether the motors are off within so many seconds.
  bool halted_within(double seconds) const {
    const auto begin = Clock::now();
    while (!shared_->halted && seconds_since(begin) < seconds) sleep_for(1e-3);
    return shared_->halted;
  }

 private:
  Shared* shared_;
};

/// Knows only whether it was halted, by whichever process.
class HaltingDevice final : public Device {
 public:
  explicit HaltingDevice(const SharedMemory& memory) : memory_(memory) {}
  std::string_view name() const noexcept override { return "halting device"; }
  const DeviceRatings& ratings() const noexcept override { return ratings_; }
  bool measures_hand_wrench() const noexcept override { return false; }
  void align(const Pose&) noexcept override {}
  void enable() noexcept override {}
  void disable() noexcept override {}
  std::optional<DeviceState> read() noexcept override { return DeviceState{}; }
  bool write(const Wrench&) noexcept override { return true; }
  void halt() noexcept override { memory_->halted = true; }

 private:
  const SharedMemory& memory_;
  DeviceRatings ratings_;
};

/// A process of its own with a device and its guard, which does `body` and ends without a word.
class Commander {
 public:
  using Body = std::function<void(MotorGuard&)>;

  Commander(const SharedMemory& memory, double longest_gap, const Body& body) : id_(fork()) {
    REQUIRE(id_ >= 0);
    if (id_ > 0) return;
    HaltingDevice device(memory);
    MotorGuard guard(device, longest_gap);
    memory->guard = guard.process();
    body(guard);
    kill(getpid(), SIGKILL);
  }
  ~Commander() {
    kill(id_, SIGKILL);
    waitpid(id_, nullptr, 0);
  }
  Commander(const Commander&) = delete;
  Commander& operator=(const Commander&) = delete;

  pid_t id() const { return id_; }

 private:
  pid_t id_;
};

void beat_for(MotorGuard& guard, double seconds) {
  for (const auto begin = Clock::now(); seconds_since(begin) < seconds; sleep_for(1e-3)) {
    guard.beat();
  }
}

constexpr double kLongGap = 10;  // s: nothing here takes so long

TEST_CASE("Motors are off when their process dies, before its first beat and after") {
  const double alive = GENERATE(0.0, 0.2);  // s
  const SharedMemory memory;
  const Commander commander(memory, kLongGap, [&](MotorGuard& guard) { beat_for(guard, alive); });
  CHECK(memory.halted_within(kLongGap / 2));
}

TEST_CASE("Motors are off when their process dies and one that it forked lives on") {
  const SharedMemory memory;
  const Commander commander(memory, 0.5, [&](MotorGuard& guard) {
    if (fork() == 0) {
      sleep_for(4);
      _exit(0);
    }
    beat_for(guard, 0.2);
  });
  CHECK(memory.halted_within(3));
}

TEST_CASE("Motors are off when their process dies before it has given its memory back") {
  constexpr std::size_t kMemory = std::size_t{1} << 29;  // Bytes: freed in some 0.05 s.
  const SharedMemory memory;
  std::atomic<bool>& killed = memory->killed;
  const Commander commander(memory, kLongGap, [&](MotorGuard& guard) {
    void* const large = mmap(nullptr, kMemory, PROT_READ | PROT_WRITE,
                             MAP_PRIVATE | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
    if (large == MAP_FAILED) return;
    beat_for(guard, 0.1);
    killed = true;
  });
  while (!killed) sleep_for(1e-4);
  const auto begin = Clock::now();
  const auto has_ended = [&] {
    siginfo_t ended{};
    waitid(P_PID, static_cast<id_t>(commander.id()), &ended, WEXITED | WNOHANG | WNOWAIT);
    return ended.si_pid != 0;
  };
  double off = 0;
  for (; !has_ended(); sleep_for(1e-4)) {
    if (off == 0 && memory->halted) off = seconds_since(begin);
  }
  const double ended = seconds_since(begin);
  WARN("motors off after " << 1e3 * off << " ms, all of it gone after " << 1e3 * ended << " ms");
  CHECK(off > 0);
  CHECK(off < ended / 2);
}

TEST_CASE("Motors are off when their process is stopped, and stay on while it beats") {
  const SharedMemory memory;
  const Commander commander(memory, 1, [](MotorGuard& guard) { beat_for(guard, 60); });
  CHECK_FALSE(memory.halted_within(2));
  kill(commander.id(), SIGSTOP);
  CHECK(memory.halted_within(3));
}

TEST_CASE("A guard that was kept waiting itself does not halt a process that beats") {
  const SharedMemory memory;
  const Commander commander(memory, 0.5, [](MotorGuard& guard) { beat_for(guard, 60); });
  while (memory->guard == 0) sleep_for(1e-3);
  for (int i = 0; i < 5; ++i) {
    kill(memory->guard, SIGSTOP);
    sleep_for(0.8);
    kill(memory->guard, SIGCONT);
    sleep_for(0.1);
  }
  CHECK_FALSE(memory->halted);
}

TEST_CASE("A process that ends its guard in order is not halted, and the guard is gone") {
  const SharedMemory memory;
  HaltingDevice device(memory);
  pid_t process = 0;
  {
    MotorGuard guard(device, kLongGap);
    process = guard.process();
    beat_for(guard, 0.1);
    CHECK(guard.lives());
  }
  CHECK_FALSE(memory->halted);
  CHECK(kill(process, 0) != 0);
}

TEST_CASE("A guard that was killed is missed, once, and its end waits for nothing") {
  const SharedMemory memory;
  HaltingDevice device(memory);
  MotorGuard guard(device, kLongGap);
  kill(guard.process(), SIGKILL);
  const auto begin = Clock::now();
  while (guard.lives() && seconds_since(begin) < 5) sleep_for(1e-3);
  CHECK(seconds_since(begin) < 5);
  CHECK(guard.lives());
}

}  // namespace
}  // namespace hlm::server
