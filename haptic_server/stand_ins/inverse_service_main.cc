// Stands in for Haply's Inverse Service: `inverse_service PORT` on loopback, until SIGINT or
// SIGTERM.
//
// One Inverse3, "STANDIN", and one wireless grip, "GRIP". Motors are on from the first
// set_cursor_force of a client until that client goes; between requests they hold the force, as
// nothing known says otherwise. Faults of StandInFault at this boundary:
//   error       replies report an error instead of a state
//   mirror      the inventory says that the device is set up for the left hand
//   not_finite  positions are null
//   broken      two replies to each request
//   unplug      the device is missing in replies
//   late        replies come 30 ms late
// Those of the handle are the core's. Boost 1.74's Beast needs <utility> before it in C++20.
#include <csignal>
#include <cstdint>
#include <deque>
#include <iostream>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <nlohmann/json.hpp>

#include "hlm/stand_ins/stand_in.h"

namespace hlm::stand_in {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using boost::system::error_code;
using nlohmann::json;

constexpr std::chrono::milliseconds kLateness{30};

json as_json(const Vector3& v) { return {{"x", v.x()}, {"y", v.y()}, {"z", v.z()}}; }

/// The device and the grip as the service reports them.
json report(StandIn& stand_in) {
  if (stand_in.has(StandInFault::kError)) return {{"error", "the device does not answer"}};
  json message{{"inverse3", json::array()}, {"wireless_verse_grip", json::array()}};
  if (stand_in.has(StandInFault::kUnplug)) return message;
  const server::DeviceState state = stand_in.state();
  json position = as_json(state.X_WD.p);
  if (stand_in.has(StandInFault::kNotFinite)) position["x"] = nullptr;
  const json handle{{"cursor_position", position},
                    {"cursor_velocity", as_json(state.V_WD.head<3>())}};
  message["inverse3"] = {{{"device_id", "STANDIN"}, {"state", handle}}};
  json orientation = as_json(state.X_WD.R.vec());
  orientation["w"] = state.X_WD.R.w();
  json buttons;
  for (unsigned i = 0; i < 4; ++i) {
    buttons["button_" + std::to_string(i)] = (state.buttons >> i & 1) != 0;
  }
  const json grip{{"orientation", orientation}, {"buttons", buttons}};
  message["wireless_verse_grip"] = {{{"device_id", "GRIP"}, {"state", grip}}};
  return message;
}

json inventory(StandIn& stand_in) {
  json message = report(stand_in);
  const bool is_left = stand_in.has(StandInFault::kMirror);
  for (json& device : message["inverse3"]) {
    device["config"] = {{"handedness", is_left ? "left" : "right"}};
  }
  return message;
}

/// One client. Kept alive by its pending operations.
class Client : public std::enable_shared_from_this<Client> {
 public:
  Client(StandIn& stand_in, tcp::socket socket) : stand_in_(stand_in), socket_(std::move(socket)) {}
  ~Client() {
    if (commands_) stand_in_.disable();
  }

  void start() {
    beast::get_lowest_layer(socket_).socket().set_option(tcp::no_delay(true));
    socket_.async_accept([self = shared_from_this()](error_code error) {
      if (error) return;
      self->reply(inventory(self->stand_in_).dump());
      self->read();
    });
  }

 private:
  void read() {
    socket_.async_read(buffer_, [self = shared_from_this()](error_code error, std::size_t) {
      if (error) return;
      self->take(json::parse(beast::buffers_to_string(self->buffer_.data()), nullptr, false));
      self->buffer_.consume(self->buffer_.size());
      self->read();
    });
  }

  /// The command acts at once; its reply may be late.
  void take(const json& request) {
    if (request.is_object() && request.contains("inverse3")) obey(request["inverse3"][0]);
    const int replies = stand_in_.has(StandInFault::kBroken) ? 2 : 1;
    for (int i = 0; i < replies; ++i) {
      if (!stand_in_.has(StandInFault::kLate)) {
        reply(report(stand_in_).dump());
        continue;
      }
      const auto timer = std::make_shared<asio::steady_timer>(socket_.get_executor(), kLateness);
      timer->async_wait([self = shared_from_this(), timer](error_code) {
        self->reply(report(self->stand_in_).dump());
      });
    }
  }

  void obey(const json& device) {
    const json commands = device.value("commands", json::object());
    const json command = commands.value("set_cursor_force", json::object());
    if (device.value("device_id", "") != "STANDIN" || command.empty()) return;
    const json force = command.contains("vector") ? command["vector"] : command["values"];
    Wrench F = Wrench::Zero();
    F.head<3>() << force.value("x", 0.0), force.value("y", 0.0), force.value("z", 0.0);
    commands_ = true;
    if (!stand_in_.enabled()) stand_in_.enable();
    stand_in_.command(F);
  }

  void reply(std::string text) {
    backlog_.push_back(std::move(text));
    if (backlog_.size() == 1) write();
  }

  void write() {
    socket_.async_write(asio::buffer(backlog_.front()),
                        [self = shared_from_this()](error_code error, std::size_t) {
                          if (error) return;
                          self->backlog_.pop_front();
                          if (!self->backlog_.empty()) self->write();
                        });
  }

  StandIn& stand_in_;
  websocket::stream<beast::tcp_stream> socket_;
  beast::flat_buffer buffer_;
  std::deque<std::string> backlog_;  ///< The first one is being written.
  bool commands_ = false;            ///< Whether it has commanded a force.
};

void accept(tcp::acceptor& acceptor, StandIn& stand_in) {
  acceptor.async_accept([&](error_code error, tcp::socket socket) {
    if (error) return;
    std::make_shared<Client>(stand_in, std::move(socket))->start();
    accept(acceptor, stand_in);
  });
}

void serve(std::uint16_t port) {
  StandIn stand_in({.freedom = server::DeviceFreedom::kSpatial, .dry_friction = 0});
  asio::io_context context(1);
  tcp::acceptor acceptor(context, {asio::ip::address_v4::loopback(), port});
  asio::signal_set signals(context, SIGINT, SIGTERM);
  signals.async_wait([&](error_code, int) { context.stop(); });
  accept(acceptor, stand_in);
  std::cerr << "listening on 127.0.0.1:" << acceptor.local_endpoint().port() << std::endl;
  context.run();
}

}  // namespace
}  // namespace hlm::stand_in

int main(int argc, char** argv) {
  try {
    const int port = argc == 2 ? std::stoi(argv[1]) : -1;
    if (port < 0 || port > 65535) throw std::invalid_argument("usage: inverse_service PORT");
    hlm::stand_in::run_as_hardware();
    hlm::stand_in::serve(static_cast<std::uint16_t>(port));
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "inverse_service: " << error.what() << '\n';
    return 2;
  }
}
