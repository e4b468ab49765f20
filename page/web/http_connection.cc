#include "hlm/page/web/http_connection.h"

#include <chrono>
#include <string_view>

#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket/rfc6455.hpp>

#include "hlm/common/settings/directories.h"
#include "hlm/page/web/local_user.h"
#include "hlm/page/web/static_files.h"

namespace hlm::ve {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using boost::system::error_code;

constexpr std::string_view kSessionPath = "/session";
constexpr std::string_view kRecordingPath = "/recording";

/// Largest header of an HTTP request, bytes; browsers send under 2 KiB. Less refuses pages on a
/// host with many cookies.
constexpr std::uint32_t kMaxHeader = 8 * 1024;

/// Time for a whole request to come. Less closes idle connections that a browser would have used
/// again; more lets stalled ones occupy their places for longer.
constexpr std::chrono::seconds kRequestTimeout{5};

/// Time for a file to be sent. Less refuses the page to slow networks: it is 1 MB in all.
constexpr std::chrono::seconds kReplyTimeout{30};

/// The page's import map is inline, so scripts need 'unsafe-inline'.
constexpr const char* kContentSecurityPolicy =
    "default-src 'self'; connect-src 'self' ws: ; img-src 'self' data:; "
    "style-src 'self' 'unsafe-inline'; script-src 'self' 'unsafe-inline'; frame-ancestors ";

std::string_view to_std(beast::string_view text) { return {text.data(), text.size()}; }
beast::string_view to_beast(std::string_view text) { return {text.data(), text.size()}; }

std::string_view path_of(std::string_view target) { return target.substr(0, target.find('?')); }

/// Whose frames may show the page. One laid unseen under a stranger's page would take the person's
/// clicks: every page around it, up to the window's, must be of this machine, a notebook for
/// example. Of such pages some may be another user's, so with a token the frame's own address must
/// show it: the cookie, which the browser adds by itself, does not count.
std::string ancestors_of(std::string_view host, bool shows_token) {
  const std::string_view name = host.substr(0, host.rfind(':'));
  if (!shows_token) return "'none'";
  if (name != "localhost" && name != "127.0.0.1") return std::string(name) + ":*";
  return "localhost:* 127.0.0.1:*";
}

HostNames names_of(const tcp::socket& socket, std::uint16_t partner) {
  error_code ignored;
  const tcp::endpoint local = socket.local_endpoint(ignored);
  return {local.address().to_string(), local.port(), partner};
}

/// The only header of that name; empty if there is none or more than one.
std::string_view only(const HttpRequest& request, http::field name) {
  return request.count(name) == 1 ? to_std(request[name]) : std::string_view();
}

}  // namespace

HttpConnection::HttpConnection(const ServedFiles& files, PageHub& hub, tcp::socket socket)
    : files_(files),
      hub_(hub),
      hosts_(names_of(socket, files.partner)),
      stream_(std::move(socket)),
      buffer_(2 * kMaxHeader) {}

void HttpConnection::read() {
  parser_.emplace();
  parser_->header_limit(kMaxHeader);
  stream_.expires_after(kRequestTimeout);
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
  if (!shows_token()) {
    return refuse(http::status::forbidden,
                  "the address must end with ?token= and the token in the log of ve_client");
  }
  if (files_.own_user_only && !is_of_own_user()) {
    return refuse(
        http::status::forbidden,
        "this page is for the user who started it, and for root: open it as that user, or "
        "start it with --key-file, with which it asks for a token, or with --insecure");
  }
  if (websocket::is_upgrade(request())) return become_page();
  const http::verb method = request().method();
  if (method != http::verb::get && method != http::verb::head) {
    return refuse(http::status::method_not_allowed, "only GET and HEAD are allowed");
  }
  if (path_of(to_std(request().target())) == kRecordingPath) return send_recording();
  send_file();
}

bool HttpConnection::shows_token() const {
  return files_.token.is_shown(
      {.target = to_std(request().target()), .cookies = only(request(), http::field::cookie)});
}

std::string HttpConnection::ancestors() const {
  const std::string_view host = only(request(), http::field::host);
  if (!hosts_.is_host(host)) return ancestors_of({}, false);
  return ancestors_of(host,
                      files_.token.is_shown({.target = to_std(request().target()), .cookies = {}}));
}

/// Looked up once in a connection's life.
bool HttpConnection::is_of_own_user() {
  if (!own_user_) {
    const auto end = [](const tcp::endpoint& endpoint) {
      return ConnectionEnd{static_cast<std::uint32_t>(endpoint.address().to_v4().to_ulong()),
                           endpoint.port()};
    };
    error_code error;
    const tcp::endpoint local = stream_.socket().local_endpoint(error);
    const tcp::endpoint remote = stream_.socket().remote_endpoint(error);
    const auto user = error ? std::nullopt : user_of_other_end(end(local), end(remote));
    own_user_ = user && is_own_user(*user);
  }
  return *own_user_;
}

void HttpConnection::become_page() {
  if (path_of(to_std(request().target())) != kSessionPath) {
    return refuse(http::status::not_found,
                  "WebSockets are at " + std::string(kSessionPath) + " only");
  }
  if (!hosts_.is_origin(only(request(), http::field::origin), only(request(), http::field::host))) {
    return refuse(http::status::forbidden,
                  "the Origin header must be http:// and the Host header, one of " + hosts_.list());
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
  const auto file = find_static_file(files_.root, to_std(request().target()));
  http::response<http::file_body> response;
  error_code error = http::make_error_code(http::error::end_of_stream);
  if (file) response.body().open(file->path.c_str(), beast::file_mode::scan, error);
  if (error) return refuse(http::status::not_found, "there is no such file");
  response.set(http::field::content_type, to_beast(file->content_type));
  if (const std::string cookie = files_.token.cookie(); !cookie.empty()) {
    response.set(http::field::set_cookie, cookie);
  }
  send(std::move(response));
}

void HttpConnection::send_recording() {
  const auto file = settings::find_newest_recording(files_.recordings);
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
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Content-Security-Policy", kContentSecurityPolicy + ancestors());
  response.set("Cross-Origin-Resource-Policy", "same-origin");
  response.set("Referrer-Policy", "no-referrer");  // The address may hold the token.
  // Bodies of requests are not read, so nothing can follow them.
  response.keep_alive(parser_->is_done() && request().keep_alive());
  response.prepare_payload();
  if (request().method() != http::verb::head) return write(std::move(response));
  write(http::response<http::empty_body>(std::move(response.base())));
}

template <class Body>
void HttpConnection::write(http::response<Body> response) {
  const auto kept = std::make_shared<http::response<Body>>(std::move(response));
  stream_.expires_after(kReplyTimeout);
  http::async_write(stream_, *kept,
                    [self = shared_from_this(), kept](error_code error, std::size_t) {
                      if (error || !kept->keep_alive()) return;
                      self->read();
                    });
}

}  // namespace hlm::ve
