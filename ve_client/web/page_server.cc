// The one file that touches Boost.Beast. Boost 1.74 needs <utility> before it in C++20.
#include "ve_client/web/page_server.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <deque>
#include <map>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>

#include "common/settings/directories.h"
#include "ve_client/web/host_names.h"
#include "ve_client/web/static_files.h"

namespace hlm::ve {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using boost::system::error_code;
using Text = std::shared_ptr<const std::string>;
using HttpRequest = http::request<http::empty_body>;

constexpr std::string_view kSessionPath = "/session";
constexpr std::string_view kRecordingPath = "/recording";

/// Largest header of an HTTP request, bytes; browsers send under 2 KiB. Less refuses pages on a
/// host with many cookies.
constexpr std::uint32_t kMaxHeader = 8 * 1024;

/// Largest message from a page, bytes; a hand or a setting takes some hundred. More lets a page
/// occupy more memory: PageRegister::kMaxRequests times as much.
constexpr std::size_t kMaxMessage = 4096;

/// Messages waiting for one page, bytes: some 10 s of frames. Less drops a page that stalled
/// briefly; more shows a slow page older frames before it is dropped.
constexpr std::size_t kMaxBacklog = 2 * 1024 * 1024;

/// What a waiting message counts besides its bytes, so that empty ones are bounded too, bytes.
constexpr std::size_t kMessageOverhead = 64;

/// Asked of the system for what is sent to one page, bytes. It comes on top of the backlog.
constexpr int kSendBuffer = 256 * 1024;

/// Connections that are not yet pages. A browser opens six for one page; when they are all in use
/// a further one is closed at once.
constexpr long kMaxHttpConnections = 64;

/// For a request to come, and for a file to be sent. Less closes idle connections that a browser
/// would have used again; more lets stalled ones occupy their places for longer.
constexpr std::chrono::seconds kHttpTimeout{30};

/// For either handshake of a WebSocket.
constexpr std::chrono::seconds kHandshakeTimeout{10};

/// A page that sends nothing, not even the answer to the ping after half this time, is gone.
/// More keeps the hand of a page held longer whose machine vanished; less drops pages on a bad
/// network.
constexpr std::chrono::seconds kIdleTimeout{10};

/// Until the next try when no connection can be accepted, usually for lack of file descriptors.
constexpr std::chrono::milliseconds kAcceptPause{100};

/// The page's import map is inline, so scripts need 'unsafe-inline'.
constexpr const char* kContentSecurityPolicy =
    "default-src 'self'; connect-src 'self' ws: ; img-src 'self' data:; "
    "style-src 'self' 'unsafe-inline'; script-src 'self' 'unsafe-inline'";

std::string_view to_std(beast::string_view text) { return {text.data(), text.size()}; }
beast::string_view to_beast(std::string_view text) { return {text.data(), text.size()}; }

struct Message {
  Text payload;
  bool binary = false;
};

class Page;

/// What the connections of one server share; of the server's thread, except the register.
class Hub {
 public:
  Hub(std::filesystem::path root, std::vector<std::filesystem::path> recordings,
      std::size_t max_pages)
      : root_(std::move(root)), recordings_(std::move(recordings)), max_pages_(max_pages) {}

  const std::filesystem::path& root() const { return root_; }
  /// The newest recording, if there is one.
  std::optional<std::filesystem::path> recording() const {
    return settings::find_newest_recording(recordings_);
  }
  PageRegister& pages() { return register_; }
  const Text& greeting() const { return greeting_; }

  bool has_room() const { return pages_.size() < max_pages_ && !register_.full(); }
  /// Makes a page of a connection whose `request` for it is granted.
  void add(beast::tcp_stream stream, const HttpRequest& request);
  void remove(std::uint64_t page) { pages_.erase(page); }

  void publish(const Message& message);
  void greet(const Text& text);
  void answer(std::uint64_t page, const Message& message);

 private:
  template <class Wanted>
  void send_to(Wanted wanted, const Message& message);

  std::filesystem::path root_;
  std::vector<std::filesystem::path> recordings_;  ///< Where they may be.
  std::size_t max_pages_;
  PageRegister register_;
  Text greeting_;                                         ///< Null: none.
  std::map<std::uint64_t, std::shared_ptr<Page>> pages_;  ///< Also those in their handshake.
  std::uint64_t latest_page_ = 0;
};

/// One WebSocket. Kept alive by its pending operations and, until it leaves, by the hub.
class Page : public std::enable_shared_from_this<Page> {
 public:
  Page(Hub& hub, std::uint64_t id, beast::tcp_stream stream)
      : hub_(hub), id_(id), socket_(std::move(stream)) {}

