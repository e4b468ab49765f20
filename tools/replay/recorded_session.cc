#include "hlm/tools/replay/recorded_session.h"

#include <algorithm>
#include <map>
#include <optional>
#include <stdexcept>
#include <utility>

#include "hlm/protocol/tool_fit.h"
#include "hlm/protocol/transport/capture.h"

namespace hlm::server {
namespace {

using protocol::CapturedDatagram;
using protocol::DatagramBytes;
using protocol::Header;
using protocol::MessageType;

/// A server's clock runs no faster than this times the recording's, and a session is granted at
/// most this long, s, before the recording sees it. Steps beyond are no server's: a replay would go
/// on for ever.
constexpr double kFastestClock = 1.01;
constexpr double kLatestGrant = 10;

bool can_have_come_to(std::uint64_t step, const RecordedSession& session, std::int64_t time_ns) {
  const double elapsed = 1e-9 * static_cast<double>(time_ns - session.time_ns);
  const double most = kFastestClock * std::max(0.0, elapsed) + kLatestGrant;
  return static_cast<double>(step) <= most * session.welcome.servo_rate;
}

/// Parts of one message by their number; a repeated part counts once.
using Parts = std::map<std::uint8_t, DatagramBytes>;

std::vector<DatagramBytes> in_order(const Parts& parts) {
  std::vector<DatagramBytes> bytes;
  for (const auto& [number, part] : parts) bytes.push_back(part);
  return bytes;
}

class SessionReader {
 public:
  void take(const CapturedDatagram& datagram) {
    Header header;
    if (const auto reason = decode_header(protocol::view(datagram.bytes), header)) {
      if (reason == protocol::DropReason::kVersion) other_version_ = read_version(datagram);
      if (reason == protocol::DropReason::kSealed) has_sealed_ = true;
      return;
    }
    switch (header.type) {
      case MessageType::kHello:
        return take_hello(datagram, header);
      case MessageType::kWelcome:
        return take_welcome(datagram, header);
      case MessageType::kContactUpdate:
        return take_update(datagram, header);
      case MessageType::kProxyState:
        return take_state(datagram, header);
      case MessageType::kControl:
        return take_control(datagram, header);
      case MessageType::kSceneChunk:
        return take_chunk(datagram, header);
      case MessageType::kReject:
      case MessageType::kGoodbye:
      case MessageType::kTicks:
      case MessageType::kLocalState:
      case MessageType::kRefusal:
      case MessageType::kImpulses:
      case MessageType::kHeldBodies:
      case MessageType::kSceneState:
        return;
    }
  }

  std::vector<RecordedSession> sessions() {
    std::vector<RecordedSession> sessions;
    for (PendingSession& pending : sessions_) {
      for (std::size_t i = 0; i < pending.parts.size(); ++i) {
        pending.session.updates[i].parts = in_order(pending.parts[i]);
      }
      sessions.push_back(std::move(pending.session));
    }
    return sessions;
  }

  /// Version of datagrams that were skipped because of it, if any.
  std::optional<std::uint16_t> other_version() const { return other_version_; }
  /// Whether there are sealed datagrams, which cannot be read.
  bool has_sealed() const { return has_sealed_; }

 private:
  struct PendingHello {
    std::uint64_t sequence = 0;
    Parts parts;
  };
  /// A session until the end of the capture, for an update's parts may pass among those of another.
  struct PendingSession {
    RecordedSession session;
    std::vector<Parts> parts;                 ///< Parts of each update.
    std::map<std::uint64_t, std::size_t> at;  ///< Index of each update, by sequence.
  };

  static std::optional<std::uint16_t> read_version(const CapturedDatagram& datagram) {
    const auto stable = protocol::read_stable_part(protocol::view(datagram.bytes));
    return stable ? std::optional(stable->version) : std::nullopt;
  }

  void take_hello(const CapturedDatagram& datagram, const Header& header) {
    PendingHello& hello = hellos_[{datagram.from.address, datagram.from.port}];
    if (hello.sequence != header.envelope.sequence) hello = {header.envelope.sequence, {}};
    hello.parts.emplace(header.part, datagram.bytes);
  }

