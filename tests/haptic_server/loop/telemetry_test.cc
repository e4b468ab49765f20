// Telemetry: signals in batches, and the local contacts, to a client that asked.
#include "hlm/haptic_server/loop/telemetry.h"

#include <array>

#include "tests/haptic_server/loop/servo_bench.h"
#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using test::ServoBench;
using test::wall_ahead;

constexpr int kBatch = static_cast<int>(protocol::kTicksPerMessage);

/// A session whose client asks for telemetry, one step old.
void begin_watched(ServoBench& bench) {
  bench.begin();
  bench.send(protocol::Control{.telemetry = true, .holds = false, .X_WTarget = {}, .tuned = false});
}

/// What was sent since the last call, by type.
template <class Message>
std::vector<Message> sent(ServoBench& bench) {
  std::vector<Message> messages;
  for (const protocol::Datagram& datagram : bench.link.queue.sent()) {
    Message message;
    if (!decode(protocol::view(datagram.bytes), message)) messages.push_back(message);
  }
  bench.link.queue.forget_sent();
  return messages;
}

template <>
std::vector<protocol::LocalState> sent(ServoBench& bench) {
  std::vector<protocol::LocalState> messages;
  for (const protocol::Datagram& datagram : bench.link.queue.sent()) {
    protocol::LocalState message;
    if (!decode(std::array{datagram.bytes}, message)) messages.push_back(message);
  }
  bench.link.queue.forget_sent();
  return messages;
}

TEST_CASE("Nobody has asked: no ticks, no contacts, and not in the next session either") {
  ServoBench bench;
  begin_watched(bench);
  bench.tick_with(bench.update());
  bench.begin();
  bench.link.queue.forget_sent();
  bench.tick_with(bench.update());
  bench.ticks(3 * kBatch);
  CHECK(bench.link.queue.sent().size() == 1);  // the acknowledgement
}

TEST_CASE("Batches hold every step once, in order") {
  ServoBench bench;
  begin_watched(bench);
  bench.tick_with(bench.update());  // step 2
  sent<protocol::Ticks>(bench);
  for (int i = 0; i < 10 * kBatch; ++i) bench.tick();
  std::uint64_t next = 2;
  for (const protocol::Ticks& batch : sent<protocol::Ticks>(bench)) {
    CHECK(batch.first_step == next);
    CHECK(batch.ticks.size() == protocol::kTicksPerMessage);
    next += batch.ticks.size();
  }
  CHECK(next == 2 + 10 * kBatch);
}

TEST_CASE("A tick's signals are those of its record, execution is of the tick before") {
  ServoBench bench;
  begin_watched(bench);
  bench.device.state->X_WD.p = {0.003, 0, 0};
  bench.device.state->F_hand = test::planar_wrench(0.5, 0.25, 0.01);
  protocol::ContactUpdate update = bench.update({wall_ahead(0.02)});
  update.compute_time = 0.007;
  bench.tick_with(update);
  bench.ticks(kBatch - 2);
  bench.timing.previous_execution = 12e-6;
  bench.timing.lateness = 3e-6;
  const TickRecord& record = bench.tick();
  const protocol::Ticks batch = sent<protocol::Ticks>(bench).at(0);
  const protocol::TickSignals& first = batch.ticks.front();
  CHECK(first.adopted);
  const protocol::TickSignals& last = batch.ticks.back();
  CHECK_FALSE(last.adopted);
  CHECK(last.F_hand == Vector3(0.5, 0.25, 0));  // N
  CHECK((last.F_command - record.F_command.head<3>()).norm() < 1e-6);
  CHECK((last.F_env - record.F_env.head<3>()).norm() < 1e-6);
  CHECK(last.torque == Approx(record.F_command.tail<3>().norm()));
  CHECK(last.smallest_separation == Approx(record.smallest_separation));  // m
  CHECK(last.device_proxy == Approx((record.X_WD.p - record.X_WP.p).norm()));
  CHECK(last.proxy_tool == Approx((record.X_WP.p - record.X_WT.p).norm()));
  CHECK(last.age == Approx(0.007));  // s: until newer contacts come
  CHECK(last.execution == Approx(12e-6));
  CHECK(last.lateness == Approx(3e-6));
  CHECK(last.active_contacts == 0);
  CHECK(last.predicted_contacts == 1);
}

TEST_CASE("Asked for anew, batches begin with the step at hand, without old steps") {
  ServoBench bench;
  begin_watched(bench);
  bench.tick_with(bench.update());
  bench.ticks(kBatch / 2);
  for (const bool on : {false, true}) {
    bench.send(protocol::Control{.telemetry = on, .holds = false, .X_WTarget = {}, .tuned = false});
    bench.tick_with(bench.update());
  }
  const std::uint64_t step = bench.ticks(kBatch - 1).step;
  CHECK(sent<protocol::Ticks>(bench).at(0).first_step == step + 1 - kBatch);
}

TEST_CASE("Each acknowledgement comes with the contacts: plane, point, separation and force") {
  ServoBench bench;
  begin_watched(bench);
  bench.device.state->F_hand = test::planar_wrench(2, 0, 0);
  bench.tick_with(bench.update({wall_ahead(0)}));
  bench.ticks(150);
  bench.link.queue.forget_sent();
  const TickRecord& record = bench.tick_with(bench.update({wall_ahead(0)}));
  const protocol::LocalState state = sent<protocol::LocalState>(bench).at(0);
  CHECK(state.step == record.step);
  REQUIRE(state.contacts.size() == 1);
  const protocol::LocalContactReport& contact = state.contacts.front();
  CHECK(contact.n_W == Vector3(-1, 0, 0));
  CHECK(contact.state == bench.servo->local_model()->contacts()[0].now.state);
  CHECK(contact.state != ContactState::kImpending);
  CHECK(contact.s == Approx(record.smallest_separation).margin(1e-6));     // m
  CHECK(contact.s == Approx(contact.n_W.dot(contact.p_W - contact.c_W)));  // m
  CHECK(contact.f_W.x() == Approx(record.F_env[0]).epsilon(1e-6));         // N
  CHECK(contact.f_W.x() < -1);                                             // N
}

TEST_CASE("Contacts of bodies are reported too, touching or not") {
  ServoBench bench;
  begin_watched(bench);
  ReportedContact above_table;
  above_table.identity = 7;
  above_table.a = {SideKind::kMovableBody, 3};
  above_table.b = {SideKind::kWorld, 0};
  above_table.n_W = {0, 0, 1};
  above_table.separation = 0.001;
  protocol::ContactUpdate update = bench.update({wall_ahead(0.002), above_table});
  update.bodies.push_back({.id = 3, .W = Matrix6::Identity()});
  bench.tick_with(update);
  const protocol::LocalState state = sent<protocol::LocalState>(bench).at(0);
  REQUIRE(state.contacts.size() == 2);
  CHECK(state.contacts[1].identity == 7);
  CHECK(state.contacts[1].a.kind == SideKind::kMovableBody);
  CHECK(state.contacts[1].s > 0);
}

}  // namespace
}  // namespace hlm::server
