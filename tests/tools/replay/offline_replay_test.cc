// A recorded session on the server's own tick: bit for bit where the capture is whole, and where
// it is not, the replay says from where on.
#include "hlm/tools/replay/offline_replay.h"

#include <filesystem>
#include <functional>

#include "hlm/haptic_server/device/simulated_device.h"
#include "hlm/protocol/transport/recording_link.h"
#include "tests/haptic_server/loop/servo_bench.h"
#include "tests/protocol/transport/capture_files.h"
#include "tests/support/catch.h"
#include "tests/support/contacts.h"

namespace hlm::server {
namespace {

using protocol::Endpoint;
using protocol::view;

constexpr Endpoint kServer{.address = 0x0A000001, .port = 47800};
constexpr Endpoint kClient{.address = 0x0A000002, .port = 50000};
constexpr std::uint64_t kConfiguration = 77;
constexpr double kWall = 0.01;  // m
constexpr std::size_t kContacts = 12;
constexpr int kFrame = 20;  // ticks from one update to the next
constexpr int kUpdates = 50;

SimulatedDevice pushed_device() {
  Push push;
  push.constant = test::planar_wrench(1.5, 0.5, 0);
  return {{}, {{{1.0, push}}, AfterLastSegment::kHold}, 1e-3};
}

/// The wall for a tool at q, in more contacts than one datagram holds.
ReportedContacts wall_for(const Configuration& q) {
  ReportedContacts contacts = test::distinct_contacts(kContacts);
  double y = q[1];
  for (ReportedContact& contact : contacts) {
    contact.n_W = {-1, 0, 0};
    contact.p_WC = {kWall, y, 0};
    contact.separation = kWall - q[0];
    y += 2e-3;
  }
  return contacts;
}

/// A second of a session: the hand pushes the tool against a wall and along it. `keep` says which
/// datagrams the capture gets.
void record(const std::filesystem::path& path,
            const std::function<bool(const protocol::Header&)>& keep = {}) {
  test::QueueLink queue;
  std::int64_t time_ns = 0;
  protocol::RecordingLink link(queue, kServer, [&] { return time_ns; });
  protocol::ServerSession session(link, {.first_session_id = 5});
  SimulatedDevice device = pushed_device();
  const auto servo = std::make_unique<Servo>(ServoOptions{}, kConfiguration, session, device);

  protocol::Hello hello;
  hello.nonce = 1;
  hello.tool = test::planar_tool();
  hello.q = Vector3::Zero();
  queue.deliver(kClient, {.sequence = 1}, hello);
  Timing timing;
  std::uint64_t sequence = 0;
  for (int tick = 0; tick <= kFrame * kUpdates; ++tick) {
    timing.begin = 1e-3 * tick;
    time_ns = 1'000'000 * tick;
    servo->tick(timing);
    if (tick % kFrame != kFrame / 2) continue;
    // The environment's tool is where the proxy was when the latest state was sent.
    protocol::ContactUpdate update;
    update.q_VE = hello.q;
    update.v_VE = Vector3::Zero();
    update.compute_time = 0.002;
    if (sequence > 0) {
      const auto state = queue.last_sent<protocol::ProxyState>();
      update.q_VE = state.q;
      update.v_VE = state.v;
      update.echo_step = state.step;
    }
    update.contacts = wall_for(update.q_VE);
    queue.deliver(kClient, {.session = session.id(), .sequence = ++sequence}, update);
  }
  const std::filesystem::path whole = path.string() + ".whole";
  {
    protocol::CaptureWriter writer(whole);
    link.drain(writer);
  }
  protocol::CaptureReader reader(whole);
  protocol::CaptureWriter writer(path);
  while (const auto datagram = reader.next()) {
    protocol::Header header;
    REQUIRE_FALSE(decode_header(view(datagram->bytes), header));
    if (keep && !keep(header)) continue;
    writer.write(datagram->time_ns, datagram->from, datagram->to, view(datagram->bytes));
  }
  writer.flush();
}

OfflineResult replay(const std::filesystem::path& path, const ServoOptions& options = {}) {
  const std::vector<RecordedSession> sessions = read_sessions(path);
  REQUIRE(sessions.size() == 1);
  SimulatedDevice device = pushed_device();
  return replay_offline(sessions[0], options, kConfiguration, device,
                        [](const TickRecord&, const Servo&) {});
}

/// Step that the acknowledgement of this update names.
std::uint64_t step_of(std::uint64_t sequence) { return kFrame * (sequence - 1) + kFrame / 2 + 2; }

TEST_CASE("A whole capture comes back bit for bit, every step observed once") {
  const test::TemporaryDirectory directory;
  record(directory / "run.pcap");
  const std::vector<RecordedSession> sessions = read_sessions(directory / "run.pcap");
  SimulatedDevice device = pushed_device();
  std::uint64_t step = 0;
  bool touched = false;
  const OfflineResult result = replay_offline(sessions.at(0), {}, kConfiguration, device,
                                              [&](const TickRecord& record, const Servo&) {
                                                CHECK(record.step == ++step);
                                                CHECK(record.session == 5);
                                                touched |= record.active_contacts > 0;
                                              });
  CHECK(touched);
  CHECK(result.compared == kUpdates);
  CHECK(result.equal == kUpdates);
  CHECK(result.steps == step);
  CHECK(result.steps == step_of(kUpdates));
  CHECK(result.incomplete == 0);
  CHECK_FALSE(result.first_difference);
}

TEST_CASE("An update not whole in the capture is counted, and the first difference is its step") {
  const int missing_from = GENERATE(0, 1);  // part
  const test::TemporaryDirectory directory;
  // The tool is in contact: without this update the local contacts are older.
  record(directory / "run.pcap", [&](const protocol::Header& header) {
    return header.type != protocol::MessageType::kContactUpdate || header.envelope.sequence != 30 ||
           header.part < missing_from;
  });
  const OfflineResult result = replay(directory / "run.pcap");
  CHECK(result.compared == kUpdates);
  CHECK(result.incomplete == 1);
  CHECK(result.first_difference == step_of(30));
  CHECK(result.equal >= 29);
}

TEST_CASE("An update before any contact that the capture misses costs its own state alone") {
  const test::TemporaryDirectory directory;
  record(directory / "run.pcap", [](const protocol::Header& header) {
    return header.type != protocol::MessageType::kContactUpdate || header.envelope.sequence != 3;
  });
  const OfflineResult result = replay(directory / "run.pcap");
  CHECK(result.first_difference == step_of(3));
  CHECK(result.equal == kUpdates - 1);
}

TEST_CASE("An acknowledgement that the capture misses leaves the states before it equal") {
  const test::TemporaryDirectory directory;
  record(directory / "run.pcap", [](const protocol::Header& header) {
    return header.type != protocol::MessageType::kProxyState || header.envelope.sequence != 31;
  });
  const OfflineResult result = replay(directory / "run.pcap");
  CHECK(result.compared == kUpdates - 1);
  CHECK(result.equal >= 29);
  CHECK(result.incomplete == 0);
}

TEST_CASE("A capture cut in the middle of a packet comes back as far as it goes") {
  const test::TemporaryDirectory directory;
  const std::filesystem::path path = directory / "run.pcap";
  record(path);
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2 + 7);
  const OfflineResult result = replay(path);
  CHECK(result.compared > kUpdates / 3);
  CHECK(result.compared < kUpdates);
  CHECK(result.equal == result.compared);
  CHECK_FALSE(result.first_difference);
}

TEST_CASE("With other options the replay differs, and the capture names its configuration") {
  const test::TemporaryDirectory directory;
  record(directory / "run.pcap");
  CHECK(read_sessions(directory / "run.pcap").at(0).welcome.fingerprint == kConfiguration);
  ServoOptions softer;
  softer.local_model.stiffness = 3999;  // N/m
  const OfflineResult result = replay(directory / "run.pcap", softer);
  CHECK(result.first_difference);
  CHECK(result.equal < result.compared);
}

TEST_CASE("A session without updates is one step with nothing to compare") {
  const test::TemporaryDirectory directory;
  record(directory / "run.pcap", [](const protocol::Header& header) {
    return header.type == protocol::MessageType::kHello ||
           header.type == protocol::MessageType::kWelcome;
  });
  const OfflineResult result = replay(directory / "run.pcap");
  CHECK(result.steps == 1);
  CHECK(result.compared == 0);
}

}  // namespace
}  // namespace hlm::server
