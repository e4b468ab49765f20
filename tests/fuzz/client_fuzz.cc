// The client library, and whatever a server, or somebody else, may send to it.
#include "hlm/client/haptic_client.h"
#include "tests/fuzz/deliveries.h"
#include "tests/fuzz/promises.h"
#include "tests/protocol/queue_link.h"
#include "tests/protocol/sample_messages.h"

namespace hlm::fuzz {
namespace {

constexpr protocol::Endpoint kServer{.address = 0x0A000001, .port = 47800};
constexpr protocol::Endpoint kForeigner{.address = 0x0A000003, .port = 47800};
constexpr double kFrame = 1.0 / 60;  // s

HapticClientOptions options() {
  const protocol::Hello hello = test::planar_hello();
  return {.server = kServer, .tool = hello.tool, .q = hello.q, .nonce = 1};
}

class Telemetry final : public protocol::TelemetryObserver {
 public:
  void observe(const protocol::Ticks& ticks) override {
    for (const protocol::TickSignals& tick : ticks.ticks) {
      demand(tick.F_command.allFinite(), "a tick that is shown is finite");
    }
  }
  void observe(const protocol::LocalState& state) override {
    for (const protocol::LocalContactReport& contact : state.contacts) {
      demand(contact.p_W.allFinite() && contact.f_W.allFinite(), "a contact shown is finite");
    }
  }
};

class Client {
 public:
  Client() : client_(link_, with_telemetry()) {
    protocol::Control control;
    control.telemetry = true;
    client_.control(control);
    frame();
  }

  void take(Delivery delivery) {
    const double late = delivery.is(Delivery::kAfterGap) ? 1 : 0;
    now_ += 1e-3 * delivery.wait + late;
    if (delivery.is(Delivery::kFitted)) fitter_.fit(kSession, nonce_, delivery.bytes);
    link_.deliver(delivery.is(Delivery::kForeign) ? kForeigner : kServer, delivery.bytes);
    frame();
  }

 private:
  static constexpr std::uint64_t kSession = 7;

  HapticClientOptions with_telemetry() {
    HapticClientOptions all = options();
    all.telemetry = &telemetry_;
    return all;
  }

  void frame() {
    const HapticClient::Inbox inbox = client_.poll(now_);
    if (inbox.state != nullptr) follow(*inbox.state);
    for (const protocol::BodyImpulse& due : client_.take_impulses(kFrame)) {
      demand(due.P_W.allFinite(), "an impulse is finite");
    }
    client_.sample(now_, q_, v_, kFrame);
    client_.send(now_, contacts_);
    demand(std::isfinite(client_.round_trip()), "a round trip is finite");
    remember_nonce();
    demand_sent_well(link_.sent());
    link_.forget_sent();
  }

  void follow(const protocol::ProxyState& state) {
    ++accepted;
    demand_in_range(state);
    demand(state.q.size() == q_.size() && state.v.size() == v_.size(), "a state fits the tool");
    // What no environment has is not followed (VirtualTool::can_follow).
    if (state.q.cwiseAbs().maxCoeff() < 1e3 && state.v.cwiseAbs().maxCoeff() < 1e3) {
      q_ = state.q;
      v_ = state.v;
    }
  }

  void remember_nonce() {
    for (const protocol::Datagram& sent : link_.sent()) {
      const auto stable = protocol::read_stable_part(protocol::view(sent.bytes));
      if (stable && stable->type == protocol::MessageType::kHello) nonce_ = stable->nonce;
    }
  }

  test::QueueLink link_;
  Telemetry telemetry_;
  HapticClient client_;
  Fitter fitter_;
  std::uint64_t nonce_ = 1;
  double now_ = 0;
  Configuration q_ = options().q;
  Velocity v_ = Velocity::Zero(options().tool.dof());
  ReportedContacts contacts_ = test::planar_update(2).contacts;
};

}  // namespace
}  // namespace hlm::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace hlm::fuzz;
  Input input(data, size);
  Client client;
  while (!input.empty()) client.take(read_delivery(input));
  return 0;
}
