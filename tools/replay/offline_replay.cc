#include "hlm/tools/replay/offline_replay.h"

#include <algorithm>
#include <bit>
#include <deque>
#include <iterator>
#include <memory>
#include <unordered_map>

#include "hlm/protocol/codec.h"
#include "hlm/protocol/server_session.h"
#include "hlm/tools/replay/played_scenes.h"

namespace hlm::server {
namespace {

using protocol::Datagram;
using protocol::DatagramBytes;
using protocol::ProxyState;

bool is_whole(const RecordedUpdate& recorded) {
  protocol::ContactUpdate update;
  return !decode(recorded.parts, update);
}

/// Delivers the datagrams of one tick after the other, and keeps the answers.
class PlayedLink final : public protocol::DatagramLink {
 public:
  void begin_tick(std::span<const Datagram> received) {
    waiting_ = received;
    answers_.clear();
  }

  bool receive(Datagram& datagram) noexcept override {
    if (waiting_.empty()) return false;
    datagram = waiting_.front();
    waiting_ = waiting_.subspan(1);
    return true;
  }

  void send(const protocol::Endpoint&, std::span<const std::byte> bytes) noexcept override {
    ProxyState state;
    if (!decode(bytes, state)) answers_.push_back(state);
  }

  const std::vector<ProxyState>& answers() const { return answers_; }

 private:
  std::span<const Datagram> waiting_;
  std::vector<ProxyState> answers_;
};

template <class Vector>
bool same_bits(const Vector& a, const Vector& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](double x, double y) {
           return std::bit_cast<std::uint64_t>(x) == std::bit_cast<std::uint64_t>(y);
         });
}

/// Whether the physics of two acknowledgements agree.
bool same_bits(const ProxyState& a, const ProxyState& b) {
  return a.step == b.step && a.acknowledged == b.acknowledged && a.scene == b.scene &&
         same_bits(a.q, b.q) && same_bits(a.v, b.v) && same_bits(a.X_WD.p, b.X_WD.p) &&
         same_bits(a.X_WD.R.coeffs(), b.X_WD.R.coeffs()) && same_bits(a.F_env, b.F_env) &&
         same_bits(a.F_command, b.F_command);
}

/// A server that is played.
class Player {
 public:
  /// `recorded`: the device, if it is that of the recording.
  Player(const ServoOptions& options, std::uint64_t fingerprint, Device& device,
         RecordedDevice* recorded, const ObserveTick& observe)
      : session_(link_, {}),
        servo_(std::make_unique<Servo>(options, fingerprint, session_, device, &scenes_)),
        recorded_(recorded),
        observe_(observe),
        rate_(options.rate) {}

  void play(const RecordedTick& tick) {
    if (tick.granted) {
      session_.give_next(tick.granted->id);
      OfflineResult& result = results_.emplace_back();
      result.session = tick.granted->id;
      result.fingerprint = tick.granted->welcome.fingerprint;
    }
    if (recorded_ != nullptr) recorded_->set(tick.note.device);
    scenes_.set(tick.note.scene);
    servo_->obey(tick.note.act);
    link_.begin_tick(tick.received);
    overruns_ += tick.note.missed;
    const TickRecord& record =
        servo_->tick({.tick = tick.note.tick,
                      .scheduled = static_cast<double>(tick.note.tick) / rate_,
                      .begin = tick.note.begin,
                      .missed = tick.note.missed,
                      .overruns = overruns_});
    observe_(record, *servo_);
    if (results_.empty()) return;
    results_.back().steps = std::max(results_.back().steps, record.step);
    results_.back().incomplete = tick.note.lost;
    if (results_.back().missing_scene.empty()) results_.back().missing_scene = scenes_.missing();
    for (const ProxyState& state : tick.answers) compare(state);
  }
  /// The scene stream of the session that began last, where the ticks bring none of it.
  void give(std::span<const std::byte> stream) { scenes_.give(stream); }

  std::vector<OfflineResult>& results() { return results_; }

 private:
  void compare(const ProxyState& recorded) {
    OfflineResult& result = results_.back();
    ++result.compared;
    const bool equal = std::ranges::any_of(
        link_.answers(), [&](const ProxyState& played) { return same_bits(recorded, played); });
    if (equal) {
      ++result.equal;
    } else if (!result.first_difference) {
      result.first_difference = recorded.step;
    }
  }

  PlayedLink link_;
  protocol::ServerSession session_;
  PlayedScenes scenes_;
  std::unique_ptr<Servo> servo_;
  RecordedDevice* recorded_;
  const ObserveTick& observe_;
  double rate_;  ///< Hz.
  std::uint64_t overruns_ = 0;
  std::vector<OfflineResult> results_;
};

/// What the client sent comes later than it came.
class LateClient {
 public:
  explicit LateClient(std::uint64_t periods) : periods_(periods) {}

