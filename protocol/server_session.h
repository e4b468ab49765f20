// The server's side of the session: who the client is, which datagrams count, the latest update.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "hlm/protocol/assembler.h"
#include "hlm/protocol/codec.h"
#include "hlm/protocol/datagram_link.h"
#include "hlm/protocol/messages.h"
#include "hlm/protocol/scene_stream.h"
#include "hlm/protocol/statistics.h"

namespace hlm::protocol {

struct ServerSessionOptions {
  /// Id of the first session, for a replay or a test; 0: drawn at random, as all later ones are.
  std::uint64_t first_session_id = 0;
  /// A client silent for this long, s, loses the session to the next hello. Longer keeps a client
  /// that was restarted waiting; shorter lets another take the session in a pause.
  double timeout = 0.5;
};

/// Not thread-safe; no function waits, allocates or throws.
class ServerSession {
 public:
  /// Datagrams taken in one poll, so that a flood cannot stall the tick; the rest waits in the
  /// link. More lets a flood take more of the tick (about 1 µs each); fewer lets it delay the
  /// client's updates by more ticks. An update of 64 contacts takes 8.
  static constexpr int kDatagramsPerPoll = 64;

  ServerSession(DatagramLink& link, ServerSessionOptions options) noexcept;

  /// What one drain of the link brought. Pointers are valid until the next poll. A poll that brings
  /// a hello or a goodbye brings no update: its session is over.
  struct Inbox {
    const Hello* hello = nullptr;  ///< A client asks for a session: answer with accept or reject.
    const ContactUpdate* update = nullptr;  ///< Latest complete update of the session.
    bool goodbye = false;                   ///< The client ended the session.
    bool heard = false;    ///< Something of the session came: a control, a chunk of a scene, or a
                           ///< part of an update.
    bool refused = false;  ///< An update of the session was refused.
    const Control* control = nullptr;  ///< Takes effect with `update`, before it.
    bool scene = false;                ///< Chunks of the scene stream wait in order: take_scene().
  };

  /// Drains the link (bounded), drops and counts what is malformed, stale or foreign, tells a
  /// client why its update was refused, and keeps the latest complete update. What is refused
  /// leaves no trace except its count. Turns away by itself: hellos of another version, with an
  /// error (find_error), or for another session while the present one is alive, whoever asks.
  /// `now`: s, any steady origin.
  Inbox poll(double now) noexcept;

  /// Grants the session asked for by the latest Inbox::hello. Ends the one before, if any.
  /// `nonce` is filled in.
  void accept(double now, const Welcome& welcome) noexcept;
  /// Refuses it. `text` is cut to what a reject holds.
  void reject(double now, RejectReason reason, std::string_view text) noexcept;

  /// Acknowledges the latest Inbox::update. Fills in `acknowledged`, `update_send_time`, `hold`,
  /// `dropped` and `control`. Returns the update's sequence; nothing is sent and 0 returned if the
  /// session has no update yet.
  std::uint64_t acknowledge(double now, ProxyState state) noexcept;
  /// Sends ticks, a local state or impulses to the client, if there is a session.
  template <class Message>
  void inform(double now, const Message& message) noexcept {
    if (active_) send(link_, client_.peer, next_envelope(now), message);
  }
  /// The same of a scene state; fills in `next` and `bitmap`. Due with each acknowledgement once
  /// has_scene().
  void inform(double now, SceneState state) noexcept {
    scene_.describe(state);
    inform<SceneState>(now, state);
  }
  /// Hands the session's scene stream on in order, chunk by chunk of 1 to kChunkSize bytes, to
  /// `bool take(std::span<const std::byte>)`. A chunk for which it returns false stays, with those
  /// behind it, and is not acknowledged as taken; what comes is kept within the window of
  /// kSceneWindow chunks. Returns how many were taken. A session that begins forgets the stream of
  /// the one before.
  template <class Take>
  std::size_t take_scene(Take take) noexcept {
    std::size_t taken = 0;
    for (; !scene_.front().empty() && take(scene_.front()); ++taken) scene_.pop();
    return taken;
  }
  /// Whether a chunk of the scene stream has come in the present session, or in the latest.
  bool has_scene() const noexcept { return scene_.has_begun(); }
  /// Tells the client that the session ends, if there is one.
  void close(double now, GoodbyeReason reason) noexcept;

