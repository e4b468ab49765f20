#include "hlm/page/web/page_hub.h"

#include <chrono>
#include <deque>

#include <boost/asio/buffer.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket.hpp>

namespace hlm::ve {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using boost::system::error_code;

/// Largest message from a page, bytes; a hand or a setting takes some hundred. More lets a page
/// occupy more memory: PageRegister::kMaxRequests times as much.
constexpr std::size_t kMaxMessage = 4096;

/// Messages waiting for one page behind the one being sent, bytes: some 10 s of frames. Less drops
/// a page that stalled briefly; more shows a slow page older frames before it is dropped.
constexpr std::size_t kMaxBacklog = 2 * 1024 * 1024;

/// Largest message to a page, bytes: a world of many meshes.
constexpr std::size_t kMostAtOnce = 64 * 1024 * 1024;

/// What a waiting message counts besides its bytes, so that empty ones are bounded too, bytes.
constexpr std::size_t kMessageOverhead = 64;

/// Time for either handshake of a WebSocket.
constexpr std::chrono::seconds kHandshakeTimeout{10};

/// A page that sends nothing, not even the answer to the ping after half this time, is gone.
/// More keeps the hand of a page held longer whose machine vanished; less drops pages on a bad
/// network.
constexpr std::chrono::seconds kIdleTimeout{10};

std::size_t cost(const PageMessage& message) { return message.payload->size() + kMessageOverhead; }

}  // namespace

/// One WebSocket. Kept alive by its pending operations and, until it leaves, by the hub.
class Page : public std::enable_shared_from_this<Page> {
 public:
  Page(PageHub& hub, std::uint64_t id, beast::tcp_stream stream)
      : hub_(hub), id_(id), socket_(std::move(stream)) {}

  void start(const HttpRequest& request);
  /// Ignored unless the page is open; closes it if too much waits for it.
  void send(const PageMessage& message);

 private:
  enum class State {
    kHandshake,  ///< Time from start() until the handshake is sent.
    kOpen,       ///< Registered; reads, and writes what waits. Ends with any error.
    kGone,       ///< Neither in the hub nor in the register; ends with the pending operations.
  };

  void on_start(error_code error);
  void read();
  void on_read(error_code error);
  void write();
  void on_write(error_code error);
  /// Goes to kGone from any state.
  void leave();
  /// Leaves, and drops the connection with all that waits in it.
  void abort();

  PageHub& hub_;
  const std::uint64_t id_;
  websocket::stream<beast::tcp_stream> socket_;
  beast::flat_buffer buffer_;
  std::deque<PageMessage> backlog_;  ///< The first one is being written.
  std::size_t backlog_bytes_ = 0;
  State state_ = State::kHandshake;
};

void Page::start(const HttpRequest& request) {
  beast::get_lowest_layer(socket_).expires_never();
  socket_.set_option(websocket::stream_base::timeout{kHandshakeTimeout, kIdleTimeout, true});
  socket_.read_message_max(kMaxMessage);
  socket_.auto_fragment(false);
  // A page that says goodbye is gone at once, and is not answered behind what it no longer reads.
  socket_.control_callback([this](websocket::frame_type kind, beast::string_view) {
    if (kind == websocket::frame_type::close) backlog_.empty() ? leave() : abort();
  });
  socket_.async_accept(request,
                       [self = shared_from_this()](error_code error) { self->on_start(error); });
}

void Page::on_start(error_code error) {
  if (error) return leave();
  state_ = State::kOpen;
  hub_.pages().open(id_);
  if (hub_.greeting()) send({.payload = hub_.greeting()});
  read();
}

void Page::read() {
  socket_.async_read(buffer_, [self = shared_from_this()](error_code error, std::size_t) {
    self->on_read(error);
  });
}

void Page::on_read(error_code error) {
  if (error || !socket_.got_text()) return abort();
  if (state_ != State::kOpen) return;
  hub_.pages().add(id_, beast::buffers_to_string(buffer_.data()));
  buffer_.consume(buffer_.size());
  read();
}

void Page::send(const PageMessage& message) {
  if (state_ != State::kOpen) return;
  const std::size_t waiting = backlog_.empty() ? 0 : backlog_bytes_ - cost(backlog_.front());
  if (waiting > kMaxBacklog || cost(message) > kMostAtOnce) return abort();
  backlog_bytes_ += cost(message);
  backlog_.push_back(message);
  if (backlog_.size() == 1) write();
}

void Page::write() {
  const PageMessage& message = backlog_.front();
  socket_.binary(message.binary);
  socket_.async_write(
      asio::buffer(*message.payload),
      [self = shared_from_this()](error_code error, std::size_t) { self->on_write(error); });
}

void Page::on_write(error_code error) {
  // The pending read fails as well, once the page has had the time to take the reason.
  if (error) return leave();
  backlog_bytes_ -= cost(backlog_.front());
  backlog_.pop_front();
  if (state_ == State::kOpen && !backlog_.empty()) write();
}

void Page::leave() {
  if (state_ == State::kGone) return;
  if (state_ == State::kOpen) hub_.pages().close(id_);
  state_ = State::kGone;
  hub_.remove(id_);
}

void Page::abort() {
  const auto self = shared_from_this();
  leave();
  // Without lingering: the system would keep trying to send to a page that does not read.
  tcp::socket& socket = beast::get_lowest_layer(socket_).socket();
  error_code ignored;
  socket.set_option(tcp::socket::linger(true, 0), ignored);
  socket.close(ignored);
}

void PageHub::add(beast::tcp_stream stream, const HttpRequest& request) {
  const std::uint64_t id = ++latest_page_;
  const auto page = std::make_shared<Page>(*this, id, std::move(stream));
  pages_.emplace(id, page);
  page->start(request);
}

template <class Wanted>
void PageHub::send_to(Wanted wanted, const PageMessage& message) {
  for (auto next = pages_.begin(); next != pages_.end();) {
    // A page may remove itself as it is sent to.
    const auto [id, page] = *next++;
    if (wanted(id)) page->send(message);
  }
}

void PageHub::publish(const PageMessage& message) {
  send_to([&](std::uint64_t id) { return !message.binary || register_.telemetry(id); }, message);
}

void PageHub::greet(const std::shared_ptr<const std::string>& text) {
  if (greeting_ && *greeting_ == *text) return;
  greeting_ = text;
  publish({.payload = text});
}

void PageHub::answer(std::uint64_t page, const PageMessage& message) {
  send_to([page](std::uint64_t id) { return id == page; }, message);
}

}  // namespace hlm::ve
