// The server of a live page: its files over HTTP, and one WebSocket session per open page.
//
//   hlm::ve::PageServer server({.port = 0, .root = "web"});
//   server.set_greeting(std::make_shared<const std::string>(scene_as_json()));
//   while (running) {
//     for (const auto& request : server.take_requests()) {
//       if (request.closed) let_go(request.page);
//       else server.answer(request.page, handle(request.text));
//     }
//     server.publish(std::make_shared<const std::string>(frame_as_json()));
//   }
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "hlm/page/web/page_register.h"

namespace hlm::ve {

struct PageServerOptions {
  /// IPv4 address to listen at. Other than loopback lets the network in: nothing is encrypted, and
  /// anyone who connects with the token can change settings and hold the hand.
  std::string address = "127.0.0.1";
  std::uint16_t port = 8080;   ///< 0: any free port.
  std::filesystem::path root;  ///< Folder of the files; has an index.html.
  /// Where flight recordings are looked for; the latest is served at /recording.
  std::vector<std::filesystem::path> recordings = {};
  /// Every request must show it, as ?token=… or by the cookie that the answer to such a one sets;
  /// empty: none is needed.
  std::string token = {};
  /// Takes connections of this program's user, of root, and of who ran it by sudo: other users of
  /// the machine are refused. For loopback.
  bool own_user_only = false;
  /// Port of the one other server of this machine whose pages may open a WebSocket here, too; 0:
  /// none.
  std::uint16_t partner = 0;
  std::size_t max_pages = 4;  ///< WebSocket pages at once; further ones get status 503.
};

/// Serves from a thread of its own. No function waits for the network; all may be called from any
/// thread. A page is known by its number, which is never used again.
///
/// Files: GET and HEAD of what find_static_file() allows, and of /recording. WebSocket: at
/// /session, with a Host header of localhost:PORT, 127.0.0.1:PORT or the address of this machine
/// that the request came to, with PORT, and an Origin of http:// and that Host, with PORT or
/// the partner's. A refusal is a line of plain text that says why.
///
/// A request has 5 s to come. Of more than 64 connections that are no pages the oldest is closed:
/// what stalls shuts nobody out.
///
/// A page is closed when it sends a message above 4096 bytes or a binary one, when it is silent for
/// 10 s (a browser answers our pings by itself), and when it reads so slowly that messages of more
/// than 2 MiB wait behind the one that is being sent. No message, and no greeting, may be larger
/// than 64 MiB.
class PageServer {
 public:
  using Request = PageRequest;

  /// Listens and starts the thread. Throws std::runtime_error with one line, naming address and
  /// port, if the port is in use, the address is no IPv4 address of this machine, or the root has
  /// no index.html.
  explicit PageServer(const PageServerOptions& options);
  /// Ends the thread and disconnects all pages; messages not yet sent are lost.
  ~PageServer();
  PageServer(const PageServer&) = delete;
  PageServer& operator=(const PageServer&) = delete;

  /// The port that it listens at.
  std::uint16_t port() const noexcept;

  /// Sends a text message (UTF-8) to all pages. Here and below, null is ignored.
  void publish(std::shared_ptr<const std::string> text);
  /// Sends a binary message to the pages whose telemetry is on.
  void publish_binary(std::shared_ptr<const std::string> bytes);
  /// The text message that each page gets first from now on; pages that are open get it now, unless
  /// it equals the last one.
  void set_greeting(std::shared_ptr<const std::string> text);
  /// Sends a text message to one page; ignored if that page is closed.
  void answer(std::uint64_t page, std::string text);

  /// What pages sent since the last call, in the order of arrival, and which of them closed.
  std::vector<Request> take_requests();
  /// Messages lost since the start because 256 were waiting to be taken. That a page closed is
  /// never lost; new pages get status 503 while as many wait.
  std::uint64_t dropped_requests() const;

  /// Pages that are open.
  std::size_t pages() const;
  /// Turns telemetry on or off for one page (off at first); ignored if that page is closed.
  void set_telemetry(std::uint64_t page, bool on);
  /// Whether any page has its telemetry on.
  bool telemetry_wanted() const;

 private:
  struct Server;
  std::unique_ptr<Server> server_;
};

}  // namespace hlm::ve
