#include "hlm/tools/replay/live_replay.h"

#include <algorithm>
#include <chrono>
#include <map>
#include <stdexcept>
#include <string>
#include <thread>
#include <unordered_map>

#include "hlm/common/tool_model.h"
#include "hlm/protocol/client_session.h"
#include "hlm/protocol/transport/udp_socket.h"

namespace hlm::server {
namespace {

/// How often the server is listened to between two updates, s.
constexpr double kPollPeriod = 1e-3;

/// More of a scene at once would fill a narrow network.
constexpr std::size_t kChunksPerUpdate = 64;

class LiveReplay {
 public:
  LiveReplay(const RecordedSession& session, protocol::DatagramLink& link,
             const LiveOptions& options)
      : session_(session),
        options_(options),
        client_(link, client_options()),
        recorded_tool_(session.hello.tool),
        answered_tool_(session.hello.tool) {
    for (const protocol::ProxyState& state : session.acknowledgements) {
      if (state.q.size() == recorded_tool_.configuration_size()) {
        recorded_[state.acknowledged] = &state;
      }
    }
  }

  LiveResult run(const std::function<void(const protocol::Welcome&)>& welcomed,
                 const std::function<bool()>& stop) {
    connect(stop);
    const double begin = now();
    if (client_.active()) welcomed(client_.welcome());
    next_chunk_ = session_.chunks.begin();
    const auto ended = [&] { return stop() || result_.lost; };
    for (const RecordedUpdate& update : session_.updates) {
      const double due =
          begin + 1e-9 * static_cast<double>(update.time_ns - session_.time_ns) / options_.speed;
      while (now() < due && !ended()) listen();
      if (ended()) break;
      send(update);
    }
    // The last acknowledgements are on their way.
    constexpr double kLastWait = 0.05;
    for (const double end = now() + kLastWait; now() < end && !result_.lost;) listen();
    client_.close(now());
    result_.round_trip = client_.round_trip();
    return result_;
  }

 private:
  protocol::ClientSessionOptions client_options() const {
    protocol::ClientSessionOptions options;
    options.server = options_.server;
    options.hello = session_.hello;
    options.hello.nonce = 0;  // Another one than the recorded.
    return options;
  }

  double now() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - origin_).count();
  }

  void connect(const std::function<bool()>& stop) {
    std::string refusal;
    while (!client_.active() && !stop()) {
      if (const auto inbox = client_.poll(now()); inbox.reject) {
        refusal = ": it says: " + std::string(inbox.reject->text.begin(), inbox.reject->text.end());
      }
      if (now() > options_.connect_timeout) {
        throw std::runtime_error("server " + protocol::to_string(options_.server) +
                                 " granted no session within " +
                                 std::to_string(options_.connect_timeout) + " s" + refusal);
      }
      std::this_thread::sleep_for(std::chrono::duration<double>(kPollPeriod));
    }
  }

  void listen() {
    const auto inbox = client_.poll(now());
    if (inbox.lost) result_.lost = true;
    const protocol::SceneState& scene = client_.scene_state();
    if (inbox.scene && scene.error != protocol::SceneError::kNone && result_.scene_fault.empty()) {
      result_.scene_fault.assign(scene.text.begin(), scene.text.end());
    }
    if (inbox.state != nullptr) compare(*inbox.state);
    std::this_thread::sleep_for(std::chrono::duration<double>(kPollPeriod));
  }

  void compare(const protocol::ProxyState& answer) {
    ++result_.acknowledged;
    const auto recorded = expected_.find(answer.acknowledged);
    if (recorded == expected_.end()) return;
    ++result_.compared;
    if (answer.scene != recorded->second->scene) ++result_.other_scene;
    const auto [earlier, later] = std::minmax(answer.step, recorded->second->step);
    result_.steps_apart = std::max(result_.steps_apart, later - earlier);
    recorded_tool_.set_configuration(recorded->second->q);
    answered_tool_.set_configuration(answer.q);
    result_.proxy.observe(recorded_tool_.X_WH(), answered_tool_.X_WH());
  }

  void send(const RecordedUpdate& recorded) {
    protocol::ContactUpdate update;
    if (decode(recorded.parts, update)) {
      ++result_.incomplete;
      return;
    }
    queue_chunks(recorded.time_ns);
    const std::uint64_t sequence = client_.send(now(), update);
    client_.send_scene(now(), kChunksPerUpdate);
    if (sequence == 0) return;
    ++result_.sent;
    const auto answer = recorded_.find(recorded.sequence);
    if (answer != recorded_.end()) expected_[sequence] = answer->second;
  }

  /// What the client of the recording had sent of its scene stream by then.
  void queue_chunks(std::int64_t time_ns) {
    for (; next_chunk_ != session_.chunks.end() && next_chunk_->second.time_ns <= time_ns;
         ++next_chunk_) {
      if (!result_.scene_fault.empty()) return;
      const auto& [number, chunk] = *next_chunk_;
      if (number != chunks_++) {
        result_.scene_fault = "the capture lacks chunk " + std::to_string(chunks_ - 1);
        return;
      }
      const auto* bytes = reinterpret_cast<const std::uint8_t*>(chunk.data.data());
      if (const auto why = client_.queue_scene({bytes, chunk.data.size()})) {
        result_.scene_fault = *why;
      }
    }
  }

  const RecordedSession& session_;
  LiveOptions options_;
  std::chrono::steady_clock::time_point origin_ = std::chrono::steady_clock::now();
  protocol::ClientSession client_;
  ToolModel recorded_tool_;
  ToolModel answered_tool_;
  /// Recorded answers by the sequence of the update they acknowledge: as recorded, and as sent now.
  std::unordered_map<std::uint64_t, const protocol::ProxyState*> recorded_;
  std::unordered_map<std::uint64_t, const protocol::ProxyState*> expected_;
  std::map<std::uint64_t, RecordedChunk>::const_iterator next_chunk_;
  std::uint64_t chunks_ = 0;  ///< Queued.
  LiveResult result_;
};

}  // namespace

LiveResult replay_live(const RecordedSession& session, protocol::DatagramLink& link,
                       const LiveOptions& options,
                       const std::function<void(const protocol::Welcome&)>& welcomed,
                       const std::function<bool()>& stop) {
  return LiveReplay(session, link, options).run(welcomed, stop);
}

}  // namespace hlm::server
