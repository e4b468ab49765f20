// Boost 1.74's Beast needs <utility> before it in C++20.
#include "hlm/devices/inverse_service.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <spdlog/spdlog.h>
#include <sys/socket.h>

#include "hlm/common/one_line.h"

namespace hlm::server {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;
using asio::ip::tcp;
using boost::system::error_code;
using std::chrono::steady_clock;

/// Time for the connection, its handshake and the inventory, each.
constexpr std::chrono::seconds kOpening{2};

/// Inventories that are asked for where device or grip is missing: each takes some milliseconds.
constexpr int kInventories = 20;

/// Time for a request to go out: the service's end of the connection is full of earlier ones.
constexpr std::chrono::milliseconds kSending{10};

/// Largest message, bytes; a state has under 2 kB for each device.
constexpr std::size_t kMaxMessage = 256 * 1024;

/// Cut-off of the angular velocity, which is the grip's change of orientation, Hz.
constexpr double kCutOff = 30;

constexpr const char* kNoGrip = "none";

/// Time for the answer about a setting.
constexpr std::chrono::milliseconds kSettingTime{300};

/// A service that takes a force says so: for so long it may say none, s and N.
constexpr std::chrono::milliseconds kUntaken{50};
constexpr double kFeltForce = 0.1;
/// Between two looks for events.
constexpr std::chrono::milliseconds kEventPeriod{5};

constexpr const char* kSource =
    "the Inverse Service comes with the device's software, https://docs.haply.co";

[[noreturn]] void give_up(const std::string& what) { throw std::runtime_error(what); }

/// A text frame of a client (RFC 6455, 5.2), its mask zero.
std::string text_frame(const std::string& text) {
  std::string frame("\x81", 1);
  constexpr std::size_t kShort = 125;
  const auto byte = [&](std::size_t value) { frame += static_cast<char>(value & 0xff); };
  if (text.size() <= kShort) {
    byte(0x80 | text.size());
  } else {
    byte(0x80 | 126);
    byte(text.size() >> 8);
    byte(text.size());
  }
  return frame + std::string(4, '\0') + text;
}

/// What a server answers, if it does so in time and with success.
std::optional<std::string> http_get(const std::string& host, const std::string& port,
                                    const std::string& target) {
  namespace http = beast::http;
  asio::io_context context(1);
  beast::tcp_stream stream(context);
  tcp::resolver resolver(context);
  error_code error;
  const auto places = resolver.resolve(host, port, error);
  if (error) return std::nullopt;
  http::request<http::empty_body> request{http::verb::get, target, 11};
  request.set(http::field::host, host + ':' + port);
  http::response<http::string_body> response;
  beast::flat_buffer buffer;
  bool done = false;
  stream.expires_after(kSettingTime);
  stream.async_connect(places, [&](error_code failed, const tcp::endpoint&) {
    if (failed) return;
    http::async_write(stream, request, [&](error_code unsent, std::size_t) {
      if (unsent) return;
      http::async_read(stream, buffer, response,
                       [&](error_code unread, std::size_t) { done = !unread; });
    });
  });
  context.run();
  if (!done || response.result() != http::status::ok) return std::nullopt;
  return response.body();
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "none" : text;
}

/// The one of that id or, if the id is empty, the only one; empty if it is to be chosen of none.
std::string chosen(const char* what, const char* key, const std::string& id,
                   const std::vector<std::string>& all) {
  if (id.empty() && all.size() > 1) {
    give_up("several " + std::string(what) + "s: " + listed(all) + "; choose one with the key " +
            key);
  }
  if (id.empty()) return all.empty() ? "" : all.front();
  if (std::find(all.begin(), all.end(), id) != all.end()) return id;
  give_up("no " + std::string(what) + " '" + id + "'; there are: " + listed(all));
}

}  // namespace