  void delay(RecordedTick& tick) {
    if (periods_ == 0) return;
    under_way_.push_back({.due = tick.note.tick + periods_,
                          .received = std::move(tick.received),
                          .granted = std::move(tick.granted),
                          .scene = tick.note.scene});
    tick.received.clear();
    tick.granted.reset();
    tick.answers.clear();
    while (!under_way_.empty() && under_way_.front().due <= tick.note.tick) {
      Sent& sent = under_way_.front();
      std::ranges::move(sent.received, std::back_inserter(tick.received));
      if (sent.granted) tick.granted = std::move(sent.granted);
      scene_ = sent.scene;
      under_way_.pop_front();
    }
    tick.note.scene = scene_;
  }

 private:
  struct Sent {
    std::uint64_t due = 0;  ///< Tick.
    std::vector<Datagram> received;
    std::optional<GrantedSession> granted;
    SceneExchange scene;
  };

  std::uint64_t periods_;
  std::deque<Sent> under_way_;
  SceneExchange scene_;  ///< In force.
};

/// The ticks of a session as the acknowledgements tell them.
class AcknowledgedTicks {
 public:
  AcknowledgedTicks(const RecordedSession& session, double rate) : session_(session), rate_(rate) {
    std::unordered_map<std::uint64_t, const RecordedUpdate*> updates;
    for (const RecordedUpdate& update : session.updates) updates[update.sequence] = &update;
    std::uint64_t control_in_effect = 0;
    for (const ProxyState& state : session.acknowledgements) {
      RecordedTick& tick = due_[state.step];
      tick.answers.push_back(state);
      tick.note.scene.number = state.scene;
      const auto update = updates.find(state.acknowledged);
      if (update == updates.end() || !is_whole(*update->second)) {
        ++incomplete_;
        continue;
      }
      if (state.control != control_in_effect) {
        const auto control = session.controls.find(state.control);
        if (control != session.controls.end()) deliver({control->second}, tick);
        control_in_effect = state.control;
      }
      deliver(update->second->parts, tick);
    }
    // The tick that takes the hello is the session's first step.
    RecordedTick& first = due_[1];
    std::vector<Datagram> later = std::move(first.received);
    first.received.clear();
    deliver(session.hello_parts, first);
    first.received.insert(first.received.end(), later.begin(), later.end());
    first.granted = GrantedSession{session.id, session.welcome};
  }

  RecordedTick take(std::uint64_t step) {
    RecordedTick tick;
    if (const auto due = due_.find(step); due != due_.end()) {
      tick = std::move(due->second);
      scene_ = tick.note.scene.number;
    }
    tick.note.scene.number = scene_;
    tick.session = session_.id;
    tick.note.tick = step - 1;
    tick.note.begin = static_cast<double>(step - 1) / rate_;
    return tick;
  }
  std::uint64_t steps() const {
    return session_.acknowledgements.empty() ? 1 : session_.acknowledgements.back().step;
  }
  /// Acknowledged updates that are not delivered.
  std::uint64_t incomplete() const { return incomplete_; }

 private:
  void deliver(std::span<const DatagramBytes> parts, RecordedTick& tick) const {
    for (const DatagramBytes& part : parts) {
      tick.received.push_back({.peer = session_.client, .bytes = part});
    }
  }
  void deliver(std::initializer_list<DatagramBytes> parts, RecordedTick& tick) const {
    deliver(std::span(parts.begin(), parts.size()), tick);
  }

  const RecordedSession& session_;
  double rate_;                                          ///< Hz.
  std::unordered_map<std::uint64_t, RecordedTick> due_;  ///< Ticks by step.
  std::uint64_t incomplete_ = 0;
  std::uint32_t scene_ = 0;  ///< Number of the scene in force.
};

}  // namespace

std::vector<OfflineResult> replay_offline(Recording& recording, const ServoOptions& options,
                                          std::uint64_t fingerprint, Device* instead,
                                          const ObserveTick& observe, std::uint64_t late) {
  RecordedDevice recorded(recording.device());
  Player player(options, fingerprint, instead != nullptr ? *instead : recorded,
                instead != nullptr ? nullptr : &recorded, observe);
  LateClient client(late);
  RecordedTick tick;
  while (recording.next(tick)) {
    client.delay(tick);
    player.play(tick);
  }
  return player.results();
}

OfflineResult replay_offline(const RecordedSession& session, const ServoOptions& options,
                             std::uint64_t fingerprint, Device& device,
                             const ObserveTick& observe) {
  AcknowledgedTicks ticks(session, options.rate);
  Player player(options, fingerprint, device, nullptr, observe);
  player.play(ticks.take(1));
  player.give(session.scene_stream());
  for (std::uint64_t step = 2; step <= ticks.steps(); ++step) player.play(ticks.take(step));
  OfflineResult result = player.results().front();
  result.steps = ticks.steps();
  result.incomplete = ticks.incomplete();
  return result;
}

}  // namespace hlm::server
