// A connection of a browser: requests for files, one after the other, until it becomes a page.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/parser.hpp>

#include "hlm/page/web/host_names.h"
#include "hlm/page/web/page_hub.h"
#include "hlm/page/web/page_token.h"

namespace hlm::ve {

/// What is served.
struct ServedFiles {
  std::filesystem::path root;                     ///< Without symbolic links.
  std::vector<std::filesystem::path> recordings;  ///< Where flight recordings may be.
  PageToken token;
  std::uint16_t partner = 0;   ///< Port of this machine whose pages are taken, too; 0: none.
  bool own_user_only = false;  ///< Other users of this machine are refused.
};

/// Kept alive by its pending operation alone. Of the server's thread.
class HttpConnection : public std::enable_shared_from_this<HttpConnection> {
 public:
  HttpConnection(const ServedFiles& files, PageHub& hub, boost::asio::ip::tcp::socket socket);

  void read();
  /// Ends it, whatever it does.
  void close() { stream_.close(); }

 private:
  const HttpRequest& request() const { return parser_->get(); }
  void on_read(boost::system::error_code error);
  void respond();
  bool shows_token() const;
  std::string ancestors() const;
  bool is_of_own_user();
  void become_page();
  void send_file();
  void send_recording();
  void refuse(boost::beast::http::status status, std::string reason);
  template <class Body>
  void send(boost::beast::http::response<Body> response);
  template <class Body>
  void write(boost::beast::http::response<Body> response);

  const ServedFiles& files_;
  PageHub& hub_;
  HostNames hosts_;
  std::optional<bool> own_user_;  ///< Whether the connection is of this program's user.
  boost::beast::tcp_stream stream_;
  boost::beast::flat_buffer buffer_;
  std::optional<boost::beast::http::request_parser<boost::beast::http::empty_body>> parser_;
};

}  // namespace hlm::ve