/// A WebSocket of one thread. Reads ahead one message.
class InverseService::Connection {
 public:
  explicit Connection(const std::string& address) : address_(address) {
    const std::size_t colon = address.rfind(':');
    const std::string host = address.substr(0, colon);
    error_code error;
    tcp::resolver resolver(context_);
    const auto places = resolver.resolve(host, address.substr(colon + 1), error);
    if (!error) {
      tcp_stream().expires_after(kOpening);
      tcp_stream().async_connect(places, [&](error_code e, const tcp::endpoint&) { error = e; });
      context_.run();
    }
    if (error) refuse(error);
    tcp_stream().expires_never();
    tcp_stream().socket().set_option(tcp::no_delay(true));
    // It must not end by itself: no timeout after the handshake, no pings.
    socket_.set_option(
        websocket::stream_base::timeout{kOpening, websocket::stream_base::none(), false});
    socket_.read_message_max(kMaxMessage);
    socket_.auto_fragment(false);
    socket_.async_handshake(address, "/", [&](error_code e) { error = e; });
    context_.restart();
    context_.run();
    if (error) refuse(error);
    context_.restart();
    work_.emplace(context_.get_executor());
    read();
  }

  ~Connection() { shut_down(); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  /// Where the service is, whatever its host is called.
  std::string place() {
    const tcp::endpoint place = tcp_stream().socket().remote_endpoint();
    return place.address().to_string() + ':' + std::to_string(place.port());
  }

  int socket() { return tcp_stream().socket().native_handle(); }

  /// The first message; a service whose devices come later is asked again.
  HaplyInventory inventory() {
    const SteadyTime end = steady_clock::now() + kOpening;
    HaplyInventory latest;
    for (int i = 0; i < kInventories; ++i) {
      const auto message = receive(end);
      if (!message) give_up("the Inverse Service at " + address_ + " sent no inventory within 2 s");
      latest = parse_haply_inventory(*message);
      const bool is_whole = !latest.devices.empty() && !latest.grips.empty();
      if (is_whole || !latest.has_session || i + 1 == kInventories) break;
      send(haply_inventory_request());
    }
    return latest;
  }

  /// A message that has come; empty if none does by `deadline`.
  std::optional<std::string> receive(SteadyTime deadline) {
    while (!has_message_ && context_.run_one_until(deadline) > 0) check();
    check();
    if (!has_message_) return std::nullopt;
    std::string message = beast::buffers_to_string(buffer_.data());
    buffer_.consume(buffer_.size());
    read();
    return message;
  }

  /// A message that has come already.
  std::optional<std::string> receive_now() {
    context_.poll();
    check();
    return has_message_ ? receive(steady_clock::now()) : std::nullopt;
  }

  void send(const std::string& request) {
    bool sent = false;
    socket_.async_write(asio::buffer(request), [&](error_code error, std::size_t) {
      sent = true;
      if (error) error_ = error;
    });
    const SteadyTime deadline = steady_clock::now() + kSending;
    while (!sent && context_.run_one_until(deadline) > 0) {
    }
    if (!sent) abandon();
    check();
  }

  void expect_silence() {
    context_.poll();
    check();
    if (!has_message_) return;
    give_up(
        "the Inverse Service broke its rule of one reply for each request: a message came that "
        "was not asked for");
  }

 private:
  beast::tcp_stream& tcp_stream() { return beast::get_lowest_layer(socket_); }

  /// Ends the connection also where another process has inherited its socket.
  void shut_down() {
    error_code ignored;
    tcp_stream().socket().shutdown(tcp::socket::shutdown_both, ignored);
  }

  [[noreturn]] void refuse(const error_code& error) const {
    give_up("no Inverse Service answers at " + address_ + " (" + error.message() + "); " + kSource);
  }

  void read() {
    has_message_ = false;
    socket_.async_read(buffer_, [this](error_code error, std::size_t) {
      has_message_ = !error;
      if (error) error_ = error;
    });
  }

  void check() const {
    if (error_) give_up("the connection to the Inverse Service ended: " + error_.message());
  }

  /// The pending write refers to the caller: it has to end first.
  [[noreturn]] void abandon() {
    shut_down();
    tcp_stream().close();
    work_.reset();
    context_.run_for(kOpening);
    give_up("the Inverse Service takes no requests");
  }

  std::string address_;
  asio::io_context context_{1};
  /// Keeps the context from stopping between two operations.
  std::optional<asio::executor_work_guard<asio::io_context::executor_type>> work_;
  websocket::stream<beast::tcp_stream> socket_{context_};
  beast::flat_buffer buffer_;
  bool has_message_ = false;
  error_code error_;
};

std::string host_and_port(const std::string& address) {
  const std::string scheme = "ws://";
  const std::size_t begin = address.starts_with(scheme) ? scheme.size() : 0;
  return address.substr(begin, address.find('/', begin) - begin);
}

HaplyChoice choose(const HaplyInventory& inventory, const InverseServiceOptions& options) {
  std::vector<std::string> ids;
  for (const HaplyDevice& device : inventory.devices) ids.push_back(device.id);
  HaplyChoice choice;
  choice.device = chosen("Inverse3", "id", options.device, ids);
  if (choice.device.empty()) {
    give_up("the Inverse Service at " + options.address +
            " has no Inverse3: plug it in, and switch it on");
  }
  for (const HaplyDevice& device : inventory.devices) {
    if (device.id == choice.device) choice.device_kind = device.kind;
    if (device.id != choice.device || options.handedness == "any") continue;
    if (device.handedness != options.handedness) {
      give_up("handedness of Inverse3 " + device.id + " is '" + device.handedness + "', must be '" +
              options.handedness + "' as the key handedness says");
    }
  }
  if (options.grip == kNoGrip) return choice;
  std::vector<std::string> grips;
  for (const HaplyGrip& grip : inventory.grips) grips.push_back(grip.id);
  choice.grip = chosen("grip", "grip", options.grip, grips);
  for (const HaplyGrip& grip : inventory.grips) {
    if (grip.id == choice.grip) choice.grip_kind = grip.kind;
  }
  return choice;
}

InverseServiceOptions choosing(const HaplyChoice& choice, InverseServiceOptions options) {
  options.device = choice.device;
  options.grip = choice.grip.empty() ? kNoGrip : choice.grip;
  return options;
}

InverseService::InverseService(InverseServiceOptions options) : options_(std::move(options)) {
  options_.address = host_and_port(options_.address);
}

InverseService::~InverseService() = default;

HaplyInventory InverseService::ask_inventory(const std::string& address) {
  return Connection(host_and_port(address)).inventory();
}

void InverseService::open() {
  connection_ = std::make_unique<Connection>(options_.address);
  const HaplyInventory inventory = connection_->inventory();
  choice_ = choose(inventory, options_);
  lock_.take("Inverse3 " + choice_.device + " at " + connection_->place());
  may_switch_ = options_.force_field == "auto";
  force_field_ = may_switch_ ? (inventory.has_session ? "vector" : "values") : options_.force_field;
  no_force_.clear();
  for (const char* field : {"vector", "values"}) {
    if (!may_switch_ && force_field_ != field) continue;
    no_force_ += text_frame(haply_force_request(choice_, field, Vector3::Zero()));
  }
  untaken_since_ = latest_at_ = {};
  brake_ = nullptr;
  names_itself_ = inventory.has_session;
  said_ = parse_haply_state(inventory.text, choice_);
  const std::string host = options_.address.substr(0, options_.address.rfind(':'));
  say_scales(host);
  try {
    if (options_.events != 0) {
      events_ = std::make_unique<Connection>(host + ':' + std::to_string(options_.events));
    }
  } catch (const std::runtime_error&) {
    // Services before 3.5 have none.
  }
  socket_ = connection_->socket();
}

void InverseService::close() noexcept {
  socket_ = -1;
  connection_.reset();
  events_.reset();
}

void InverseService::send(const std::optional<Vector3>& force) {
  if (!connection_) give_up("there is no connection to the Inverse Service");
  sent_ = force.value_or(Vector3::Zero());
  const std::string request =
      force ? haply_force_request(choice_, force_field_, *force) : haply_probe_request(choice_);
  connection_->send(std::exchange(names_itself_, false) ? with_haply_profile(request) : request);
}

/// Scales that the service's own settings set: a wall is then another one, and nobody would know.
void InverseService::say_scales(const std::string& host) const {
  const double scale = said_.mount_scale * said_.session_scale;
  if (scale != 1) {
    spdlog::warn(
        "the Inverse Service scales positions by {:.4g} (mount {:.4g}, transform {:.4g}): they are "
        "divided by that; whether it scales forces, too, it does not say. Set both to 1",
        scale, said_.mount_scale, said_.session_scale);
  }
  if (!options_.settings) return;
  for (const std::string& port :
       {options_.address.substr(options_.address.rfind(':') + 1), std::string("10000")}) {
    const auto answer = http_get(host, port, "/settings/devices/force_scale");
    const auto value = answer ? parse_haply_setting(*answer) : std::nullopt;
    if (!value) continue;
    if (*value != 1) {
      spdlog::warn(
          "the Inverse Service gives {:.4g} times each force (its setting devices/force_scale): "
          "walls are as many times as stiff as they should be",
          *value);
    }
    return;
  }
}

/// A service that does not know a force's name takes none, and says nothing of it.
void InverseService::observe_force(const std::optional<Vector3>& taken) {
  const SteadyTime now = steady_clock::now();
  if (!taken || !taken->isZero() || sent_.norm() < kFeltForce) {
    untaken_since_ = now;
    if (taken && !taken->isZero()) may_switch_ = false;
    return;
  }
  if (untaken_since_ == SteadyTime{}) untaken_since_ = now;
  if (now - untaken_since_ < kUntaken) return;
  if (!std::exchange(may_switch_, false)) {
    give_up("the Inverse Service takes no force: its current_cursor_force stays 0 N where " +
            std::to_string(sent_.norm()) + " N were asked for as '" + force_field_ +
            "'; the key force-field may be auto, vector or values");
  }
  force_field_ = force_field_ == "vector" ? "values" : "vector";
  untaken_since_ = now;
  spdlog::warn("the Inverse Service takes no force as asked: it is now called '{}'", force_field_);
}

/// Events are a help; without them the session goes on.
void InverseService::observe_events() noexcept {
  const SteadyTime now = steady_clock::now();
  if (!events_ || now - events_at_ < kEventPeriod) return;
  events_at_ = now;
  try {
    while (const auto message = events_->receive_now()) observe(parse_haply_event(*message));
  } catch (const std::exception& error) {
    spdlog::warn("no more events of the Inverse Service: {}", error.what());
    events_.reset();
  }
}

void InverseService::observe(const HaplyEvent& event) {
  if (!event.device.empty() && event.device != choice_.device) return;
  const std::string& what = event.what();
  if (what == "ebrake_triggered") brake_ = "its emergency brake is on";
  if (what == "ebrake_released") brake_ = nullptr;
  const bool is_news = event.level == "warning" || event.level == "error" ||
                       event.name == "device-safety-triggered" || event.name == "device-busy" ||
                       event.name == "device-calibration-failed" || what == "stability_ceiling" ||
                       what == "fod_stage_changed";
  if (!is_news) return;
  spdlog::warn("Inverse3 {}: {}{}{}: {}", choice_.device, event.name,
               event.safety.empty() ? "" : ", ", event.safety, one_line(event.text));
}

void InverseService::expect_silence() { connection_->expect_silence(); }

std::optional<HandleState> InverseService::receive(SteadyTime deadline) {
  const auto message = connection_->receive(deadline);
  if (!message) return std::nullopt;
  said_ = parse_haply_state(*message, choice_, said_);
  HandleState state = said_.handle;
  observe_events();
  if (brake_ != nullptr) state.force_off = brake_;
  if (state.force_off == nullptr) observe_force(said_.force);
  const SteadyTime now = steady_clock::now();
  if (latest_at_ != SteadyTime{}) {
    const double dt = std::chrono::duration<double>(now - latest_at_).count();
    const Vector3 rate = rotation_vector(state.X.R * latest_.X.R.conjugate()) / dt;
    const double gain = -std::expm1(-2 * std::numbers::pi * kCutOff * dt);
    state.V.tail<3>() = latest_.V.tail<3>() + gain * (rate - latest_.V.tail<3>());
  }
  latest_ = state;
  latest_at_ = now;
  return state;
}

void InverseService::halt() noexcept {
  const int socket = socket_;
  if (socket < 0) return;
  [[maybe_unused]] const ssize_t sent =
      ::send(socket, no_force_.data(), no_force_.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
}

const char* InverseService::warning_after_reopening() const noexcept {
  return "haptic_guard does not reach its new connection: if the server is killed, the last force "
         "may stay. Restart the server to have it guarded again";
}

}  // namespace hlm::server
