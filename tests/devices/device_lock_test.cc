// One device is one process's, for as long as that lives.
#include "hlm/devices/device_lock.h"

#include <chrono>
#include <optional>
#include <string>

#include <sys/wait.h>
#include <unistd.h>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using namespace std::chrono_literals;

/// A name that no other test's process has.
std::string own_name(const std::string& text) { return text + ' ' + std::to_string(getpid()); }

TEST_CASE("What one has no other takes, by its whole name, until the first one ends") {
  const std::string name = own_name("Inverse3 049D at 127.0.0.1:10001");
  std::optional<DeviceLock> first(std::in_place);
  first->take(name);
  first->take(name);  // It has it.
  DeviceLock second;
  CHECK_THROWS_WITH(second.take(name),
                    "another haptic_server or haptic_doctor has " + name + ": end it first");
  DeviceLock other;
  CHECK_NOTHROW(other.take("other " + name));
  first.reset();
  CHECK_NOTHROW(second.take(name));
}

TEST_CASE("A name of 1000 bytes is told from another by its end") {
  const std::string name = own_name(std::string(1000, 'x'));
  DeviceLock first;
  first.take(name);
  DeviceLock second;
  CHECK_THROWS(second.take(name));
  CHECK_NOTHROW(second.take(name + 'y'));
}

TEST_CASE("A process that was forked and outlives the first by 0.2 s is waited for") {
  const std::string name = own_name("the board at /dev/ttyACM0");
  std::optional<DeviceLock> first(std::in_place);
  first->take(name);
  const pid_t guard = fork();
  if (guard == 0) {
    usleep(200'000);
    _exit(0);
  }
  first.reset();
  DeviceLock second;
  const auto begin = std::chrono::steady_clock::now();
  CHECK_NOTHROW(second.take(name));
  CHECK(std::chrono::steady_clock::now() - begin > 100ms);
  waitpid(guard, nullptr, 0);
}

}  // namespace
}  // namespace hlm::server
