#include "tests/page/page_client.h"

#include <array>
#include <sstream>
#include <stdexcept>
#include <utility>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>

namespace hlm::ve::test {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using boost::system::error_code;

/// Does one asynchronous operation to its end, which the timeout of `stream` makes certain.
template <class Start>
error_code finish(asio::io_context& context, beast::tcp_stream& stream, Start start) {
  error_code result;
  stream.expires_after(kPatience);
  start([&result](error_code error, auto&&...) { result = error; });
  context.restart();
  context.run();
  if (result == beast::error::timeout) throw std::runtime_error("the server keeps us waiting");
  return result;
}

void connect(asio::io_context& context, beast::tcp_stream& stream, std::uint16_t port) {
  const tcp::endpoint server(asio::ip::address_v4::loopback(), port);
  const error_code error =
      finish(context, stream, [&](auto done) { stream.async_connect(server, done); });
  if (error) throw std::runtime_error("cannot connect: " + error.message());
}

}  // namespace

std::string get_request(std::uint16_t port, const std::string& target) {
  return "GET " + target + " HTTP/1.1\r\nHost: localhost:" + std::to_string(port) + "\r\n\r\n";
}

struct HttpClient::Connection {
  asio::io_context context;
  beast::tcp_stream stream{context};
  beast::flat_buffer buffer;
};

HttpClient::HttpClient(std::uint16_t port) : connection_(std::make_unique<Connection>()) {
  connect(connection_->context, connection_->stream, port);
}

HttpClient::~HttpClient() = default;

Reply HttpClient::ask(const std::string& request, bool has_body) {
  asio::io_context& context = connection_->context;
  beast::tcp_stream& stream = connection_->stream;
  beast::flat_buffer& buffer = connection_->buffer;
  // A server that has read enough may close before it has all.
  finish(context, stream,
         [&](auto done) { asio::async_write(stream, asio::buffer(request), done); });
  http::response_parser<http::string_body> parser;
  parser.skip(!has_body);
  const error_code error =
      finish(context, stream, [&](auto done) { http::async_read(stream, buffer, parser, done); });
  if (error) return {};
  std::ostringstream header;
  header << parser.get().base();
  return {parser.get().result_int(), header.str(), parser.get().body()};
}

void HttpClient::send(const std::string& bytes) {
  finish(connection_->context, connection_->stream,
         [&](auto done) { asio::async_write(connection_->stream, asio::buffer(bytes), done); });
}

bool HttpClient::wait_for_end() {
  std::array<char, 1> byte{};
  return finish(connection_->context, connection_->stream,
                [&](auto done) { connection_->stream.async_read_some(asio::buffer(byte), done); })
      .failed();
}

Reply ask(std::uint16_t port, const std::string& request, bool has_body) {
  return HttpClient(port).ask(request, has_body);
}

struct PageClient::Connection {
  beast::tcp_stream& stream() { return beast::get_lowest_layer(socket); }

  void send(const std::string& bytes, bool binary) {
    socket.binary(binary);
    finish(context, stream(), [&](auto done) { socket.async_write(asio::buffer(bytes), done); });
  }

  asio::io_context context;
  websocket::stream<beast::tcp_stream> socket{context};
  websocket::response_type response;
};

PageClient::PageClient(std::uint16_t port, const PageAddress& address)
    : connection_(std::make_unique<Connection>()) {
  Connection& c = *connection_;
  const std::string local = std::string("localhost:") + std::to_string(port);
  const std::string host = address.host.empty() ? local : address.host;
  const std::string origin = address.origin.empty() ? "http://" + local : address.origin;
  connect(c.context, c.stream(), port);
  c.socket.set_option(websocket::stream_base::decorator([&](websocket::request_type& request) {
    if (origin != "none") request.set(http::field::origin, origin);
  }));
  finish(c.context, c.stream(),
         [&](auto done) { c.socket.async_handshake(c.response, host, address.path, done); });
}

PageClient::~PageClient() = default;

unsigned PageClient::status() const { return connection_->response.result_int(); }

const std::string& PageClient::reason() const { return connection_->response.body(); }

void PageClient::send(const std::string& text) { connection_->send(text, false); }

void PageClient::send_binary(const std::string& bytes) { connection_->send(bytes, true); }

std::optional<Received> PageClient::read() {
  Connection& c = *connection_;
  beast::flat_buffer buffer;
  const error_code error =
      finish(c.context, c.stream(), [&](auto done) { c.socket.async_read(buffer, done); });
  if (error) return std::nullopt;
  return Received{beast::buffers_to_string(buffer.data()), c.socket.got_binary()};
}

std::string PageClient::text() {
  const std::optional<Received> received = read();
  return received ? received->bytes : "(closed)";
}

unsigned PageClient::close_code() const { return connection_->socket.reason().code; }

void PageClient::close() {
  Connection& c = *connection_;
  finish(c.context, c.stream(),
         [&](auto done) { c.socket.async_close(websocket::close_code::normal, done); });
}

}  // namespace hlm::ve::test
