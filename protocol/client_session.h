// The client's side of the session. Any simulator can link this (with client above it).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "hlm/common/sentence.h"
#include "hlm/protocol/assembler.h"
#include "hlm/protocol/codec.h"
#include "hlm/protocol/datagram_link.h"
#include "hlm/protocol/messages.h"
#include "hlm/protocol/scene_stream.h"
#include "hlm/protocol/statistics.h"

namespace hlm::protocol {

/// Takes the telemetry that a control asks for.
class TelemetryObserver {
 public:
  virtual ~TelemetryObserver() = default;
  /// Takes the ticks in the order of their steps; a gap means that a datagram was lost.
  virtual void observe(const Ticks& ticks) = 0;
  virtual void observe(const LocalState& state) = 0;
};

struct ClientSessionOptions {
  Endpoint server;
  /// Its nonce is that of the first session; 0: drawn at random, as all later ones are.
  /// `clears_fault` is set by the session, see below.
  Hello hello;
  double hello_period = 0.1;  ///< Between repeated hellos, s.
  /// A server that is silent for this long, s, plus a round trip, although updates were sent, is
  /// asked for a new session.
  double timeout = 0.5;
  /// A person asks for the first session: if it begins within 2 s, it ends a fault of the server.
  bool clears_fault = true;
  TelemetryObserver* telemetry = nullptr;  ///< Must outlive the session; null: dropped unread.
};

/// Not thread-safe; never waits, and allocates after its construction only in queue_scene().
class ClientSession {
 public:
  /// Datagrams taken in one poll: more than a server sends between two steps of any simulator.
  static constexpr int kDatagramsPerPoll = 256;

  /// Throws std::invalid_argument, naming the value and what is allowed, if the hello cannot be
  /// used (find_error) or the server's port is 0.
  ClientSession(DatagramLink& link, ClientSessionOptions options);

  struct Inbox {
    bool welcomed = false;         ///< A session began in this poll: the proxy starts at hello.q.
    bool lost = false;             ///< The session ended in this poll (goodbye or silence).
    std::optional<Reject> reject;  ///< The server refuses; it is asked again nevertheless.
    const ProxyState* state = nullptr;       ///< Latest proxy state, valid until the next poll.
    std::optional<Refusal> refusal;          ///< Why an update, or a contact of it, was not used.
    const Impulses* impulses = nullptr;      ///< Latest totals, valid until the next poll.
    StaticVector<HeldBody, kMaxPoses> held;  ///< What came of bodies, the newest of each.
    bool scene = false;                      ///< A new scene_state() has come.
  };

  /// Drains the link; says hello while there is no session. `now`: s, any steady origin.
  Inbox poll(double now);
  /// Sends an update in as many parts as it needs; fills in `echo_step` and `echo_hold`. Returns
  /// its sequence. Without a session nothing is sent and 0 is returned.
  std::uint64_t send(double now, ContactUpdate update);
  /// Asks for this from now on, also in later sessions: it is sent before each update until the
  /// server says that it is in effect.
  void set_control(const Control& control);
  /// Appends records (scene_records.h) to the scene stream of this session; the next one begins
  /// without any. Allocates. Returns why it does not, naming the value and what is allowed: there
  /// is no session, the server takes no scenes, or more than SceneSender::kMostQueued would wait.
  [[nodiscard]] std::optional<Sentence> queue_scene(std::span<const std::uint8_t> records);
  /// Sends at most `budget` queued chunks, lost ones first; call it once in each step. Returns how
  /// many. A larger budget sends a scene sooner but fills narrow networks.
  std::size_t send_scene(double now, std::size_t budget);
  /// The server's latest word on the scene stream of this session, or of the previous one.
  const SceneState& scene_state() const noexcept { return scene_state_; }
  /// The part of the scene stream that the server has not taken.
  const SceneSender& scene_sender() const noexcept { return scene_sender_; }
  /// Ends the session, if there is one. The next poll would ask for another.
  void close(double now);
  /// The server may be silent for this long, s, if its own timeout is less.
  void be_patient(double least) noexcept { least_patience_ = least; }
  /// Later hellos give this as the tool's initial configuration.
  void set_initial_configuration(const Configuration& q) { options_.hello.q = q; }

  bool active() const noexcept { return active_; }
  /// Number of the present session; 0 without one.
  std::uint64_t id() const noexcept { return active_ ? id_ : 0; }
  /// The welcome of the present session, or of the latest.
  const Welcome& welcome() const noexcept { return welcome_; }
  /// Latest measured round trip without the server's hold, s; 0 before the first.
  double round_trip() const noexcept { return round_trip_; }
  const ReceiveStatistics& statistics() const noexcept { return statistics_; }

 private:
  std::optional<DropReason> take_datagram(double now);
  std::optional<DropReason> take_welcome(double now, const Header& header) noexcept;
  std::optional<DropReason> take_reject() noexcept;
  std::optional<DropReason> take_state(double now, const Header& header) noexcept;
  std::optional<DropReason> take_goodbye(const Header& header) noexcept;
  std::optional<DropReason> take_ticks(const Header& header);
  std::optional<DropReason> take_local_state(const Header& header);
  std::optional<DropReason> take_refusal(const Header& header) noexcept;
  std::optional<DropReason> take_impulses(const Header& header) noexcept;
  std::optional<DropReason> take_held(const Header& header) noexcept;
  std::optional<DropReason> take_scene_state(double now, const Header& header) noexcept;
  std::optional<DropReason> check_session(const Header& header) const noexcept;

  void say_hello(double now) noexcept;
  void end() noexcept;
  Envelope next_envelope(double now) noexcept;

  DatagramLink& link_;
  ClientSessionOptions options_;  ///< `hello.nonce` is the one in use.
  double least_patience_ = 0;     ///< s.
  ReceiveStatistics statistics_;
  Datagram datagram_;  ///< The one at hand.
  Inbox inbox_;

  std::optional<double> asking_since_;  ///< First hello, s.
  std::optional<double> asked_at_;      ///< First hello with the present nonce, s.
  std::optional<double> last_hello_;    ///< s.
  std::uint64_t hellos_ = 0;            ///< Sequence of the latest hello.

  bool active_ = false;
  std::uint64_t id_ = 0;
  Welcome welcome_;
  std::uint64_t sent_ = 0;                  ///< Sequence of the latest message sent.
  std::uint64_t received_ = 0;              ///< Sequence of the latest message received.
  std::optional<double> unanswered_since_;  ///< First update after the server was last heard, s.
  ProxyState state_;                        ///< Latest state of the session.
  double state_received_at_ = 0;            ///< When it arrived, s.
  double round_trip_ = 0;
  double first_round_trip_ = 0;  ///< From the session's first hello to its welcome, s.

  std::optional<Control> control_;
  std::uint64_t control_sequence_ = 0;  ///< Sequence of its first message; 0: unsent.
  std::uint64_t next_step_ = 1;         ///< First step of the ticks that are not stale.
  Assembler local_state_parts_;
  Impulses impulses_;            ///< Latest impulses of the session.
  std::uint64_t held_step_ = 0;  ///< Latest step of which held bodies are known.
  SceneSender scene_sender_;
  SceneState scene_state_;
  std::uint64_t scene_sequence_ = 0;  ///< Sequence of `scene_state_`.
};

}  // namespace hlm::protocol
