#include "haptic_server/replay/live_replay.h"

#include <chrono>
#include <random>
#include <stdexcept>
#include <thread>

#include "protocol/client_session.h"
#include "protocol/transport/udp_socket.h"

namespace hlm::server {
namespace {

/// How often the server is listened to between two updates, s.
constexpr double kPollPeriod = 1e-3;

class LiveReplay {
 public:
  LiveReplay(const RecordedSession& session, protocol::DatagramLink& link,
             const LiveOptions& options)
      : session_(session), options_(options), client_(link, client_options()) {}

  LiveResult run(const std::function<bool()>& stop) {
    connect(stop);
    const double begin = now();
    for (const RecordedUpdate& update : session_.updates) {
      const double due =
          begin + 1e-9 * static_cast<double>(update.time_ns - session_.updates.front().time_ns) /
                      options_.speed;
      while (now() < due && !stop()) listen();
      if (stop()) break;
      send(update);
    }
    // The last acknowledgements are on their way.
    constexpr double kLastWait = 0.05;
    for (const double end = now() + kLastWait; now() < end;) listen();
    client_.close(now());
    result_.round_trip = client_.round_trip();
    return result_;
  }

 private:
  protocol::ClientSessionOptions client_options() const {
    std::random_device random;
    protocol::ClientSessionOptions options;
    options.server = options_.server;
    options.hello = session_.hello;
    options.hello.nonce = (static_cast<std::uint64_t>(random()) << 32) | random();
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
    if (const auto inbox = client_.poll(now()); inbox.state != nullptr) ++result_.acknowledged;
    std::this_thread::sleep_for(std::chrono::duration<double>(kPollPeriod));
  }

  void send(const RecordedUpdate& recorded) {
    protocol::ContactUpdate update;
    if (decode(recorded.parts, update)) {
      ++result_.incomplete;
      return;
    }
    if (client_.send(now(), update) != 0) ++result_.sent;
  }

  const RecordedSession& session_;
  LiveOptions options_;
  std::chrono::steady_clock::time_point origin_ = std::chrono::steady_clock::now();
  protocol::ClientSession client_;
  LiveResult result_;
};

}  // namespace

LiveResult replay_live(const RecordedSession& session, protocol::DatagramLink& link,
                       const LiveOptions& options, const std::function<bool()>& stop) {
  return LiveReplay(session, link, options).run(stop);
}

}  // namespace hlm::server
