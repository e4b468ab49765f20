#include "hlm/replay/offline_replay.h"

#include <algorithm>
#include <bit>
#include <memory>
#include <unordered_map>
#include <vector>

#include "hlm/protocol/codec.h"
#include "hlm/protocol/server_session.h"

namespace hlm::server {
namespace {

using protocol::Datagram;
using protocol::DatagramBytes;
using protocol::ProxyState;

bool is_whole(const RecordedUpdate& recorded) {
  protocol::ContactUpdate update;
  return !decode(recorded.parts, update);
}

/// Delivers a session's datagrams in the step that took them when they were recorded, and keeps the
/// acknowledgements.
class ReplayLink final : public protocol::DatagramLink {
 public:
  explicit ReplayLink(const RecordedSession& session) : client_(session.client) {
    // The tick that takes the hello is the session's first step.
    due_[1] = session.hello_parts;
    std::unordered_map<std::uint64_t, const RecordedUpdate*> updates;
    for (const RecordedUpdate& update : session.updates) updates[update.sequence] = &update;
    std::uint64_t control_in_effect = 0;
    for (const ProxyState& state : session.acknowledgements) {
      const auto update = updates.find(state.acknowledged);
      if (update == updates.end() || !is_whole(*update->second)) {
        ++incomplete_;
        continue;
      }
      auto& due = due_[state.step];
      if (state.control != control_in_effect) {
        const auto control = session.controls.find(state.control);
        if (control != session.controls.end()) due.push_back(control->second);
        control_in_effect = state.control;
      }
      due.insert(due.end(), update->second->parts.begin(), update->second->parts.end());
    }
  }

  /// The datagrams of this step are the next to come.
  void begin_step(std::uint64_t step) {
    const auto due = due_.find(step);
    waiting_ = due == due_.end() ? std::span<const DatagramBytes>() : due->second;
  }

  bool receive(Datagram& datagram) noexcept override {
    if (waiting_.empty()) return false;
    datagram.peer = client_;
    datagram.bytes = waiting_.front();
    waiting_ = waiting_.subspan(1);
    return true;
  }

  void send(const protocol::Endpoint&, std::span<const std::byte> bytes) noexcept override {
    ProxyState state;
    if (!decode(bytes, state)) states_.push_back(state);
  }

  const std::vector<ProxyState>& states() const { return states_; }
  /// Acknowledged updates that are not delivered.
  std::size_t incomplete() const { return incomplete_; }

 private:
  protocol::Endpoint client_;
  std::unordered_map<std::uint64_t, std::vector<DatagramBytes>> due_;  ///< By step.
  std::span<const DatagramBytes> waiting_;
  std::vector<ProxyState> states_;
  std::size_t incomplete_ = 0;
};

template <class Vector>
bool same_bits(const Vector& a, const Vector& b) {
  return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](double x, double y) {
           return std::bit_cast<std::uint64_t>(x) == std::bit_cast<std::uint64_t>(y);
         });
}

/// Whether the physics of two acknowledgements agree.
bool same_bits(const ProxyState& a, const ProxyState& b) {
  return a.step == b.step && a.acknowledged == b.acknowledged && same_bits(a.q, b.q) &&
         same_bits(a.v, b.v) && same_bits(a.X_WD.p, b.X_WD.p) &&
         same_bits(a.X_WD.R.coeffs(), b.X_WD.R.coeffs()) && same_bits(a.F_env, b.F_env) &&
         same_bits(a.F_command, b.F_command);
}

/// Both are in the order of the updates that they acknowledge.
OfflineResult compare(const std::vector<ProxyState>& recorded,
                      const std::vector<ProxyState>& replayed) {
  OfflineResult result;
  result.compared = recorded.size();
  auto candidate = replayed.begin();
  for (const ProxyState& state : recorded) {
    while (candidate != replayed.end() && candidate->acknowledged < state.acknowledged) ++candidate;
    if (candidate != replayed.end() && same_bits(state, *candidate)) {
      ++result.equal;
    } else if (!result.first_difference) {
      result.first_difference = state.step;
    }
  }
  return result;
}

}  // namespace

OfflineResult replay_offline(const RecordedSession& session, const ServoOptions& options,
                             std::uint64_t fingerprint, Device& device,
                             const std::function<void(const TickRecord&)>& observe) {
  ReplayLink link(session);
  protocol::ServerSession server(link, {.first_session_id = session.id});
  const auto servo = std::make_unique<Servo>(options, fingerprint, server, device);
  const std::uint64_t steps =
      session.acknowledgements.empty() ? 1 : session.acknowledgements.back().step;
  Timing timing;
  for (std::uint64_t step = 1; step <= steps; ++step) {
    link.begin_step(step);
    timing.tick = step - 1;
    timing.scheduled = timing.begin = static_cast<double>(timing.tick) / options.rate;
    observe(servo->tick(timing));
  }
  OfflineResult result = compare(session.acknowledgements, link.states());
  result.steps = steps;
  result.incomplete = link.incomplete();
  return result;
}

}  // namespace hlm::server
