// The page of another program's session: a real server with a simulated device, a client of the
// library, the program that serves the page, and a browser's side of it.
#include <csignal>
#include <cstdlib>

#include <nlohmann/json.hpp>

#include "hlm/client/haptic_client.h"
#include "hlm/client/own_server.h"
#include "hlm/common/steady_seconds.h"
#include "hlm/protocol/transport/udp_socket.h"
#include "tests/page/page_client.h"
#include "tests/support/catch.h"
#include "tests/system/process.h"

namespace hlm {
namespace {

using Catch::Matchers::ContainsSubstring;
using nlohmann::json;
using protocol::SceneShapeKind;
using test::wait_until;
using ve::test::PageClient;

std::uint16_t port_of(const std::string& address) {
  const std::size_t colon = address.rfind(':');
  return static_cast<std::uint16_t>(std::stoi(address.substr(colon + 1)));
}

HapticClientOptions ball(const protocol::Endpoint& server) {
  HapticClientOptions options;
  options.server = server;
  options.tool.links.emplace_back().joint = JointType::kFree;
  options.q = Configuration::Zero(7);
  options.q[3] = 1;
  return options;
}

/// A client that goes on frame by frame.
struct Session {
  Session() : own(started()), client(std::in_place, socket, ball(own.endpoint())) {
    protocol::SceneOffer offer;
    protocol::OfferedShape& shape = offer.shapes.emplace_back();
    shape.shape.kind = SceneShapeKind::kSphere;
    shape.shape.size[0] = 0.02;
    shape.side = {SideKind::kToolLink, 0};
    client->offer_scene(offer);
  }
  static OwnServerOptions started() {
    setenv("HAPTIC_SERVER_PROGRAM", HLM_SERVER, 1);
    setenv("HAPTIC_PAGE_PROGRAM", HLM_PAGE_PROGRAM, 1);
    return {};
  }

  bool goes_on_until(const std::function<bool()>& holds) {
    return wait_until(20, [&] {
      const auto inbox = client->poll(steady_seconds());
      if (inbox.state != nullptr) state = *inbox.state;
      client->sample(steady_seconds(), q, Velocity::Zero(6), 0.01);
      client->send(steady_seconds(), {});
      return holds();
    });
  }
  /// Whether the page is sent such a message of a type before others of it have been 1000.
  bool is_shown(PageClient& page, const std::string& type,
                const std::function<bool(const json&)>& holds) {
    for (int i = 0; i < 1000; ++i) {
      goes_on_until([] { return true; });
      const auto received = page.read();
      if (!received) return false;
      if (received->binary) continue;
      const json message = json::parse(received->bytes);
      if (message["type"] == type && holds(message)) return true;
    }
    return false;
  }

  OwnServer own;
  protocol::UdpSocket socket{{}};
  std::optional<HapticClient> client;
  Configuration q = ball({}).q;
  protocol::ProxyState state;
};

TEST_CASE("A page shows the session's shapes and its server's news, and its hand is the device's") {
  Session session;
  PageClient page(port_of(session.client->show()));
  CHECK(session.is_shown(page, "world", [](const json& world) {
    return world["bodies"][0]["shapes"][0]["radius"] == 0.02 && world["methods"].empty() &&
           !world["ranges"].contains("rate");
  }));
  CHECK(session.is_shown(page, "frame", [](const json& frame) {
    return frame["connected"] == true && frame.value("server", "") == "active";
  }));

  page.send(R"({"type":"hand","hold":true,"grab":true,"target":[0.01,0,0.02,1,0,0,0]})");
  CHECK(session.is_shown(page, "frame", [](const json& frame) {
    return frame["held"] == true && frame.contains("device") && frame["device"][2] > 0.01;
  }));
  CHECK(session.state.X_WD.p.z() > 0.01);
  page.send(R"({"type":"settings","stiffness":9000})");
  CHECK(session.is_shown(page, "frame",
                         [](const json& frame) { return frame["settings"]["stiffness"] == 9000; }));
}

TEST_CASE("A page is refused what is the other engine's") {
  Session session;
  PageClient page(port_of(session.client->show()));
  page.send(R"({"type":"environment","rate":30})");
  CHECK(session.is_shown(page, "refused", [](const json& refusal) {
    return refusal["text"] == "type \"environment\" must be of a session of ve_client";
  }));
}

TEST_CASE("What the program holds stays where nobody at the page holds the hand") {
  Session session;
  protocol::Control own;
  own.holds = true;
  own.X_WTarget.p.x() = 0.03;
  session.client->control(own);
  PageClient page(port_of(session.client->show()));
  page.send(R"({"type":"telemetry","on":true})");
  CHECK(session.goes_on_until([&] { return session.state.X_WD.p.x() > 0.02; }));
  CHECK(session.is_shown(page, "frame", [](const json& frame) { return frame["held"] == false; }));
}

TEST_CASE("The page ends with the session, and a second call says where it is") {
  std::optional<Session> session(std::in_place);
  const std::string address = session->client->show();
  CHECK(session->client->show() == address);
  PageClient page(port_of(address));
  session->client.reset();
  while (page.read()) continue;  // What was on its way.
  CHECK_THROWS_WITH(PageClient(port_of(address)), ContainsSubstring("refused"));
}

TEST_CASE("Why there is no page is said in one line") {
  Session session;
  const std::string taken = session.client->show();
  Session other;
  CHECK_THROWS_WITH(other.client->show({.port = port_of(taken)}),
                    ContainsSubstring("no page: cannot serve a page at 127.0.0.1:") &&
                        ContainsSubstring("already in use"));
  setenv("HAPTIC_PAGE_PROGRAM", "/nowhere/page", 1);
  CHECK_THROWS_WITH(other.client->show(),
                    "there is no haptic_page to start: looked for /nowhere/page. Install it, set "
                    "HAPTIC_PAGE_PROGRAM to its file");
  setenv("HAPTIC_PAGE_PROGRAM", "/bin/true", 1);
  CHECK_THROWS_WITH(other.client->show(), "no page: haptic_page has ended");
}

}  // namespace
}  // namespace hlm
