// The open pages of a server, each a WebSocket. Of the server's thread, except the register.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/message.hpp>

#include "hlm/page/web/page_register.h"

namespace hlm::ve {

using HttpRequest = boost::beast::http::request<boost::beast::http::empty_body>;

struct PageMessage {
  std::shared_ptr<const std::string> payload;
  bool binary = false;  ///< Sent only to the pages whose telemetry is on.
};

class Page;

class PageHub {
 public:
  explicit PageHub(std::size_t max_pages) : max_pages_(max_pages) {}

  PageRegister& pages() { return register_; }
  const std::shared_ptr<const std::string>& greeting() const { return greeting_; }

  bool has_room() const { return pages_.size() < max_pages_ && !register_.full(); }
  /// Makes a page of a connection whose `request` for it is granted.
  void add(boost::beast::tcp_stream stream, const HttpRequest& request);
  void remove(std::uint64_t page) { pages_.erase(page); }

  void publish(const PageMessage& message);
  void greet(const std::shared_ptr<const std::string>& text);
  void answer(std::uint64_t page, const PageMessage& message);

 private:
  template <class Wanted>
  void send_to(Wanted wanted, const PageMessage& message);

  std::size_t max_pages_;
  PageRegister register_;
  std::shared_ptr<const std::string> greeting_;           ///< Null: none.
  std::map<std::uint64_t, std::shared_ptr<Page>> pages_;  ///< Also those in their handshake.
  std::uint64_t latest_page_ = 0;
};

}  // namespace hlm::ve
