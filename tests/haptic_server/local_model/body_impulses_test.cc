#include "hlm/haptic_server/local_model/body_impulses.h"

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
  impulses->report({slot});
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
  impulses->report({slot});
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

TEST_CASE(
    "Impulses are spread only where that is asked for and steps have room, and none is lost") {
  constexpr std::uint32_t kBodies = 2 * kMaxBodiesAhead;
  const auto impulses = std::make_unique<BodyImpulses>();
  BodyImpulses::Slots evenly;
  const auto push_all = [&] {  // One after another.
    for (std::uint32_t body = 0; body < kBodies; ++body) {
      impulses->add(*impulses->enrol(body), along_z(body + 1.0));
      impulses->end_step();
    }
  };
  push_all();
  impulses->report();
  for (std::size_t slot = 0; slot < kMaxBodiesAhead; ++slot) evenly.push_back(slot);
  push_all();
  impulses->report(evenly);
  for (std::size_t slot = 0; slot < kBodies; ++slot) {
    const double due = static_cast<double>(slot) + 1;
    CHECK(total_z(*impulses, slot, slot, slot + 1) == Approx(due));  // Before.
    CHECK(total_z(*impulses, slot, kBodies, 2 * kBodies) == Approx(due));
    const double at_its_step = total_z(*impulses, slot, kBodies + slot, kBodies + slot + 1);
    // The last of them finds steps full.
    CHECK(at_its_step == Approx(slot + 1 < kMaxBodiesAhead ? due / kBodies : due));
  }
}

TEST_CASE("A long time without a report leaves the step that has begun alone") {
  const auto impulses = std::make_unique<BodyImpulses>();
  const std::size_t slot = *impulses->enrol(7);
  impulses->add(slot, along_z(1));
  impulses->end_step();
  impulses->report({slot});
  for (std::uint64_t i = 0; i < BodyImpulses::kHistory + 10; ++i) {
    impulses->add(slot, along_z(1));
    impulses->end_step();
  }
  impulses->report({slot});
  const std::uint64_t now = impulses->world_step();
  impulses->end_step();  // In which it got nothing.
  CHECK(total_z(*impulses, slot, now, now + 1) == Approx(0).margin(1e-12));
  impulses->repeat(100'000'000);
  CHECK(impulses->world_step() == now + 1 + 100'000'000);
}

}  // namespace
}  // namespace hlm::server
