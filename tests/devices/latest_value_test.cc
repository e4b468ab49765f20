// A value between two threads.
#include "hlm/common/latest_value.h"

#include <array>
#include <cstdint>
#include <thread>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

/// Long enough that a torn copy would show.
using Value = std::array<std::uint64_t, 32>;

Value filled(std::uint64_t number) {
  Value value;
  value.fill(number);
  return value;
}

TEST_CASE("Before the first value there is an empty one, then the newest, again and again") {
  LatestValue<Value> newest;
  CHECK(newest.get() == Value{});
  newest.put(filled(1));
  newest.put(filled(2));
  CHECK(newest.get() == filled(2));
  CHECK(newest.get() == filled(2));
  newest.put(filled(3));
  CHECK(newest.get() == filled(3));
}

TEST_CASE(
    "Of two million values between two threads none is torn, and none comes after a newer one") {
  constexpr std::uint64_t kLast = 2'000'000;
  LatestValue<Value> newest;
  std::thread writer([&] {
    for (std::uint64_t i = 1; i <= kLast; ++i) newest.put(filled(i));
  });
  std::uint64_t before = 0;
  bool whole = true;
  bool in_order = true;
  while (before < kLast) {
    const Value value = newest.get();
    whole = whole && value == filled(value.front());
    in_order = in_order && value.front() >= before;
    before = value.front();
  }
  writer.join();
  CHECK(whole);
  CHECK(in_order);
}

}  // namespace
}  // namespace hlm::server
