// The server's tick, a hand that pushes the simulated device beyond the force limit, and whatever
// a client, or somebody else, may send.
#include <memory>

#include "hlm/haptic_server/device/simulated_device.h"
#include "hlm/haptic_server/loop/servo.h"
#include "tests/fuzz/deliveries.h"
#include "tests/fuzz/promises.h"
#include "tests/protocol/queue_link.h"

namespace hlm::fuzz {
namespace {

constexpr protocol::Endpoint kClient{.address = 0x0A000002, .port = 50000};
constexpr protocol::Endpoint kForeigner{.address = 0x0A000003, .port = 50000};
/// Of one input: enough for a session to begin, fall silent, fade and begin anew.
constexpr int kMostTicks = 500;
constexpr std::uint64_t kGap = 300;  // periods, above the largest that is endured

server::HandScript pushing_hand() {
  server::Push push;
  push.constant << 20, 5, 0, 0, 0, 0.1;
  return {{{1.0, push}}, server::AfterLastSegment::kHold};
}

/// Rule, controller and device are drawn from the first bytes.
server::ServoOptions options_of(Input& input) {
  server::ServoOptions options;
  options.local_model.update_rule = static_cast<UpdateRule>(input.u8() % kWords<UpdateRule>.size());
  options.controller = static_cast<ControllerKind>(input.u8() % kWords<ControllerKind>.size());
  return options;
}

server::SimulatedDeviceOptions device_of(Input& input) {
  server::SimulatedDeviceOptions options;
  if (input.u8() % 2 == 1) options.freedom = server::DeviceFreedom::kSpatial;
  return options;
}

class Server {
 public:
  explicit Server(Input& input)
      : options_(options_of(input)),
        device_(device_of(input), pushing_hand(), 1 / options_.rate),
        servo_(std::make_unique<server::Servo>(options_, 0, session_, device_)) {}

  void take(Delivery delivery) {
    for (int i = 0; i < delivery.wait; ++i) tick(0);
    if (delivery.is(Delivery::kFitted)) fitter_.fit(session_.id(), 0, delivery.bytes);
    link_.deliver(delivery.is(Delivery::kForeign) ? kForeigner : kClient, delivery.bytes);
    tick(delivery.is(Delivery::kAfterGap) ? kGap : 0);
  }
  bool is_over() const { return ticks_ >= kMostTicks; }

  void tick(std::uint64_t missed) {
    ++ticks_;
    timing_.missed = missed;
    timing_.tick += 1 + missed;
    timing_.overruns += missed;
    timing_.scheduled = timing_.begin = static_cast<double>(timing_.tick) / options_.rate;
    check(servo_->tick(timing_));
    demand_sent_well(link_.sent());
    link_.forget_sent();
  }

 private:
  void check(const server::TickRecord& record) {
    const server::DeviceRatings& rated = device_.ratings();
    const Wrench& F = record.F_command;
    demand(F.allFinite(), "a command is finite");
    demand(F.head<3>().norm() <= std::min(options_.limits.max_force, rated.max_force) + 1e-9,
           "a force is within the limit");
    demand(F.tail<3>().norm() <= std::min(options_.limits.max_torque, rated.max_torque) + 1e-9,
           "a torque is within the limit");
    const bool has_session = record.step > 0;
    const bool is_cut = record.fault != Fault::kNone || record.session != session_before_;
    if (has_session && !is_cut) {
      const double most = std::min(options_.limits.max_force_rate, rated.max_force_rate);
      demand((F - F_before_).head<3>().norm() <= most / options_.rate + 1e-9,
             "a force changes no faster than it may");
    }
    if (!has_session || record.fault != Fault::kNone) demand(F.isZero(0), "no session, no force");
    accepted += record.adopted > 0;
    F_before_ = F;
    session_before_ = record.session;
  }

  server::ServoOptions options_;
  test::QueueLink link_;
  protocol::ServerSession session_{link_, {.first_session_id = 1}};
  server::SimulatedDevice device_;
  std::unique_ptr<server::Servo> servo_;
  server::Timing timing_;
  Fitter fitter_;
  Wrench F_before_ = Wrench::Zero();
  std::uint64_t session_before_ = 0;
  int ticks_ = 0;
};

}  // namespace
}  // namespace hlm::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace hlm::fuzz;
  Input input(data, size);
  Server server(input);
  while (!input.empty() && !server.is_over()) server.take(read_delivery(input));
  server.tick(0);
  return 0;
}