  void take_welcome(const CapturedDatagram& datagram, const Header& header) {
    if (find(header.envelope.session) != nullptr) return;
    RecordedSession session;
    session.id = header.envelope.session;
    session.time_ns = datagram.time_ns;
    session.client = datagram.to;
    session.hello_parts = in_order(hellos_[{datagram.to.address, datagram.to.port}].parts);
    if (decode(session.hello_parts, session.hello) || find_error(session.hello)) return;
    if (decode(protocol::view(datagram.bytes), session.welcome)) return;
    sessions_.push_back({std::move(session), {}, {}});
  }

  void take_update(const CapturedDatagram& datagram, const Header& header) {
    PendingSession* pending = find(header.envelope.session);
    if (pending == nullptr) return;
    const std::uint64_t sequence = header.envelope.sequence;
    const auto [at, is_new] = pending->at.try_emplace(sequence, pending->parts.size());
    if (is_new) {
      pending->session.updates.push_back({datagram.time_ns, sequence, {}});
      pending->parts.emplace_back();
    }
    pending->parts[at->second].emplace(header.part, datagram.bytes);
  }

  void take_control(const CapturedDatagram& datagram, const Header& header) {
    PendingSession* pending = find(header.envelope.session);
    if (pending != nullptr) pending->session.controls[header.envelope.sequence] = datagram.bytes;
  }

  void take_chunk(const CapturedDatagram& datagram, const Header& header) {
    PendingSession* pending = find(header.envelope.session);
    protocol::SceneChunk chunk;
    if (pending == nullptr || decode(protocol::view(datagram.bytes), chunk)) return;
    pending->session.chunks.try_emplace(chunk.number, RecordedChunk{datagram.time_ns, chunk.data});
  }

  void take_state(const CapturedDatagram& datagram, const Header& header) {
    PendingSession* pending = find(header.envelope.session);
    protocol::ProxyState state;
    if (pending == nullptr || decode(protocol::view(datagram.bytes), state)) return;
    if (!can_have_come_to(state.step, pending->session, datagram.time_ns)) return;
    auto& known = pending->session.acknowledgements;
    if (known.empty() || known.back().acknowledged < state.acknowledged) known.push_back(state);
  }

  PendingSession* find(std::uint64_t id) {
    const auto at =
        std::find_if(sessions_.begin(), sessions_.end(),
                     [id](const PendingSession& pending) { return pending.session.id == id; });
    return at == sessions_.end() ? nullptr : &*at;
  }

  std::map<std::pair<std::uint32_t, std::uint16_t>, PendingHello> hellos_;  ///< Hellos by client.
  std::vector<PendingSession> sessions_;
  std::optional<std::uint16_t> other_version_;
  bool has_sealed_ = false;
};

}  // namespace

std::vector<std::byte> RecordedSession::scene_stream() const {
  std::vector<std::byte> stream;
  std::uint64_t next = 0;
  for (const auto& [number, chunk] : chunks) {
    if (number != next++) break;
    stream.insert(stream.end(), chunk.data.begin(), chunk.data.end());
  }
  return stream;
}

std::vector<RecordedSession> read_sessions(const std::filesystem::path& path) {
  protocol::CaptureReader capture(path);
  SessionReader reader;
  while (const auto datagram = capture.next()) reader.take(*datagram);
  std::vector<RecordedSession> sessions = reader.sessions();
  if (sessions.empty() && reader.other_version()) {
    throw std::runtime_error(path.string() + ": holds version " +
                             std::to_string(*reader.other_version()) +
                             " of the protocol; this program replays version " +
                             std::to_string(protocol::kProtocolVersion));
  }
  if (sessions.empty() && reader.has_sealed()) {
    throw std::runtime_error(path.string() +
                             ": holds sealed datagrams; replay what haptic_server --record or "
                             "ve_client --record has written, which is opened");
  }
  if (sessions.empty()) {
    throw std::runtime_error(path.string() + ": holds no session: a hello and its welcome");
  }
  return sessions;
}

}  // namespace hlm::server
