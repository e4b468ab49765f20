// Whatever happens in a session, its recording comes back bit for bit: random sessions in virtual
// time, with stalls of either side, loss, floods, faults, stops, restarts, clutch and bad devices.
#include <cstdlib>
#include <filesystem>
#include <memory>

#include <unistd.h>

#include "hlm/replay/offline_replay.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/virtual_session.h"

namespace hlm::test {
namespace {

/// The simulated device, and what a real one does besides: faults, late states, clutch, buttons.
class TemperamentalDevice final : public server::Device {
 public:
  TemperamentalDevice(std::unique_ptr<server::Device> device, std::uint64_t seed)
      : device_(std::move(device)), random_(seed), is_calm_(random_.integer(0, 2) > 0) {}

  std::string_view name() const noexcept override { return device_->name(); }
  const server::DeviceRatings& ratings() const noexcept override { return device_->ratings(); }
  bool measures_hand_wrench() const noexcept override { return device_->measures_hand_wrench(); }
  bool observes_hand_wrench() const noexcept override { return device_->observes_hand_wrench(); }
  void align(const Pose& X_WH) noexcept override { device_->align(X_WH); }
  void enable() noexcept override { device_->enable(); }
  void disable() noexcept override { device_->disable(); }
  server::GuidedHand* guided_hand() noexcept override { return device_->guided_hand(); }
  std::optional<server::DeviceState> read() noexcept override {
    std::optional<server::DeviceState> state = device_->read();
    if (is_calm_ || !state) return state;
    if (happens(0.0003)) return std::nullopt;
    if (happens(0.01)) clutched_ = !clutched_;
    if (happens(0.01)) buttons_ ^= 1u << random_.integer(0, 3);
    if (happens(0.01)) health_ = static_cast<server::DeviceHealth>(random_.integer(0, 3));
    state->clutched = clutched_;
    state->buttons = buttons_;
    state->health = health_;
    state->gripper = 0.5;
    if (happens(0.01)) state->F_hand.reset();
    if (happens(0.0002)) state->X_WD.p.x() = std::numeric_limits<double>::quiet_NaN();
    if (late_ && happens(0.2)) return late_;
    return late_ = state;
  }
  bool write(const Wrench& F) noexcept override {
    const bool written = device_->write(F);
    return written && (is_calm_ || !happens(0.0003));
  }

 private:
  bool happens(double probability) { return random_.uniform(0, 1) < probability; }

  std::unique_ptr<server::Device> device_;
  Random random_;
  bool is_calm_;
  bool clutched_ = false;
  std::uint32_t buttons_ = 0;
  server::DeviceHealth health_ = server::DeviceHealth::kGood;
  std::optional<server::DeviceState> late_;
};

class RandomSession {
 public:
  explicit RandomSession(std::uint64_t seed)
      : random_(seed),
        path_(std::filesystem::temp_directory_path() /
              ("replay_" + std::to_string(::getpid()) + "_" + std::to_string(seed))),
        options_(draw_options(seed)) {}
  ~RandomSession() { std::filesystem::remove(path_); }
  RandomSession(const RandomSession&) = delete;
  RandomSession& operator=(const RandomSession&) = delete;

  /// Records a session of a second or so, and plays it.
  std::vector<server::OfflineResult> record_and_replay() {
    {
      VirtualSession session(options_);
      protocol::CaptureWriter writer(path_);
      const int events = random_.integer(3, 10);
      for (int i = 0; i < events; ++i) {
        happen(session);
        session.run(random_.uniform(0.01, 0.15));
        session.server_link().drain(writer);
      }
      REQUIRE(session.server_link().lost() == 0);
    }
    auto recording = server::Recording::open(path_);
    REQUIRE(recording);
    return server::replay_offline(*recording, options_.servo, 0, nullptr,
                                  [](const server::TickRecord&) {});
  }