  void start(const HttpRequest& request);
  /// Ignored unless the page is open; closes it if too much waits for it.
  void send(const Message& message);

 private:
  enum class State {
    kHandshake,  ///< From start() until the handshake is sent.
    kOpen,       ///< In the register; reads, and writes what waits. Ends with any error.
    kGone,       ///< Neither in the hub nor in the register; ends with the pending operations.
  };

  void on_start(error_code error);
  void read();
  void on_read(error_code error);
  void write();
  void on_write(error_code error);
  /// To kGone from any state.
  void leave();
  /// Leaves, and drops the connection with all that waits in it.
  void abort();

  Hub& hub_;
  const std::uint64_t id_;
  websocket::stream<beast::tcp_stream> socket_;
  beast::flat_buffer buffer_;
  std::deque<Message> backlog_;  ///< The first one is being written.
  std::size_t backlog_bytes_ = 0;
  State state_ = State::kHandshake;
};

std::size_t cost(const Message& message) { return message.payload->size() + kMessageOverhead; }

void Page::start(const HttpRequest& request) {
  beast::get_lowest_layer(socket_).expires_never();
  socket_.set_option(websocket::stream_base::timeout{kHandshakeTimeout, kIdleTimeout, true});
  socket_.read_message_max(kMaxMessage);
  socket_.auto_fragment(false);
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

void Page::send(const Message& message) {
  if (state_ != State::kOpen) return;
  if (backlog_bytes_ + cost(message) > kMaxBacklog) return abort();
  backlog_bytes_ += cost(message);
  backlog_.push_back(message);
  if (backlog_.size() == 1) write();
}

void Page::write() {
  const Message& message = backlog_.front();
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

void Hub::add(beast::tcp_stream stream, const HttpRequest& request) {
  const std::uint64_t id = ++latest_page_;
  const auto page = std::make_shared<Page>(*this, id, std::move(stream));
  pages_.emplace(id, page);
  page->start(request);
}

template <class Wanted>
void Hub::send_to(Wanted wanted, const Message& message) {
  for (auto next = pages_.begin(); next != pages_.end();) {
    // A page may remove itself as it is sent to.
    const auto [id, page] = *next++;
    if (wanted(id)) page->send(message);
  }
}

void Hub::publish(const Message& message) {
  send_to([&](std::uint64_t id) { return !message.binary || register_.telemetry(id); }, message);
}

void Hub::greet(const Text& text) {
  if (greeting_ && *greeting_ == *text) return;
  greeting_ = text;
  publish({.payload = text});
}

void Hub::answer(std::uint64_t page, const Message& message) {
  send_to([page](std::uint64_t id) { return id == page; }, message);
}

HostNames names_of(const tcp::socket& socket) {
  error_code ignored;
  const tcp::endpoint local = socket.local_endpoint(ignored);
  return {local.address().to_string(), local.port()};
}

/// The only header of that name; empty if there is none or more than one.
std::string_view only(const HttpRequest& request, http::field name) {
  return request.count(name) == 1 ? to_std(request[name]) : std::string_view();
}

/// One connection that is not (yet) a page: requests for files, one after the other. Kept alive by
/// its pending operation alone.
class HttpConnection : public std::enable_shared_from_this<HttpConnection> {
 public:
  /// `place` is held for the life of the connection.
  HttpConnection(Hub& hub, tcp::socket socket, std::shared_ptr<const void> place)
      : hub_(hub), place_(std::move(place)), hosts_(names_of(socket)), stream_(std::move(socket)) {}

  void read();

 private:
  const HttpRequest& request() const { return parser_->get(); }
  void on_read(error_code error);
  void respond();
  void become_page();
  void send_file();
  void send_recording();
  void refuse(http::status status, std::string reason);
  template <class Body>
  void send(http::response<Body> response);
  template <class Body>
  void write(http::response<Body> response);

  Hub& hub_;
  std::shared_ptr<const void> place_;
  HostNames hosts_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{2 * kMaxHeader};
  std::optional<http::request_parser<http::empty_body>> parser_;
};

void HttpConnection::read() {
  parser_.emplace();
  parser_->header_limit(kMaxHeader);
  stream_.expires_after(kHttpTimeout);
  http::async_read_header(
      stream_, buffer_, *parser_,
      [self = shared_from_this()](error_code error, std::size_t) { self->on_read(error); });
}

void HttpConnection::on_read(error_code error) {
  if (error == http::error::header_limit || error == http::error::buffer_overflow) {
    return refuse(http::status::request_header_fields_too_large,
                  "the header must be at most " + std::to_string(kMaxHeader) + " bytes");
  }
  if (!error) respond();
}

void HttpConnection::respond() {
  if (!hosts_.is_host(only(request(), http::field::host))) {
    return refuse(http::status::forbidden, "the Host header must be one of " + hosts_.list());
  }
  if (websocket::is_upgrade(request())) return become_page();
  const http::verb method = request().method();
  if (method != http::verb::get && method != http::verb::head) {
    return refuse(http::status::method_not_allowed, "only GET and HEAD are allowed");
  }
  if (to_std(request().target()) == kRecordingPath) return send_recording();
  send_file();
}

void HttpConnection::become_page() {
  if (to_std(request().target()) != kSessionPath) {
    return refuse(http::status::not_found,
                  "WebSockets are at " + std::string(kSessionPath) + " only");
  }
  if (!hosts_.is_origin(only(request(), http::field::origin))) {
    return refuse(http::status::forbidden,
                  "the Origin header must be http:// and one of " + hosts_.list());
  }
  if (!parser_->is_done() || buffer_.size() != 0) {
    return refuse(http::status::bad_request, "nothing may follow the request for a WebSocket");
  }
  if (!hub_.has_room()) {
    return refuse(http::status::service_unavailable, "too many pages are open: close one");
  }
  hub_.add(std::move(stream_), request());
}

void HttpConnection::send_file() {
  const auto file = find_static_file(hub_.root(), to_std(request().target()));
  http::response<http::file_body> response;
  error_code error = http::make_error_code(http::error::end_of_stream);
  if (file) response.body().open(file->path.c_str(), beast::file_mode::scan, error);
  if (error) return refuse(http::status::not_found, "there is no such file");
  response.set(http::field::content_type, to_beast(file->content_type));
  send(std::move(response));
}

void HttpConnection::send_recording() {
  const auto file = hub_.recording();
  http::response<http::file_body> response;
  error_code error = http::make_error_code(http::error::end_of_stream);
  if (file) response.body().open(file->c_str(), beast::file_mode::scan, error);
  if (error) return refuse(http::status::not_found, "haptic_server has left no recording here");
  response.set(http::field::content_type, "text/csv; charset=utf-8");
  response.set(http::field::content_disposition,
               "attachment; filename=\"" + file->filename().string() + '"');
  send(std::move(response));
}

void HttpConnection::refuse(http::status status, std::string reason) {
  http::response<http::string_body> response;
  response.result(status);
  response.set(http::field::content_type, "text/plain; charset=utf-8");
  if (status == http::status::method_not_allowed) response.set(http::field::allow, "GET, HEAD");
  response.body() = std::move(reason) + "\n";
  send(std::move(response));
}

template <class Body>
void HttpConnection::send(http::response<Body> response) {
  response.set(http::field::cache_control, "no-cache");
  response.set(http::field::x_frame_options, "DENY");
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Content-Security-Policy", kContentSecurityPolicy);
  response.set("Cross-Origin-Resource-Policy", "same-origin");
  // Bodies of requests are not read, so nothing can follow them.
  response.keep_alive(parser_->is_done() && request().keep_alive());
  response.prepare_payload();
  if (request().method() != http::verb::head) return write(std::move(response));
  write(http::response<http::empty_body>(std::move(response.base())));
}

template <class Body>
void HttpConnection::write(http::response<Body> response) {
  const auto kept = std::make_shared<http::response<Body>>(std::move(response));
  stream_.expires_after(kHttpTimeout);
  http::async_write(stream_, *kept,
                    [self = shared_from_this(), kept](error_code error, std::size_t) {
                      if (error || !kept->keep_alive()) return;
                      self->read();
                    });
}

std::string name(const PageServerOptions& options) {
  return options.address + ":" + std::to_string(options.port);
}

[[noreturn]] void fail(const PageServerOptions& options, const std::string& why) {
  throw std::runtime_error("cannot serve a page at " + name(options) + ": " + why);
}

tcp::endpoint endpoint(const PageServerOptions& options) {
  error_code error;
  const asio::ip::address_v4 address = asio::ip::make_address_v4(options.address, error);
  if (error) {
    fail(options, "\"" + options.address + "\" must be an IPv4 address, for example 127.0.0.1");
  }
  return {address, options.port};
}

/// The folder of the files without symbolic links.
std::filesystem::path checked_root(const PageServerOptions& options) {
  std::error_code error;
  std::filesystem::path root = std::filesystem::canonical(options.root, error);
  if (error || !find_static_file(root, "/")) {
    fail(options, "the folder \"" + options.root.string() + "\" has no index.html");
  }
  return root;
}

tcp::acceptor listen(asio::io_context& context, const PageServerOptions& options) {
  const tcp::endpoint local = endpoint(options);
  tcp::acceptor acceptor(context);
  error_code error;
  acceptor.open(local.protocol(), error);
  // Lets a restart have the port at once; two servers cannot have it.
  if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor.bind(local, error);
  if (!error) acceptor.listen(tcp::acceptor::max_listen_connections, error);
  if (error) fail(options, error.message());
  return acceptor;
}

/// Keeps signals from the threads started in its life: they are for the program's own threads.
class SignalsBlocked {
 public:
  SignalsBlocked() {
    sigset_t all;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before_);
  }
  ~SignalsBlocked() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  SignalsBlocked(const SignalsBlocked&) = delete;
  SignalsBlocked& operator=(const SignalsBlocked&) = delete;

 private:
  sigset_t before_;
};

}  // namespace

struct PageServer::Server {
  explicit Server(const PageServerOptions& options)
      : acceptor(listen(context, options)),
        port(acceptor.local_endpoint().port()),
        hub(checked_root(options), options.recordings, options.max_pages) {
    accept();
    const SignalsBlocked blocked;
    thread = std::thread([this] { context.run(); });
  }