  /// The next session gets this id, as a replay needs it.
  void give_next(std::uint64_t id) noexcept { next_id_ = id; }

  bool active() const noexcept { return active_; }
  /// Id of the present session; without one, of the latest or, before the first, 0.
  std::uint64_t id() const noexcept { return id_; }
  /// Where its client is.
  const Endpoint& client() const noexcept { return client_.peer; }
  const ReceiveStatistics& statistics() const noexcept { return statistics_; }
  /// Why the latest update of the session was refused, in words; empty once one was taken.
  std::string_view refusal() const noexcept { return refusal_; }

 private:
  /// Who asks for a session.
  struct Applicant {
    Endpoint peer;
    std::uint64_t nonce = 0;

    bool operator==(const Applicant&) const = default;
  };

  std::optional<DropReason> take_datagram(double now) noexcept;
  std::optional<DropReason> take_hello(double now, const Header& header) noexcept;
  std::optional<DropReason> assemble_hello(double now, const Header& header,
                                           const Applicant& applicant) noexcept;
  std::optional<DropReason> take_update(double now, const Header& header) noexcept;
  std::optional<DropReason> complete_update(double now, const Header& header) noexcept;
  void note_refusal(std::string_view why) noexcept;
  void report_refusal(double now, Refusal refusal) noexcept;
  std::optional<DropReason> take_control(double now, const Header& header) noexcept;
  std::optional<DropReason> take_goodbye(double now, const Header& header) noexcept;
  std::optional<DropReason> take_chunk(double now, const Header& header) noexcept;
  bool from_client(const Header& header) const noexcept;
  bool is_plausible(const Header& header) const noexcept;
  void hear(double now) noexcept;
  void end(double now) noexcept;

  void answer_other_version(double now) noexcept;
  void turn_away(double now, const Applicant& applicant, RejectReason reason,
                 std::string_view text) noexcept;
  void send_welcome(double now) noexcept;
  Envelope next_envelope(double now) noexcept;

  DatagramLink& link_;
  ServerSessionOptions options_;
  ReceiveStatistics statistics_;
  Datagram datagram_;  ///< The one at hand.
  Inbox inbox_;
  bool answered_ = false;  ///< A hello was answered in this poll; one answer per poll is enough.

  Assembler hello_parts_;
  Applicant applicant_;  ///< Sender of `hello_parts_` and `hello_`.
  Hello hello_;
  std::uint64_t sent_outside_ = 0;  ///< Sequence of the latest message outside sessions.

  std::uint64_t next_id_;  ///< Id of the next session; 0: to be drawn at random.
  bool active_ = false;
  Applicant client_;  ///< Client of the present session or of the latest; so are the following.
  std::uint64_t id_ = 0;
  ToolDescription tool_;
  Welcome welcome_;
  std::uint64_t sent_ = 0;  ///< Sequence of the latest message sent.
  double last_heard_ = 0;   ///< s.
  Assembler update_parts_;
  std::array<ContactUpdate, 2> updates_;  ///< The latest update, and room to decode the next.
  /// Into that room went a refused part of another message than the one that is put together.
  bool spoiled_ = false;
  std::size_t newest_update_ = 0;
  Envelope acknowledged_;      ///< Envelope of the latest update; sequence 0 if there is none.
  double received_at_ = 0;     ///< When it arrived, s.
  std::uint64_t heard_ = 0;    ///< Largest sequence taken from the client.
  std::uint64_t refused_ = 0;  ///< Updates refused as a whole.
  std::optional<double> refusal_sent_;  ///< s.
  std::string_view refusal_;            ///< Of words that stand for ever.
  Control newest_control_;
  std::uint64_t newest_control_sequence_ = 0;  ///< 0 if there is none.
  Control control_;                            ///< Control in effect.
  std::uint64_t control_sequence_ = 0;         ///< 0 if none is in effect.
  SceneReceiver scene_;

  Applicant ended_;                 ///< Client of the latest session that ended.
  std::optional<double> ended_at_;  ///< s.
};

}  // namespace hlm::protocol
