// Boost 1.74 needs <utility> before Asio in C++20.
#include "hlm/page/web/page_server.h"

#include <chrono>
#include <csignal>
#include <deque>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <utility>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>

#include "hlm/page/web/http_connection.h"
#include "hlm/page/web/page_hub.h"
#include "hlm/page/web/static_files.h"

namespace hlm::ve {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

/// Asked of the system for what is sent to one page, bytes. It comes on top of the backlog.
constexpr int kSendBuffer = 256 * 1024;

/// Connections that are not yet pages. A browser opens six for one page. Beyond it the oldest
/// makes room: more lets stalled ones occupy more memory, fewer lets a flood interrupt browsers.
constexpr std::size_t kMaxHttpConnections = 64;

/// Time until the next try when no connection can be accepted, usually for lack of descriptors.
constexpr std::chrono::milliseconds kAcceptPause{100};

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
        files{checked_root(options),
              options.recordings,
              {options.token, std::to_string(port)},
              options.partner,
              options.own_user_only},
        hub(options.max_pages) {
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
    error_code ignored;
    socket.set_option(tcp::no_delay(true), ignored);
    socket.set_option(tcp::socket::send_buffer_size(kSendBuffer), ignored);
    make_room();
    const auto connection = std::make_shared<HttpConnection>(files, hub, std::move(socket));
    connections.push_back(connection);
    connection->read();
  }

  void make_room() {
    std::erase_if(connections, [](const auto& connection) { return connection.expired(); });
    if (connections.size() < kMaxHttpConnections) return;
    if (const auto oldest = connections.front().lock()) oldest->close();
    connections.pop_front();
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
  ServedFiles files;
  PageHub hub;
  std::deque<std::weak_ptr<HttpConnection>> connections;  ///< The oldest first.
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
