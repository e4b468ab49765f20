// A browser's side of the page server: requests for files, and pages. Every operation ends within
// kPatience; one that does not is an exception.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

namespace hlm::ve::test {

constexpr std::chrono::seconds kPatience{20};

struct Reply {
  unsigned status = 0;  ///< 0: the server closed the connection without a reply.
  std::string header;   ///< As sent.
  std::string body;
};

/// "GET TARGET HTTP/1.1" and so on, for localhost.
std::string get_request(std::uint16_t port, const std::string& target);

/// One connection for requests, written out in full.
class HttpClient {
 public:
  explicit HttpClient(std::uint16_t port);
  ~HttpClient();

  /// `has_body`: false for the reply to HEAD.
  Reply ask(const std::string& request, bool has_body = true);
  /// Sends something and waits for no reply.
  void send(const std::string& bytes);
  /// Whether the server ends the connection without another byte.
  bool wait_for_end();

 private:
  struct Connection;
  std::unique_ptr<Connection> connection_;
};

/// One request on a connection of its own.
Reply ask(std::uint16_t port, const std::string& request, bool has_body = true);

struct PageAddress {
  std::string host = {};    ///< Of the Host header; empty: localhost:PORT.
  std::string origin = {};  ///< Empty: http://localhost:PORT; "none": no such header.
  std::string path = "/session";
};

struct Received {
  std::string bytes;
  bool binary = false;
};

class PageClient {
 public:
  /// Asks for a WebSocket; see status().
  explicit PageClient(std::uint16_t port, const PageAddress& address = {});
  ~PageClient();

  /// Of the reply: 101 if the page is open.
  unsigned status() const;
  /// The text of a refusal.
  const std::string& reason() const;

  void send(const std::string& text);
  void send_binary(const std::string& bytes);
  /// The next message; none if the server closed the page.
  std::optional<Received> read();
  /// The next message's bytes; "(closed)" if the server closed the page.
  std::string text();
  /// The code with which the server closed the page; 0 if it gave none.
  unsigned close_code() const;
  /// Says goodbye.
  void close();

 private:
  struct Connection;
  std::unique_ptr<Connection> connection_;
};

}  // namespace hlm::ve::test
