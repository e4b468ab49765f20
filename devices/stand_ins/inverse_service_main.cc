// Stands in for Haply's Inverse Service: `inverse_service PORT [EVENTS]` on loopback, until SIGINT
// or SIGTERM. EVENTS: port of the events; without it there are none, as before 3.5.
//
// HAPTIC_STAND_IN_STATE has words: values, it knows a force by that older name only; wired, its
// grip has one button; no_power, no_echo.
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
//   force_off   its emergency brake is on, as an event says
// Those of the handle are the core's. Boost 1.74's Beast needs <utility> before it in C++20.
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <deque>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <nlohmann/json.hpp>

#include "hlm/devices/stand_ins/stand_in.h"

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

bool has_word(std::string_view word) {
  const char* const words = std::getenv("HAPTIC_STAND_IN_STATE");
  return words != nullptr && std::string_view(words).find(word) != std::string_view::npos;
}

/// The force that was taken last, N.
Vector3 taken = Vector3::Zero();

/// The device and the grip as the service reports them.
json report(StandIn& stand_in) {
  if (stand_in.has(StandInFault::kError)) return {{"error", "the device does not answer"}};
  json message{{"inverse3", json::array()}, {"wireless_verse_grip", json::array()}};
  if (stand_in.has(StandInFault::kUnplug)) return message;
  const server::DeviceState state = stand_in.state();
  json position = as_json(state.X_WD.p);
  if (stand_in.has(StandInFault::kNotFinite)) position["x"] = nullptr;
  json handle{{"cursor_position", position}, {"cursor_velocity", as_json(state.V_WD.head<3>())}};
  if (!has_word("no_echo")) handle["current_cursor_force"] = as_json(taken);
  const json status{{"power_supply", !has_word("no_power")}, {"calibrated", true}, {"ready", true}};
  message["inverse3"] = {{{"device_id", "STANDIN"}, {"state", handle}, {"status", status}}};
  json orientation = as_json(state.X_WD.R.vec());
  orientation["w"] = state.X_WD.R.w();
  json buttons;
  for (unsigned i = 0; i < 4; ++i) {
    buttons["button_" + std::to_string(i)] = (state.buttons >> i & 1) != 0;
  }
  json grip{{"orientation", orientation}, {"buttons", buttons}};
  if (has_word("wired"))
    grip = {{"orientation", orientation}, {"button", (state.buttons & 1) != 0}};
  message[has_word("wired") ? "verse_grip" : "wireless_verse_grip"] = {
      {{"device_id", "GRIP"}, {"state", grip}}};
  return message;
}

json inventory(StandIn& stand_in) {
  json message = report(stand_in);
  const bool is_left = stand_in.has(StandInFault::kMirror);
  if (!has_word("values")) message["session_id"] = 7;
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
    const char* const field = has_word("values") ? "values" : "vector";
    commands_ = true;
    if (!stand_in_.enabled()) stand_in_.enable();
    if (!command.contains(field)) return;
    const json force = command[field];
    Wrench F = Wrench::Zero();
    F.head<3>() << force.value("x", 0.0), force.value("y", 0.0), force.value("z", 0.0);
    taken = F.head<3>();
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

/// Tells all who listen of the brake.
class Events {
 public:
  Events(asio::io_context& context, std::uint16_t port, StandIn& stand_in)
      : stand_in_(stand_in),
        acceptor_(context, {asio::ip::address_v4::loopback(), port}),
        timer_(context) {
    accept();
    look();
  }

 private:
  using Socket = websocket::stream<beast::tcp_stream>;

  void accept() {
    acceptor_.async_accept([this](error_code error, tcp::socket socket) {
      if (error) return;
      const auto listener = std::make_shared<Socket>(std::move(socket));
      listener->async_accept([this, listener](error_code refused) {
        if (!refused) listeners_.push_back(listener);
      });
      accept();
    });
  }

  void look() {
    timer_.expires_after(std::chrono::milliseconds(2));
    timer_.async_wait([this](error_code error) {
      if (error) return;
      const bool brakes = stand_in_.has(StandInFault::kForceOff);
      if (brakes != std::exchange(brakes_, brakes)) tell();
      look();
    });
  }

  void tell() {
    const json event{{"name", "device-safety-triggered"},
                     {"category", "device"},
                     {"level", brakes_ ? "error" : "notice"},
                     {"data",
                      {{"device_id", "STANDIN"},
                       {"safety_type", brakes_ ? "ebrake_triggered" : "ebrake_released"}}},
                     {"message", brakes_ ? "Emergency brake engaged" : "Emergency brake released"}};
    for (const auto& listener : listeners_) {
      error_code ignored;
      listener->write(asio::buffer(event.dump()), ignored);
    }
  }

  StandIn& stand_in_;
  tcp::acceptor acceptor_;
  asio::steady_timer timer_;
  std::vector<std::shared_ptr<Socket>> listeners_;
  bool brakes_ = false;
};

void serve(std::uint16_t port, std::optional<std::uint16_t> events_port) {
  StandIn stand_in({.freedom = server::DeviceFreedom::kSpatial, .dry_friction = 0});
  asio::io_context context(1);
  tcp::acceptor acceptor(context, {asio::ip::address_v4::loopback(), port});
  asio::signal_set signals(context, SIGINT, SIGTERM);
  signals.async_wait([&](error_code, int) { context.stop(); });
  accept(acceptor, stand_in);
  std::optional<Events> events;
  if (events_port) events.emplace(context, *events_port, stand_in);
  std::cerr << "listening on 127.0.0.1:" << acceptor.local_endpoint().port() << std::endl;
  context.run();
}

}  // namespace
}  // namespace hlm::stand_in

int main(int argc, char** argv) {
  try {
    const auto port_of = [argv](int i) {
      const int port = std::stoi(argv[i]);
      if (port < 0 || port > 65535) throw std::invalid_argument("a port must be 0 to 65535");
      return static_cast<std::uint16_t>(port);
    };
    if (argc < 2 || argc > 3) throw std::invalid_argument("usage: inverse_service PORT [EVENTS]");
    hlm::stand_in::run_as_hardware();
    hlm::stand_in::serve(port_of(1), argc == 3 ? std::optional(port_of(2)) : std::nullopt);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "inverse_service: " << error.what() << '\n';
    return 2;
  }
}
