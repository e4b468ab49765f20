#include "hlm/client/session_page.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <stdexcept>
#include <system_error>
#include <type_traits>
#include <utility>
#include <vector>

#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include "hlm/common/steady_seconds.h"

namespace hlm {
namespace {

using page_wire::Kind;

/// For the page's program to start, s: also on a busy machine. That it has ended is seen at once.
constexpr double kAddressWithin = 20;
constexpr timeval kRoomWithin{.tv_sec = 2, .tv_usec = 0};  // In the socket.
/// Between two frames of a page, s: no screen shows more.
constexpr double kFrame = 0.015;
constexpr double kLease = 0.5;                          // s, of a hold; haptic_page repeats it
constexpr std::size_t kPiece = std::size_t{64} * 1024;  // Of a scene.

std::vector<std::string> command(const SessionPageOptions& options) {
  std::vector<std::string> arguments{find_program("haptic_page", "HAPTIC_PAGE_PROGRAM"),
                                     "--session",
                                     std::to_string(OwnProgram::kInherited),
                                     "--port",
                                     std::to_string(options.port),
                                     "--parent",
                                     std::to_string(getpid())};
  if (options.open) arguments.emplace_back("--open");
  if (options.token) arguments.emplace_back("--token");
  return arguments;
}

/// Whether something comes, or the other side ends, within so many seconds; a signal ends no wait.
bool has_come(int socket, double within) {
  const double end = steady_seconds() + within;
  for (double left = within; left > 0; left = end - steady_seconds()) {
    pollfd waiting{.fd = socket, .events = POLLIN, .revents = 0};
    if (::poll(&waiting, 1, static_cast<int>(1000 * left) + 1) > 0) return true;
  }
  return false;
}

std::string text_of(std::span<const std::byte> packet) {
  return {reinterpret_cast<const char*>(packet.data()) + 1, packet.size() - 1};
}

}  // namespace

SessionPage::SessionPage(const protocol::Hello& hello, const SessionPageOptions& options) {
  std::vector<std::string> arguments = command(options);
  std::array<int, 2> ends{};
  if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    throw std::runtime_error("no socket for the page: " + std::generic_category().message(errno));
  }
  socket_ = ends[0];
  setsockopt(socket_, SOL_SOCKET, SO_SNDTIMEO, &kRoomWithin, sizeof kRoomWithin);
  try {
    running_.emplace(std::move(arguments), ends[1]);
    close(std::exchange(ends[1], -1));
    await_address();
  } catch (...) {
    if (ends[1] >= 0) close(ends[1]);
    close(socket_);
    throw;
  }
  tell(hello);
}

SessionPage::~SessionPage() { close(socket_); }

void SessionPage::await_address() {
  const bool came = has_come(socket_, kAddressWithin);
  const std::span<const std::byte> packet = receive();
  if (!packet.empty() && packet.front() == static_cast<std::byte>(Kind::kAddress)) {
    address_ = text_of(packet);
    return;
  }
  throw std::runtime_error("no page: " + (packet.empty() ? std::string("haptic_page ") +
                                                               (came ? "has ended" : "says nothing")
                                                         : text_of(packet)));
}

bool SessionPage::send(std::span<const std::byte> packet) noexcept {
  return ::send(socket_, packet.data(), packet.size(), MSG_DONTWAIT | MSG_NOSIGNAL) >= 0;
}

std::span<const std::byte> SessionPage::receive() {
  const ssize_t size = recv(socket_, packet_.data(), packet_.size(), MSG_DONTWAIT);
  return std::span(packet_).first(size > 0 ? static_cast<std::size_t>(size) : 0);
}

template <class Message>
bool SessionPage::tell(const Message& message) {
  constexpr bool kBeforeSession =
      std::is_same_v<Message, protocol::Hello> || std::is_same_v<Message, protocol::Reject>;
  return send(
      page_wire::packet(message, {.session = kBeforeSession ? 0u : 1u, .sequence = ++told_}));
}

void SessionPage::show_scene(std::span<const std::uint8_t> records) {
  const auto is_told = [this](const page_wire::Packet& packet) {
    return ::send(socket_, packet.data(), packet.size(), MSG_NOSIGNAL) >= 0;
  };
  if (!is_told(page_wire::packet(Kind::kSceneBegin))) return;
  for (std::size_t begin = 0; begin < records.size(); begin += kPiece) {
    const auto piece = records.subspan(begin, std::min(kPiece, records.size() - begin));
    if (!is_told(page_wire::packet(Kind::kScene, std::as_bytes(piece)))) return;
  }
  is_told(page_wire::packet(Kind::kSceneEnd));
}

void SessionPage::show_news(double now, const page_wire::Status& status,
                            const protocol::ClientSession::Inbox& inbox) {
  if (untold_ && tell(*untold_)) untold_.reset();
  if (inbox.reject) tell(*inbox.reject);
  if (now - news_at_ < kFrame) return;
  news_at_ = now;
  send(page_wire::packet(Kind::kStatus, std::as_bytes(std::span(&status, 1))));
  if (inbox.state != nullptr) tell(*inbox.state);
}

void SessionPage::show_update(double now, const protocol::ContactUpdate& update) {
  if (now - update_at_ < kFrame) return;
  update_at_ = now;
  tell(update);
}

void SessionPage::observe(const protocol::Ticks& ticks) { tell(ticks); }
void SessionPage::observe(const protocol::LocalState& state) { tell(state); }

bool SessionPage::listen(double now) {
  const protocol::Control before = asked_;
  for (;;) {
    const std::span<const std::byte> packet = receive();
    if (packet.empty() || packet.front() != static_cast<std::byte>(Kind::kMessage)) break;
    const auto parts = page_wire::parts_of(packet.subspan(1));
    protocol::Control control;
    if (!parts.empty() && !protocol::decode(protocol::view(parts.front()), control)) {
      asked_ = control;
      asked_at_ = now;
    }
  }
  if (ended()) asked_ = {};
  if (now - asked_at_ > kLease) asked_.holds = false;
  return !(asked_ == before);
}

protocol::Control SessionPage::control(protocol::Control own) const {
  own.telemetry = own.telemetry || asked_.telemetry;
  if (asked_.holds) {
    own.holds = true;
    own.X_WTarget = asked_.X_WTarget;
  }
  if (asked_.tuned) {
    own.tuned = true;
    own.tuning = asked_.tuning;
  }
  return own;
}

}  // namespace hlm
