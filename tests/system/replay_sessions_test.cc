// Whatever happens in a session, its recording comes back bit for bit: random sessions in virtual
// time, with stalls of either side, loss, floods, faults, stops, restarts, clutch and bad devices,
// with and without shapes, whose scenes come into force late.
#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <thread>

#include <unistd.h>

#include "hlm/haptic_server/loop/periodic_loop.h"
#include "hlm/haptic_server/scene/loader_thread.h"
#include "hlm/protocol/transport/udp_socket.h"
#include "hlm/tools/replay/live_replay.h"
#include "hlm/tools/replay/offline_replay.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/virtual_session.h"

namespace hlm::test {
namespace {

std::filesystem::path capture_path(const std::string& name) {
  return std::filesystem::temp_directory_path() /
         ("replay_" + std::to_string(::getpid()) + "_" + name);
}

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
      : random_(seed), path_(capture_path(std::to_string(seed))), options_(draw_options(seed)) {}
  ~RandomSession() { std::filesystem::remove(path_); }
  RandomSession(const RandomSession&) = delete;
  RandomSession& operator=(const RandomSession&) = delete;

  /// Records a session of a second or so, and plays it.
  std::vector<server::OfflineResult> record_and_replay() {
    {
      VirtualSession session(options_, [this](const server::TickRecord& record) {
        recorded_[record.time] = outcome_of(record);
      });
      protocol::CaptureWriter writer(path_);
      const int events = random_.integer(3, 10);
      for (int i = 0; i < events; ++i) {
        happen(session);
        session.run(random_.uniform(0.01, 0.15));
        has_had_scene_ |= session.servo().scene_exchange().number > 0;
        session.server_link().drain(writer);
      }
      REQUIRE(session.server_link().lost() == 0);
    }
    auto recording = server::Recording::open(path_);
    REQUIRE(recording);
    return server::replay_offline(*recording, options_.servo, 0, nullptr,
                                  [this](const server::TickRecord& record, const server::Servo&) {
                                    const auto was = recorded_.find(record.time);
                                    const bool same =
                                        was != recorded_.end() && was->second == outcome_of(record);
                                    if (!same && !first_other_tick_)
                                      first_other_tick_ = record.time;
                                  });
  }
  /// When the first tick began that came out otherwise, s; also without an answer to anybody.
  const std::optional<double>& first_other_tick() const { return first_other_tick_; }
  /// Whether shapes of the client were in force.
  bool has_had_scene() const { return has_had_scene_; }

 private:
  /// What came out of a tick.
  struct Outcome {
    ServerState server;
    Fault fault;
    std::uint64_t session;
    std::uint64_t step;
    Vector3 p_WP;
    Wrench F_command;

    bool operator==(const Outcome&) const = default;
  };
  static Outcome outcome_of(const server::TickRecord& record) {
    return {record.server, record.fault,  record.session,
            record.step,   record.X_WP.p, record.F_command};
  }