  ~Server() {
    context.stop();
    thread.join();
  }

  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  void accept() {
    acceptor.async_accept([this](error_code error, tcp::socket socket) {
      if (error) return accept_later();
      start(std::move(socket));
      accept();
    });
  }

  void accept_later() {
    accept_pause.expires_after(kAcceptPause);
    accept_pause.async_wait([this](error_code) { accept(); });
  }

  void start(tcp::socket socket) {
    // One user of the places is the server itself.
    if (places.use_count() > kMaxHttpConnections) return;
    error_code ignored;
    socket.set_option(tcp::no_delay(true), ignored);
    socket.set_option(tcp::socket::send_buffer_size(kSendBuffer), ignored);
    std::make_shared<HttpConnection>(hub, std::move(socket), places)->read();
  }

  /// Runs `action` on the server's thread, in the order of calls.
  template <class Action>
  void post(Action action) {
    asio::post(context, std::move(action));
  }

  asio::io_context context{1};
  tcp::acceptor acceptor;
  asio::steady_timer accept_pause{context};
  std::uint16_t port;
  Hub hub;
  std::shared_ptr<const void> places = std::make_shared<char>();
  std::thread thread;
};

PageServer::PageServer(const PageServerOptions& options)
    : server_(std::make_unique<Server>(options)) {}

PageServer::~PageServer() = default;

std::uint16_t PageServer::port() const noexcept { return server_->port; }

void PageServer::publish(std::shared_ptr<const std::string> text) {
  if (!text) return;
  server_->post([&hub = server_->hub, text = std::move(text)] { hub.publish({.payload = text}); });
}

void PageServer::publish_binary(std::shared_ptr<const std::string> bytes) {
  if (!bytes) return;
  server_->post([&hub = server_->hub, bytes = std::move(bytes)] {
    hub.publish({.payload = bytes, .binary = true});
  });
}

void PageServer::set_greeting(std::shared_ptr<const std::string> text) {
  if (!text) return;
  server_->post([&hub = server_->hub, text = std::move(text)] { hub.greet(text); });
}

void PageServer::answer(std::uint64_t page, std::string text) {
  server_->post(
      [&hub = server_->hub, page, text = std::make_shared<const std::string>(std::move(text))] {
        hub.answer(page, {.payload = text});
      });
}

std::vector<PageServer::Request> PageServer::take_requests() { return server_->hub.pages().take(); }

std::uint64_t PageServer::dropped_requests() const { return server_->hub.pages().dropped(); }

std::size_t PageServer::pages() const { return server_->hub.pages().pages(); }

void PageServer::set_telemetry(std::uint64_t page, bool on) {
  server_->hub.pages().set_telemetry(page, on);
}

bool PageServer::telemetry_wanted() const { return server_->hub.pages().telemetry_wanted(); }

}  // namespace hlm::ve
