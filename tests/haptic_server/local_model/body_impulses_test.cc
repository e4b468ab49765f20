#include "hlm/local_model/body_impulses.h"

#include <memory>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

Vector6 along_z(double P) { return P * Vector6::Unit(2); }

double total_z(const BodyImpulses& impulses, std::size_t slot, std::uint64_t from,
               std::uint64_t to) {
  return impulses.between(slot, from, to)[2];
}

TEST_CASE("What is reported counts as the environment plays it: evenly since the report before") {
  const auto impulses = std::make_unique<BodyImpulses>();
  const std::size_t slot = *impulses->enrol(7);
  const auto push = [&](double P) {
    impulses->add(slot, along_z(P));
    impulses->end_step();
  };
  push(1);
  impulses->report();
  for (const double P : {0.0, 0.0, 8.0, 0.0}) push(P);
  CHECK(total_z(*impulses, slot, 1, 3) == Approx(0).margin(1e-12));
  impulses->report();
  CHECK(total_z(*impulses, slot, 1, 3) == Approx(4));
  CHECK(total_z(*impulses, slot, 1, 5) == Approx(8));
  CHECK(impulses->total(slot)[2] == Approx(9));
  push(3);  // Not reported yet: as it came.
  CHECK(total_z(*impulses, slot, 5, 6) == Approx(3));
}

TEST_CASE("A body's first impulses are played out at once") {
  const auto impulses = std::make_unique<BodyImpulses>();
  const std::size_t slot = *impulses->enrol(7);
  for (int i = 0; i < 4; ++i) {
    impulses->add(slot, along_z(1));
    impulses->end_step();
  }
  impulses->report();
  CHECK(total_z(*impulses, slot, 0, 1) == Approx(4));
  CHECK(total_z(*impulses, slot, 1, 4) == Approx(0).margin(1e-12));
}

TEST_CASE("Steps like the latest give bodies as much, to the totals and to what is repeated") {
  const auto impulses = std::make_unique<BodyImpulses>();
  const std::size_t slot = *impulses->enrol(7);
  impulses->add(slot, along_z(2));
  impulses->end_step();
  impulses->repeat(12);
  CHECK(impulses->step() == 13);
  CHECK(impulses->total(slot)[2] == Approx(26));
  CHECK(total_z(*impulses, slot, 1, 13) == Approx(24));
  impulses->end_step();
  impulses->repeat(10);
  CHECK(impulses->step() == 24);
  CHECK(impulses->total(slot)[2] == Approx(26));
}

TEST_CASE("More bodies between two reports than a step has room for keep their steps") {
  const auto impulses = std::make_unique<BodyImpulses>();
  for (std::uint32_t body = 0; body < 2 * kMaxMovedBodies; ++body) {
    impulses->add(*impulses->enrol(body), along_z(body + 1.0));
    impulses->end_step();
  }
  impulses->report();
  for (std::uint32_t body = 0; body < 2 * kMaxMovedBodies; ++body) {
    CHECK(total_z(*impulses, *impulses->enrol(body), body, body + 1) == Approx(body + 1.0));
  }
}

}  // namespace
}  // namespace hlm::server
