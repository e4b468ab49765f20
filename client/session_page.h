// The page of a session: a separate program serves it to browsers and is told what the session
// does.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "hlm/client/own_program.h"
#include "hlm/client/page_wire.h"
#include "hlm/protocol/client_session.h"

namespace hlm {

struct SessionPageOptions {
  std::uint16_t port = 0;  ///< Of 127.0.0.1; 0: any free one.
  bool open = false;       ///< Shows it in a browser.
  bool token = false;      ///< The page asks for a token, which its address has.
};

/// Ends with this object, or with the process. It is told no more often than a page can show, and
/// misses what it cannot take in time. Only the constructor and show_scene() wait.
class SessionPage final : public protocol::TelemetryObserver {
 public:
  /// hello: the session's. Starts haptic_page: what HAPTIC_PAGE_PROGRAM names, or the one next to
  /// this library or in PATH. Throws std::runtime_error that says why there is no page.
  SessionPage(const protocol::Hello& hello, const SessionPageOptions& options);
  ~SessionPage() override;
  SessionPage(const SessionPage&) = delete;
  SessionPage& operator=(const SessionPage&) = delete;

  /// http://127.0.0.1:PORT/, with the token.
  const std::string& address() const noexcept { return address_; }

  /// Whether its program has ended.
  bool ended() { return running_->status().has_value(); }
  /// The offered scene, as records that stand alone. Waits until the page has it; a page that hangs
  /// for 2 s goes without.
  void show_scene(std::span<const std::uint8_t> records);
  /// A session has begun.
  void show_welcome(const protocol::Welcome& welcome) { untold_ = welcome; }
  /// After each poll.
  void show_news(double now, const page_wire::Status& status,
                 const protocol::ClientSession::Inbox& inbox);
  void show_update(double now, const protocol::ContactUpdate& update);
  void observe(const protocol::Ticks& ticks) override;
  void observe(const protocol::LocalState& state) override;

  /// `own`, with what people at the page ask for: telemetry, the hand, other physics.
  protocol::Control control(protocol::Control own) const;
  /// Takes in what they ask for; returns whether it has changed. A hand that is not held again
  /// within half a second is let go: its page hangs.
  bool listen(double now);
  /// The session is over: the hand is let go.
  void let_go() { asked_.holds = false; }

 private:
  /// Whether there was room for it.
  template <class Message>
  bool tell(const Message& message);
  bool send(std::span<const std::byte> packet) noexcept;
  /// A packet that has come, with its first byte; empty: none has, or the other side has ended.
  std::span<const std::byte> receive();
  void await_address();

  int socket_ = -1;
  std::optional<OwnProgram> running_;
  std::string address_;
  page_wire::Packet packet_ = page_wire::Packet(page_wire::kMost);  ///< What has come.
  std::optional<protocol::Welcome> untold_;
  std::uint64_t told_ = 0;  ///< Sequence of the latest message.
  double news_at_ = -1;     ///< When news was told last, s; likewise updates.
  double update_at_ = -1;
  protocol::Control asked_;
  double asked_at_ = 0;  ///< When it was heard last, s.
};

}  // namespace hlm
