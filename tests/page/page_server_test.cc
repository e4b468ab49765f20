// The page server over real sockets on loopback.
#include "hlm/page/web/page_server.h"

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <thread>

#include "hlm/page/web/page_token.h"
#include "tests/page/page_client.h"
#include "tests/page/web_root.h"
#include "tests/support/catch.h"

namespace hlm::ve {
namespace {

using Catch::Matchers::ContainsSubstring;
using test::PageClient;
using Request = PageServer::Request;

std::shared_ptr<const std::string> shared(std::string text) {
  return std::make_shared<const std::string>(std::move(text));
}

/// Waits until it holds, up to the clients' patience.
bool soon(const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + test::kPatience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

/// A server on any free port, with a folder of an index.html.
struct Site {
  explicit Site(std::size_t max_pages = 4) {
    root.write("index.html", "<!doctype html>hello");
    server.emplace(PageServerOptions{.port = 0, .root = root.path(), .max_pages = max_pages});
    port = server->port();
  }

  std::string local() const { return std::string("localhost:") + std::to_string(port); }

  /// The next request; REQUIREs that one comes.
  Request next_request() {
    while (requests.empty()) {
      REQUIRE(soon([&] { return !(requests = server->take_requests()).empty(); }));
    }
    const Request request = requests.front();
    requests.erase(requests.begin());
    return request;
  }

  /// The number of an open page.
  std::uint64_t number_of(PageClient& page) {
    page.send("which?");
    const Request request = next_request();
    REQUIRE(request.text == "which?");
    return request.page;
  }

  test::WebRoot root;
  std::optional<PageServer> server;
  std::uint16_t port = 0;
  std::vector<Request> requests;
};

std::string request(const std::string& line, const std::string& host) {
  return line + " HTTP/1.1\r\nHost: " + host + "\r\n\r\n";
}

TEST_CASE("The root is index.html, with the headers that keep strangers out") {
  Site site;
  for (const char* target : {"/", "/index.html", "/?x=1"}) {
    const test::Reply reply = test::ask(site.port, test::get_request(site.port, target));
    CHECK(reply.status == 200);
    CHECK(reply.body == "<!doctype html>hello");
    for (const char* line :
         {"Content-Type: text/html; charset=utf-8", "Cache-Control: no-cache",
          "X-Content-Type-Options: nosniff", "Content-Length: 20",
          "Cross-Origin-Resource-Policy: same-origin",
          "Content-Security-Policy: default-src 'self'; connect-src 'self' ws: ; img-src 'self' "
          "data:; style-src 'self' 'unsafe-inline'; script-src 'self' 'unsafe-inline'; "
          "frame-ancestors localhost:* 127.0.0.1:*\r\n"}) {
      CHECK_THAT(reply.header, ContainsSubstring(line));
    }
  }
}

TEST_CASE("Frames are for pages of this machine, with a token at the address that shows it") {
  const std::string token(32, 'a');
  const test::WebRoot root;
  root.write("index.html", "<!doctype html>");
  PageServer server({.port = 0, .root = root.path(), .token = token});
  const std::string host = "127.0.0.1:" + std::to_string(server.port());
  const auto ancestors = [&](const std::string& target, const std::string& more = "") {
    const std::string header =
        test::ask(server.port(), "GET " + target + " HTTP/1.1\r\nHost: " + host + more + "\r\n\r\n")
            .header;
    const std::string name = "frame-ancestors ";
    const std::size_t at = header.find(name) + name.size();
    return header.substr(at, header.find('\r', at) - at);
  };
  const std::string cookie =
      "\r\nCookie: haptic_page_" + std::to_string(server.port()) + "=" + token;
  CHECK(ancestors("/?token=" + token) == "localhost:* 127.0.0.1:*");
  CHECK(ancestors("/", cookie) == "'none'");
  CHECK(ancestors("/?token=" + token, "\r\nHost: twice") == "'none'");
  CHECK(ancestors("/") == "'none'");
}

TEST_CASE("The newest flight recording is served under its name, and nothing else beside it") {
  const test::WebRoot root;
  const test::WebRoot older;
  const test::WebRoot newer;
  root.write("index.html", "<!doctype html>");
  PageServer server({.port = 0, .root = root.path(), .recordings = {newer.path(), older.path()}});
  const std::string site = "localhost:" + std::to_string(server.port());
  CHECK(test::ask(server.port(), request("GET /recording", site)).status == 404);
  older.write("flight-20261122T080000.000Z-overrun.csv", "older");
  newer.write("flight-20261122T080000.001Z-request.csv", "newer");
  newer.write("notes.csv", "private");
  const test::Reply reply = test::ask(server.port(), request("GET /recording", site));
  CHECK(reply.status == 200);
  CHECK(reply.body == "newer");
  CHECK_THAT(reply.header, ContainsSubstring("flight-20261122T080000.001Z-request.csv"));
  CHECK(test::ask(server.port(), request("GET /notes.csv", site)).status == 404);
}

TEST_CASE("HEAD says what GET would, without the body, on a connection that stays") {
  Site site;
  test::HttpClient client(site.port);
  for (int i = 0; i < 2; ++i) {
    const test::Reply head = client.ask(request("HEAD /", site.local()), false);
    CHECK(head.status == 200);
    CHECK_THAT(head.header, ContainsSubstring("Content-Length: 20"));
    CHECK(client.ask(request("GET /", site.local())).body == "<!doctype html>hello");
    CHECK(client.ask(request("HEAD /missing.js", site.local()), false).status == 404);
    CHECK(client.ask(request("GET /missing.js", site.local())).status == 404);
  }
}

TEST_CASE("A file of some megabytes comes whole") {
  Site site;
  std::string text;
  while (text.size() < 3000000) text += std::to_string(text.size()) + '\n';
  site.root.write("node_modules/three/three.module.js", text);
  const test::Reply reply =
      test::ask(site.port, test::get_request(site.port, "/node_modules/three/three.module.js"));
  CHECK(reply.status == 200);
  CHECK(reply.body == text);
}

TEST_CASE("What is no file of the page is not found") {
  Site site;
  site.root.write("secret.txt", "secret");
  site.root.write("sub/a.js", "a");
  const auto parent = "/../" + site.root.path().filename().string() + "/index.html";
  for (const std::string target :
       {"/missing.html", "/secret.txt", "/sub", "/sub/", "/../etc/passwd", "/sub/../index.html",
        "/%2e%2e/index.html", "/session", "http://localhost/index.html", parent.c_str()}) {
    CAPTURE(target);
    const test::Reply reply = test::ask(site.port, test::get_request(site.port, target));
    CHECK(reply.status == 404);
    CHECK(reply.body == "there is no such file\n");
    CHECK_THAT(reply.header, ContainsSubstring("Content-Type: text/plain"));
  }
}

TEST_CASE("Other methods are not allowed") {
  Site site;
  for (const char* method : {"PUT", "DELETE", "OPTIONS", "TRACE", "BREW"}) {
    CAPTURE(method);
    const test::Reply reply =
        test::ask(site.port, request(std::string(method) + " /", site.local()));
    CHECK(reply.status == 405);
    CHECK_THAT(reply.header, ContainsSubstring("Allow: GET, HEAD"));
  }
  const test::Reply post = test::ask(
      site.port, "POST / HTTP/1.1\r\nHost: " + site.local() + "\r\nContent-Length: 4\r\n\r\nbody");
  CHECK(post.status == 405);
  CHECK_THAT(post.header, ContainsSubstring("Connection: close"));
}

TEST_CASE("A request must name this server") {
  Site site;
  const std::string port = std::string(":") + std::to_string(site.port);
  for (const std::string& host : {"localhost" + port, "127.0.0.1" + port, "LocalHost" + port}) {
    CAPTURE(host);
    CHECK(test::ask(site.port, request("GET /", host)).status == 200);
  }
  for (const std::string& host :
       {"attacker.example" + port, std::string("localhost"), std::string("localhost:1"),
        "localhost.attacker.example" + port, "127.0.0.2" + port, std::string()}) {
    CAPTURE(host);
    const test::Reply reply = test::ask(site.port, request("GET /", host));
    CHECK(reply.status == 403);
    CHECK_THAT(reply.body, ContainsSubstring("localhost" + port));
    CHECK(PageClient(site.port, {.host = host.empty() ? "?" : host}).status() == 403);
  }
  CHECK(test::ask(site.port, "GET / HTTP/1.1\r\n\r\n").status == 403);
  CHECK(test::ask(site.port,
                  "GET / HTTP/1.1\r\nHost: " + site.local() + "\r\nHost: attacker.example\r\n\r\n")
            .status == 403);
}

TEST_CASE("The address that was asked is one of its names") {
  const Site site;
  const PageServer server({.address = "127.0.0.2", .port = 0, .root = site.root.path()});
  // The client connects to 127.0.0.1; another server there would answer.
  CHECK_THROWS(test::ask(server.port(), ""));
  const PageServer all({.address = "0.0.0.0", .port = 0, .root = site.root.path()});
  const std::string port = std::string(":") + std::to_string(all.port());
  CHECK(test::ask(all.port(), request("GET /", "0.0.0.0" + port)).status == 403);
  CHECK(test::ask(all.port(), request("GET /", "127.0.0.1" + port)).status == 200);
  CHECK(test::ask(all.port(), request("GET /", "127.0.0.2" + port)).status == 403);
}

TEST_CASE("A header is at most 8 KiB") {
  Site site;
  const auto with_cookie = [&](std::size_t size) {
    return "GET / HTTP/1.1\r\nHost: " + site.local() + "\r\nCookie: " + std::string(size, 'x') +
           "\r\n\r\n";
  };
  CHECK(test::ask(site.port, with_cookie(7000)).status == 200);
  CHECK(test::ask(site.port, with_cookie(8192)).status == 431);
  // More than is read at once may be reset before the reply is read.
  CHECK(test::ask(site.port, with_cookie(1000000)).status != 200);
}

TEST_CASE("A WebSocket must come from a page of this server") {
  Site site;
  const std::string port = std::string(":") + std::to_string(site.port);
  for (const std::string& host : {"localhost" + port, "127.0.0.1" + port}) {
    CAPTURE(host);
    CHECK(PageClient(site.port, {.host = host, .origin = "http://" + host}).status() == 101);
  }
  for (const std::string& origin :
       {std::string("none"), std::string("null"), "http://attacker.example" + port,
        "https://localhost" + port, std::string("http://localhost"), "localhost" + port,
        "http://localhost" + port + "/", "http://127.0.0.1" + port}) {
    CAPTURE(origin);
    const PageClient page(site.port, {.origin = origin});
    CHECK(page.status() == 403);
    CHECK_THAT(page.reason(), ContainsSubstring("Origin") && ContainsSubstring("localhost" + port));
  }
}

TEST_CASE("A page of the partner opens a WebSocket, and gets no file that others do not") {
  const test::WebRoot root;
  root.write("index.html", "<!doctype html>hello");
  const PageServer first({.port = 0, .root = root.path()});
  const PageServer second({.port = 0, .root = root.path(), .partner = first.port()});
  const std::string here = "localhost:" + std::to_string(second.port());
  const std::string there = "http://localhost:" + std::to_string(first.port());
  CHECK(PageClient(second.port(), {.host = here, .origin = there}).status() == 101);
  CHECK(PageClient(second.port(), {.host = here, .origin = "http://" + here}).status() == 101);
  // The other way round nothing was opened, and the partner's name is no name of this server.
  CHECK(PageClient(first.port(), {.host = there.substr(7), .origin = "http://" + here}).status() ==
        403);
  CHECK(PageClient(second.port(), {.host = there.substr(7), .origin = there}).status() == 403);
  CHECK(PageClient(
            second.port(),
            {.host = here, .origin = "http://attacker.example:" + std::to_string(first.port())})
            .status() == 403);
}

TEST_CASE("WebSockets are at one path only") {
  Site site;
  for (const char* path : {"/", "/session/", "/sessions", "/sessions?x=1", "/index.html"}) {
    CAPTURE(path);
    const PageClient page(site.port, {.path = path});
    CHECK(page.status() == 404);
    CHECK_THAT(page.reason(), ContainsSubstring("/session"));
  }
  CHECK(site.server->pages() == 0);
}

/// A header of an HTTP reply, up to its end or the next semicolon; empty if there is none.
std::string header_of(const test::Reply& reply, const std::string& name) {
  const std::size_t at = reply.header.find(name + ": ");
  if (at == std::string::npos) return "";
  const std::size_t begin = at + name.size() + 2;
  return reply.header.substr(begin, reply.header.find_first_of(";\r", begin) - begin);
}

TEST_CASE("With a token only those who show it get files, recordings and WebSockets") {
  const std::string token = "0123456789abcdef0123456789abcdef";
  const test::WebRoot root;
  root.write("index.html", "<!doctype html>hello");
  const PageServer server({.port = 0, .root = root.path(), .token = token});
  const std::string site = "localhost:" + std::to_string(server.port());
  const auto status = [&](const std::string& target, const std::string& cookie = "") {
    return test::ask(server.port(), "GET " + target + " HTTP/1.1\r\nHost: " + site +
                                        (cookie.empty() ? "" : "\r\nCookie: " + cookie) +
                                        "\r\n\r\n")
        .status;
  };
  const test::Reply page =
      test::ask(server.port(), test::get_request(server.port(), "/?token=" + token));
  CHECK(page.status == 200);
  CHECK_THAT(page.header, ContainsSubstring("HttpOnly; SameSite=Strict"));
  const std::string cookie = header_of(page, "Set-Cookie");
  CHECK(cookie == "haptic_page_" + std::to_string(server.port()) + "=" + token);
  CHECK(status("/index.html", cookie) == 200);
  CHECK(status("/index.html", "a=b; " + cookie + "; c=d") == 200);
  CHECK(PageClient(server.port(), {.path = "/session?token=" + token}).status() == 101);

  std::string longer = token + "0";
  std::string other = token;
  other.back() = '0';
  for (const std::string& shown :
       {std::string(), std::string("0"), other, longer, token.substr(1)}) {
    CAPTURE(shown);
    CHECK(status("/?token=" + shown) == 403);
    CHECK(status("/", "haptic_page_" + std::to_string(server.port()) + "=" + shown) == 403);
    CHECK(PageClient(server.port(), {.path = "/session?token=" + shown}).status() == 403);
  }
  for (const char* target : {"/", "/index.html", "/recording", "/missing.js", "/?t=1"}) {
    CHECK(status(target) == 403);
  }
  CHECK(status("/?token=" + other, cookie) == 403);
  CHECK(PageClient(server.port()).status() == 403);
  CHECK(test::ask(server.port(), test::get_request(server.port(), "/")).body ==
        "the address must end with ?token= and the token in the log of ve_client\n");
}

TEST_CASE("A token is 128 random bits") {
  const std::string token = PageToken::random();
  CHECK(token.size() == 32);
  CHECK(token.find_first_not_of("0123456789abcdef") == std::string::npos);
  CHECK(token != PageToken::random());
}

TEST_CASE("Requests that stall shut nobody out, and end after 5 s") {
  Site site;
  std::vector<std::unique_ptr<test::HttpClient>> stalled;
  for (int i = 0; i < 200; ++i) {
    stalled.push_back(std::make_unique<test::HttpClient>(site.port));
    stalled.back()->send("GET / HTTP/1.1\r\nHost: ");
  }
  CHECK(test::ask(site.port, test::get_request(site.port, "/")).status == 200);
  CHECK(PageClient(site.port).status() == 101);
  const auto begin = std::chrono::steady_clock::now();
  CHECK(stalled.back()->wait_for_end());
  const std::chrono::duration<double> waited = std::chrono::steady_clock::now() - begin;
  CHECK(waited.count() > 2);   // s
  CHECK(waited.count() < 10);  // s
}

TEST_CASE("The greeting comes first, and again when it changes") {
  Site site;
  site.server->set_greeting(shared("scene 1"));
  site.server->publish(shared("to nobody"));
  PageClient first(site.port);
  REQUIRE(soon([&] { return site.server->pages() == 1; }));
  site.server->publish(shared("frame"));
  site.server->set_greeting(shared("scene 1"));
  site.server->set_greeting(shared("scene 2"));
  CHECK(first.text() == "scene 1");
  CHECK(first.text() == "frame");
  CHECK(first.text() == "scene 2");
  PageClient second(site.port);
  CHECK(second.text() == "scene 2");
}

TEST_CASE("What is published reaches all pages in order") {
  Site site;
  PageClient a(site.port);
  PageClient b(site.port);
  REQUIRE(soon([&] { return site.server->pages() == 2; }));
  for (int i = 0; i < 100; ++i)
    site.server->publish(shared(std::string("frame ") + std::to_string(i)));
  site.server->publish(nullptr);
  site.server->publish(shared(""));
  site.server->publish(shared(std::string(1000000, 'x')));
  for (PageClient* page : {&a, &b}) {
    for (int i = 0; i < 100; ++i) CHECK(page->text() == std::string("frame ") + std::to_string(i));
    CHECK(page->text().empty());
    CHECK(page->text() == std::string(1000000, 'x'));
  }
}

TEST_CASE("Telemetry goes to those who asked for it") {
  Site site;
  PageClient with(site.port);
  PageClient without(site.port);
  const std::uint64_t number = site.number_of(with);
  CHECK_FALSE(site.server->telemetry_wanted());
  site.server->set_telemetry(number, true);
  CHECK(site.server->telemetry_wanted());
  REQUIRE(soon([&] { return site.server->pages() == 2; }));
  const std::string bytes("\x00\xFF\x01", 3);
  site.server->publish_binary(shared(bytes));
  site.server->publish(shared("after"));
  const auto received = with.read();
  REQUIRE(received);
  CHECK(received->binary);
  CHECK(received->bytes == bytes);
  const auto text = with.read();
  REQUIRE(text);
  CHECK_FALSE(text->binary);
  CHECK(text->bytes == "after");
  CHECK(without.text() == "after");
  with.close();
  CHECK(soon([&] { return !site.server->telemetry_wanted(); }));
}

TEST_CASE("A request arrives, and its answer goes to that page alone") {
  Site site;
  PageClient a(site.port);
  PageClient b(site.port);
  a.send("from a");
  const Request from_a = site.next_request();
  CHECK(from_a.text == "from a");
  CHECK_FALSE(from_a.closed);
  b.send("from b");
  const Request from_b = site.next_request();
  CHECK(from_b.text == "from b");
  CHECK(from_a.page != from_b.page);
  site.server->answer(from_b.page, "for b");
  site.server->answer(from_a.page, "for a");
  site.server->answer(from_a.page + from_b.page + 1000, "for nobody");
  site.server->publish(shared("for all"));
  CHECK(a.text() == "for a");
  CHECK(a.text() == "for all");
  CHECK(b.text() == "for b");
  CHECK(b.text() == "for all");
}

TEST_CASE("Requests that nobody takes are dropped and counted") {
  Site site;
  PageClient page(site.port);
  for (int i = 0; i < 300; ++i) page.send(std::to_string(i));
  CHECK(soon([&] { return site.server->dropped_requests() == 44; }));
  CHECK(PageClient(site.port).status() == 503);
  const auto taken = site.server->take_requests();
  REQUIRE(taken.size() == 256);
  CHECK(taken.front().text == "0");
  CHECK(taken.back().text == "255");
  CHECK(PageClient(site.port).status() == 101);
}

TEST_CASE("A message of 4096 bytes arrives, a larger one closes the page") {
  Site site;
  PageClient page(site.port);
  page.send(std::string(4096, 'x'));
  const Request whole = site.next_request();
  CHECK(whole.text == std::string(4096, 'x'));
  page.send(std::string(4097, 'x'));
  CHECK_FALSE(page.read());
  CHECK(page.close_code() == 1009);
  const Request closed = site.next_request();
  CHECK(closed.page == whole.page);
  CHECK(closed.closed);
  CHECK(site.server->pages() == 0);
}

TEST_CASE("A binary message closes the page") {
  Site site;
  PageClient page(site.port);
  page.send_binary("x");
  CHECK_FALSE(page.read());
  CHECK(site.next_request().closed);
}

TEST_CASE("A page that does not read is dropped while another goes on") {
  Site site;
  PageClient lazy(site.port);
  const std::uint64_t lazy_number = site.number_of(lazy);
  PageClient diligent(site.port);
  REQUIRE(soon([&] { return site.server->pages() == 2; }));
  // The systems of both sides hold some megabytes before any wait here.
  int published = 0;
  for (; published < 400 && site.server->pages() == 2; ++published) {
    site.server->publish(shared(std::to_string(published) + std::string(256 * 1024, 'x')));
    REQUIRE(diligent.text().starts_with(std::to_string(published) + 'x'));
  }
  CHECK(published > 8);
  CHECK(site.server->pages() == 1);
  const Request closed = site.next_request();
  CHECK(closed.page == lazy_number);
  CHECK(closed.closed);
  site.server->publish(shared("after"));
  CHECK(diligent.text() == "after");
}

TEST_CASE("Publishing returns though no page reads") {
  Site site;
  PageClient lazy(site.port);
  REQUIRE(soon([&] { return site.server->pages() == 1; }));
  const auto frame = shared(std::string(100000, 'x'));
  for (int i = 0; i < 1000; ++i) site.server->publish(frame);
  CHECK(soon([&] { return site.server->pages() == 0; }));
  CHECK(site.next_request().closed);
}

TEST_CASE("A world of many meshes, which is larger than what may wait, reaches the page") {
  Site site;
  PageClient page(site.port);
  REQUIRE(soon([&] { return site.server->pages() == 1; }));  // Else "after it" is before the page.
  site.server->set_greeting(shared(std::string(3 * 1024 * 1024, 'x')));
  site.server->publish(shared("after it"));
  CHECK(page.text().size() == 3 * 1024 * 1024);
  CHECK(page.text() == "after it");
}

TEST_CASE("A message that can never fit closes the page") {
  Site site;
  PageClient page(site.port);
  REQUIRE(soon([&] { return site.server->pages() == 1; }));
  site.server->publish(shared(std::string(64 * 1024 * 1024, 'x')));
  CHECK_FALSE(page.read());
}

TEST_CASE("A page too many is asked to come back") {
  Site site(2);
  std::optional<PageClient> first(site.port);
  const PageClient second(site.port);
  CHECK(second.status() == 101);
  {
    const PageClient third(site.port);
    CHECK(third.status() == 503);
    CHECK_THAT(third.reason(), ContainsSubstring("too many pages"));
  }
  CHECK(test::ask(site.port, test::get_request(site.port, "/")).status == 200);
  first->close();
  REQUIRE(soon([&] { return site.server->pages() == 1; }));
  CHECK(PageClient(site.port).status() == 101);
}

TEST_CASE("A page that says goodbye makes room at once, also if it no longer reads") {
  Site site(1);
  test::HttpClient page(site.port);
  std::string request = test::get_request(site.port, "/session");
  request.insert(
      request.size() - 2,
      "Origin: http://localhost:" + std::to_string(site.port) +
          "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
          "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n");
  REQUIRE(page.ask(request, false).status == 101);
  REQUIRE(soon([&] { return site.server->pages() == 1; }));
  site.server->publish(shared(std::string(60 * 1024 * 1024, 'x')));
  CHECK(PageClient(site.port).status() == 503);
  page.send(std::string("\x88\x80\0\0\0\0", 6));  // A close frame, masked with zeros.
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  while (site.server->pages() == 1 && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  CHECK(site.server->pages() == 0);
  CHECK(PageClient(site.port).status() == 101);
}

TEST_CASE("A page that closes, or whose connection ends, is reported once") {
  Site site;
  std::optional<PageClient> page(site.port);
  const std::uint64_t number = site.number_of(*page);
  SECTION("with a goodbye") { page->close(); }
  SECTION("without one") { page.reset(); }
  const Request closed = site.next_request();
  CHECK(closed.page == number);
  CHECK(closed.closed);
  CHECK(closed.text.empty());
  CHECK(site.server->pages() == 0);
  PageClient next(site.port);
  CHECK(site.number_of(next) != number);
  CHECK(site.requests.empty());
}

TEST_CASE("It ends with pages open and messages waiting, and its port is free at once") {
  Site site;
  PageClient reading(site.port);
  PageClient lazy(site.port);
  test::HttpClient idle(site.port);
  REQUIRE(soon([&] { return site.server->pages() == 2; }));
  for (int i = 0; i < 20; ++i) site.server->publish(shared(std::string(1000000, 'x')));
  site.server.reset();
  while (reading.read()) continue;
  site.server.emplace(PageServerOptions{.port = site.port, .root = site.root.path()});
  CHECK(site.server->port() == site.port);
  CHECK(PageClient(site.port).status() == 101);
}

TEST_CASE("What cannot be served is refused by name") {
  const Site site;
  const auto& root = site.root.path();
  CHECK_THROWS_WITH(PageServer({.port = site.port, .root = root}),
                    ContainsSubstring(std::string("127.0.0.1:") + std::to_string(site.port)) &&
                        ContainsSubstring("in use"));
  CHECK_THROWS_WITH(PageServer({.address = "192.0.2.1", .port = 8080, .root = root}),
                    ContainsSubstring("192.0.2.1:8080"));
  for (const char* address : {"localhost", "::1", "127.0.0.1:80", "127.1", ""}) {
    CHECK_THROWS_WITH(PageServer({.address = address, .port = 8080, .root = root}),
                      ContainsSubstring(std::string(address) + ":8080") &&
                          ContainsSubstring("must be an IPv4 address"));
  }
  const test::WebRoot empty;
  for (const auto& folder : {empty.path(), empty.path() / "missing", std::filesystem::path()}) {
    CHECK_THROWS_WITH(PageServer({.port = 0, .root = folder}),
                      ContainsSubstring("127.0.0.1:0") && ContainsSubstring("index.html") &&
                          ContainsSubstring(folder.string()));
  }
}

}  // namespace
}  // namespace hlm::ve