 private:
  VirtualSessionOptions draw_options(std::uint64_t seed) {
    VirtualSessionOptions options;
    options.recorded = true;
    options.seed = seed;
    if (random_.integer(0, 1) == 1) {
      options.world = repository_world("push.sdf");
      options.tool = "pusher";
    }
    options.hand = constant_push(force(random_.uniform(-3, 3), random_.uniform(-3, 3)));
    options.device.measures_hand_wrench = random_.integer(0, 1) == 1;
    options.servo.rate = random_.integer(0, 1) == 1 ? 1000 : 512;
    options.link = {.delay = random_.uniform(0, 0.03),
                    .jitter = random_.uniform(0, 0.02),
                    .loss = random_.uniform(0, 0.2),
                    .reordering = random_.uniform(0, 0.1),
                    .duplication = random_.uniform(0, 0.1)};
    options.wrap_device = [seed](std::unique_ptr<server::Device> device) {
      return std::make_unique<TemperamentalDevice>(std::move(device), seed);
    };
    return options;
  }

  void happen(VirtualSession& session) {
    switch (random_.integer(0, 12)) {
      case 0:  // Each side stalls, some shorter and some longer than it may.
        return session.server(0).stall(static_cast<std::uint64_t>(random_.integer(1, 400)));
      case 1:
        return session.run_server_alone(random_.uniform(0.01, 0.7));
      case 2:
        return session.server(0).intervene(Intervention::kStop);
      case 10:
        return session.server(0).intervene(Intervention::kClear);
      case 11:
        return session.server(0).intervene(Intervention::kHalted, random_.integer(1, 3));
      case 12:
        return session.server(0).intervene(Intervention::kUnguarded, random_.integer(1, 700));
      case 3:
        return flood(session);
      case 4:
        return session.client().close(session.now());
      case 5:
      case 6:
        return control(session);
      default:
        return session.server(0).stall(static_cast<std::uint64_t>(random_.integer(0, 3)));
    }
  }

  void control(VirtualSession& session) {
    protocol::Control control{.telemetry = random_.integer(0, 1) == 1,
                              .holds = random_.integer(0, 1) == 1,
                              .X_WTarget = {},
                              .tuned = random_.integer(0, 1) == 1};
    control.tuning.stiffness = random_.uniform(500, 8000);
    session.client().control(control);
  }

  /// From the client's own address: what is no datagram, and what is of no session.
  void flood(VirtualSession& session) {
    for (int i = random_.integer(10, 400); i > 0; --i) {
      std::array<std::byte, 40> bytes;
      for (std::byte& byte : bytes) byte = static_cast<std::byte>(random_.integer(0, 255));
      session.network().client().send(
          MemoryNetwork::kServer,
          std::span(bytes).first(static_cast<std::size_t>(random_.integer(0, 40))));
    }
  }

  Random random_;
  std::filesystem::path path_;
  VirtualSessionOptions options_;
};

void replay_sessions(std::uint64_t first, std::uint64_t count) {
  std::size_t states = 0;
  std::size_t sessions = 0;
  for (std::uint64_t seed = first; seed < first + count; ++seed) {
    for (const server::OfflineResult& result : RandomSession(seed).record_and_replay()) {
      ++sessions;
      states += result.compared;
      if (result.equal == result.compared && result.incomplete == 0) continue;
      FAIL_CHECK("seed " << seed << ": " << result.equal << " of " << result.compared
                         << " equal, first difference at step "
                         << result.first_difference.value_or(0));
    }
  }
  WARN(sessions << " sessions, " << states << " states from seed " << first << " on");
  CHECK(sessions >= count / 2);
  CHECK(states >= 10 * count);
}

TEST_CASE("Random sessions with stalls, loss, floods, faults and restarts replay bit for bit") {
  replay_sessions(1000 * random_seed(), 100);
}

TEST_CASE("Ten thousand random sessions replay bit for bit", "[.survey]") {
  replay_sessions(1'000'000 * random_seed(), 10'000);
}

}  // namespace
}  // namespace hlm::test