  VirtualSessionOptions draw_options(std::uint64_t seed) {
    VirtualSessionOptions options;
    options.recorded = true;
    options.seed = seed;
    if (random_.integer(0, 1) == 1) {
      options.world = repository_world("push.sdf");
      options.tool = "pusher";
    }
    options.frame.shapes = random_.integer(0, 1) == 1;
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
    switch (random_.integer(0, 14)) {
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
      case 13:
        return session.server(0).idle(static_cast<std::uint64_t>(random_.integer(1, 300)));
      case 14:  // The scene takes too long, or no more.
        return session.server(0).take(random_.uniform(0, 0.004));
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
  bool has_had_scene_ = false;
  std::map<double, Outcome> recorded_;  ///< By their beginnings, s.
  std::optional<double> first_other_tick_;
};

void replay_sessions(std::uint64_t first, std::uint64_t count) {
  std::size_t states = 0;
  std::size_t sessions = 0;
  std::size_t with_scenes = 0;
  for (std::uint64_t seed = first; seed < first + count; ++seed) {
    RandomSession random_session(seed);
    const auto results = random_session.record_and_replay();
    if (random_session.first_other_tick()) {
      FAIL_CHECK("seed " << seed << ": another tick at " << *random_session.first_other_tick()
                         << " s");
    }
    if (random_session.has_had_scene()) ++with_scenes;
    for (const server::OfflineResult& result : results) {
      ++sessions;
      states += result.compared;
      const bool is_whole = result.incomplete == 0 && result.missing_scene.empty();
      if (result.equal == result.compared && is_whole) continue;
      FAIL_CHECK("seed " << seed << ": " << result.equal << " of " << result.compared
                         << " equal, first difference at step "
                         << result.first_difference.value_or(0) << ' ' << result.missing_scene);
    }
  }
  WARN(sessions << " sessions, of " << with_scenes << " servers with scenes, " << states
                << " states from seed " << first << " on");
  CHECK(sessions >= count / 2);
  CHECK(states >= 10 * count);
  CHECK(with_scenes >= count / 5);
}

/// A tool that pushes a movable body for seconds, with all shapes at the server.
class ShapeSession {
 public:
  /// idle: ticks without a scene at first.
  explicit ShapeSession(std::uint64_t idle) : idle_(idle) {
    options_.world = repository_world("push.sdf");
    options_.tool = "pusher";
    options_.recorded = true;
    options_.frame.shapes = true;
    options_.link = {.delay = 0.01, .jitter = 0.01, .loss = 0.1};
    options_.hand = constant_push(force(2, 0.05));
  }
  ~ShapeSession() { std::filesystem::remove(path_); }
  ShapeSession(const ShapeSession&) = delete;
  ShapeSession& operator=(const ShapeSession&) = delete;

  void record() {
    protocol::CaptureWriter writer(path_);
    VirtualSession session(options_, [&](const server::TickRecord& record) {
      if (record.active_contacts > 0) ++touching_;
    });
    session.server(0).idle(idle_);
    for (int i = 0; i < 30; ++i) {
      session.run(0.1);
      session.server_link().drain(writer);
    }
    REQUIRE(session.server_link().lost() == 0);
    REQUIRE(session.servo().scene_exchange().number == 1);
    REQUIRE(touching_ > 2000);
    CHECK(session.last().scene == 1);
    CHECK(session.last().placements > 5);
    CHECK(session.last().pieces >= session.last().placements);
  }

  const std::filesystem::path& path() const { return path_; }
  const VirtualSessionOptions& options() const { return options_; }
  /// Number of the first tick that had a scene.
  std::uint64_t first_tick_with_scene() const {
    auto recording = server::Recording::open(path_);
    REQUIRE(recording);
    server::RecordedTick tick;
    while (recording->next(tick)) {
      if (tick.note.scene.number > 0) return tick.note.tick;
    }
    return 0;
  }

 private:
  std::uint64_t idle_;
  std::filesystem::path path_ = capture_path("shapes");
  VirtualSessionOptions options_;
  std::size_t touching_ = 0;
};

TEST_CASE("Random sessions with stalls, loss, floods, faults and restarts replay bit for bit") {
  replay_sessions(1000 * random_seed(), 100);
}

TEST_CASE("A session with shapes and a movable body replays bit for bit, its scene late or not") {
  const auto idle = static_cast<std::uint64_t>(GENERATE(0, 1500));
  ShapeSession session(idle);
  session.record();
  CHECK(session.first_tick_with_scene() >= idle);
  CHECK(session.first_tick_with_scene() < idle + 200);
  auto recording = server::Recording::open(session.path());
  REQUIRE(recording);
  std::size_t touching = 0;
  const auto results =
      server::replay_offline(*recording, session.options().servo, 0, nullptr,
                             [&](const server::TickRecord& record, const server::Servo&) {
                               touching += record.active_contacts > 0 ? 1 : 0;
                             });
  REQUIRE(results.size() == 1);
  CHECK(results[0].compared > 60);
  CHECK(results[0].equal == results[0].compared);
  CHECK(results[0].missing_scene.empty());
  CHECK(touching > 500);
}

TEST_CASE("A capture without notes brings a session with shapes back, too") {
  ShapeSession session(static_cast<std::uint64_t>(GENERATE(0, 1500)));
  session.record();
  const auto recorded = server::read_sessions(session.path());
  REQUIRE(recorded.size() == 1);
  const auto replay = [&](const server::RecordedSession& of) {
    const VirtualSessionOptions& options = session.options();
    const double dt = 1 / options.servo.rate;
    const auto device = server::with_hand_observer(
        std::make_unique<server::SimulatedDevice>(options.device, options.hand, dt),
        options.observer, dt);
    return server::replay_offline(of, options.servo, 0, *device,
                                  [](const server::TickRecord&, const server::Servo&) {});
  };
  const server::OfflineResult same = replay(recorded[0]);
  CHECK(same.compared > 60);
  CHECK(same.equal == same.compared);
  CHECK(same.missing_scene.empty());

  server::RecordedSession lacking = recorded[0];
  REQUIRE(lacking.chunks.erase(0) == 1);
  const server::OfflineResult other = replay(lacking);
  CHECK(other.first_difference);
  CHECK(other.missing_scene == "scene 1: the recording lacks its commit, or a chunk before that");
}

/// A server in real time on this machine, until it goes.
class LiveServer {
 public:
  LiveServer(const VirtualSessionOptions& options, bool takes_scenes)
      : device_(options.device, options.hand, 1 / options.servo.rate),
        session_(socket_, {}),
        servo_(std::make_unique<server::Servo>(options.servo, 0, session_, device_,
                                               takes_scenes ? &loader_ : nullptr)),
        loading_(loader_),
        loop_({.rate = options.servo.rate}),
        thread_([this] {
          loop_.run([this](const server::Timing& timing) noexcept {
            servo_->tick(timing);
            if (stop_) loop_.stop();
          });
        }) {}
  ~LiveServer() { stop_ = true; }

  protocol::Endpoint endpoint() const { return socket_.local(); }

 private:
  protocol::UdpSocket socket_{protocol::Endpoint{.address = 0x7F000001}};
  server::SimulatedDevice device_;
  protocol::ServerSession session_;
  server::SceneLoader loader_;
  std::unique_ptr<server::Servo> servo_;
  server::SceneLoaderThread loading_;
  server::PeriodicLoop loop_;
  std::atomic<bool> stop_ = false;
  std::jthread thread_;  ///< The last, so that it ends first.
};

TEST_CASE("A live replay brings the shapes, and says why a server has not the recorded scenes") {
  ShapeSession session(0);
  session.record();
  auto recorded = server::read_sessions(session.path());
  REQUIRE(recorded.size() == 1);
  const auto replay = [&](bool takes_scenes) {
    const LiveServer server(session.options(), takes_scenes);
    protocol::UdpSocket socket(protocol::Endpoint{});
    return server::replay_live(
        recorded[0], socket, {.server = server.endpoint(), .speed = 2},
        [](const protocol::Welcome&) {}, [] { return false; });
  };
  SECTION("as they were") {
    const server::LiveResult result = replay(true);
    CHECK(result.compared > 30);
    CHECK(result.other_scene < result.compared / 2);
    CHECK(result.scene_fault.empty());
  }
  SECTION("where the capture lacks a chunk") {
    recorded[0].chunks = {{1, recorded[0].chunks.at(0)}};
    const server::LiveResult result = replay(true);
    CHECK(result.other_scene > result.compared / 2);
    CHECK(result.scene_fault == "the capture lacks chunk 0");
  }
  SECTION("where the server takes none") {
    const server::LiveResult result = replay(false);
    CHECK(result.other_scene > result.compared / 2);
    CHECK_THAT(result.scene_fault, Catch::Matchers::ContainsSubstring("scene"));
  }
  SECTION("where it refuses them") {
    recorded[0].chunks.at(0).data.front() = std::byte{9};
    const server::LiveResult result = replay(true);
    CHECK(result.other_scene > result.compared / 2);
    CHECK_THAT(result.scene_fault, Catch::Matchers::ContainsSubstring("9"));
  }
}

TEST_CASE("Ten thousand random sessions replay bit for bit", "[.survey]") {
  replay_sessions(1'000'000 * random_seed(), 10'000);
}

}  // namespace
}  // namespace hlm::test
