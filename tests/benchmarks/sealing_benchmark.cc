// What sealing costs: one packet, one handshake, and a whole tick that takes an update and answers
// it.
#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>
#include <vector>

#include <benchmark/benchmark.h>

#include "hlm/haptic_server/device/simulated_device.h"
#include "hlm/haptic_server/loop/servo.h"
#include "hlm/protocol/client_session.h"
#include "hlm/protocol/sealing/sealed_client_link.h"
#include "hlm/protocol/sealing/sealed_server_link.h"
#include "hlm/protocol/transport/memory_network.h"

namespace hlm::server {
namespace {

using protocol::MemoryNetwork;

constexpr double kPeriod = 1e-3;  // s

/// A rigid tool in a square hole: contacts on all four walls.
protocol::ContactUpdate update_with(int contacts, const Configuration& q) {
  protocol::ContactUpdate update;
  update.ve_period = kPeriod;
  update.q_VE = q;
  update.v_VE = Velocity::Zero(6);
  for (int i = 0; i < contacts; ++i) {
    const double angle = 1.5707963267948966 * (i % 4);
    ReportedContact contact;
    contact.identity = static_cast<std::uint64_t>(i);
    contact.n_W = {std::cos(angle), std::sin(angle), 0};
    contact.p_WC = -0.02 * contact.n_W + Vector3(0, 0, 0.002 * (i / 4 - contacts / 8));
    update.contacts.push_back(contact);
  }
  return update;
}

/// Server and client in one process, sealed or not.
class Pair {
 public:
  Pair(bool sealed, const ToolDescription& tool) {
    const protocol::noise::Key key = protocol::noise::random_key_pair().secret_key;
    const auto clock = [this] { return network_.time(); };
    if (sealed) {
      server_end_.emplace(network_.server(), key, clock);
      client_end_.emplace(network_.client(), MemoryNetwork::kServer, key, clock);
    }
    session_.emplace(sealed ? *server_end_ : network_.server(), protocol::ServerSessionOptions{});
    servo_.emplace(ServoOptions{}, 0, *session_, device_);
    protocol::ClientSessionOptions options;
    options.server = MemoryNetwork::kServer;
    options.hello.tool = tool;
    options.hello.q = ToolModel(tool).neutral();
    client_.emplace(sealed ? *client_end_ : network_.client(), options);
    while (!client_->active()) tick(nullptr);
  }

  /// One period later; `update` is sent before, null: none. How long the server's tick takes, s.
  double tick(const protocol::ContactUpdate* update) {
    ++timing_.tick;
    timing_.scheduled = timing_.begin = static_cast<double>(timing_.tick) * kPeriod;
    network_.set_time(timing_.begin);
    client_->poll(timing_.begin);
    if (update != nullptr) client_->send(timing_.begin, *update);
    const auto begin = std::chrono::steady_clock::now();
    record_ = servo_->tick(timing_);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }
  const TickRecord& record() const { return record_; }

 private:
  MemoryNetwork network_;
  std::optional<protocol::SealedServerLink> server_end_;
  std::optional<protocol::SealedClientLink> client_end_;
  SimulatedDevice device_{SimulatedDeviceOptions{}, HandScript{}, kPeriod};
  std::optional<protocol::ServerSession> session_;
  std::optional<Servo> servo_;
  std::optional<protocol::ClientSession> client_;
  Timing timing_;
  TickRecord record_;
};

/// 64 contacts take eight datagrams. Updates come at 60 Hz, or with every tick.
void ServoTick(benchmark::State& state) {
  ToolDescription tool;
  tool.links.emplace_back().I_LCom = 2e-3 * Matrix3::Identity();
  tool.links[0].joint = JointType::kFree;
  const auto pair = std::make_unique<Pair>(state.range(0) != 0, tool);
  const protocol::ContactUpdate update = update_with(64, ToolModel(tool).neutral());
  const int every = static_cast<int>(state.range(1));
  for (int i = 0; i < 300; ++i) pair->tick(i % every == 0 ? &update : nullptr);
  int i = 0;
  std::vector<double> durations;
  for (auto _ : state) {
    durations.push_back(pair->tick(i++ % every == 0 ? &update : nullptr));
    state.SetIterationTime(durations.back());
  }
  std::ranges::nth_element(durations, durations.begin() + std::ssize(durations) / 2);
  state.counters["median_us"] = 1e6 * durations[durations.size() / 2];
  if (pair->record().active_contacts + pair->record().predicted_contacts != 64) {
    state.SkipWithError("the local model does not have 64 contacts");
  }
}
BENCHMARK(ServoTick)
    ->ArgNames({"sealed", "update_every"})
    ->ArgsProduct({{0, 1}, {1, 17}})
    ->UseManualTime()
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace hlm::server

namespace hlm::protocol {
namespace {

void OpenPacket(benchmark::State& state) {
  const SealedChannel::Keys keys{noise::random_key_pair().secret_key,
                                 noise::random_key_pair().secret_key};
  SealedChannel sender(1, 2, keys);
  DatagramBytes text;
  text.resize(static_cast<std::size_t>(state.range(0)));
  for (auto _ : state) {
    SealedChannel receiver(2, 1, {keys.receive, keys.send});
    benchmark::DoNotOptimize(receiver.open(view(sender.seal(view(text))), text));
  }
}
BENCHMARK(OpenPacket)->ArgName("bytes")->Arg(41)->Arg(1168)->Unit(benchmark::kMicrosecond);

/// A first message from somebody without the key: what a flood of them costs each.
void RefuseFirstMessage(benchmark::State& state) {
  const noise::Handshake start(kPrologue, noise::random_key_pair().secret_key);
  std::array<std::byte, noise::Handshake::message_size(kIndexSize)> message{};
  std::array<std::byte, kIndexSize> payload{};
  for (auto _ : state) {
    noise::Handshake handshake = start;
    benchmark::DoNotOptimize(handshake.read_first(message, payload));
  }
}
BENCHMARK(RefuseFirstMessage)->Unit(benchmark::kMicrosecond);

/// The server's whole part of a handshake.
void AnswerFirstMessage(benchmark::State& state) {
  const noise::Handshake start(kPrologue, noise::random_key_pair().secret_key);
  std::array<std::byte, noise::Handshake::message_size(kIndexSize)> first{};
  std::array<std::byte, noise::Handshake::message_size(kIndexSize)> second{};
  std::array<std::byte, kIndexSize> payload{};
  noise::Handshake(start).write_first(noise::random_key_pair(), payload, first);
  for (auto _ : state) {
    noise::Handshake handshake = start;
    bool done = handshake.read_first(first, payload);
    done = done && handshake.write_second(noise::random_key_pair(), payload, second);
    benchmark::DoNotOptimize(handshake.split());
    if (!done) state.SkipWithError("the handshake failed");
  }
}
BENCHMARK(AnswerFirstMessage)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace hlm::protocol
