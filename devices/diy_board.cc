#include "hlm/devices/diy_board.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <stdexcept>
#include <system_error>

#include <fcntl.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

namespace hlm::server {
namespace {

using std::chrono::steady_clock;

/// The kit's rate; a board on USB ignores it.
constexpr speed_t kBaudRate = B57600;

/// Time for the reply that shows that a board still is as it was set up; less refuses a board on a
/// busy machine.
constexpr std::chrono::milliseconds kAwake{250};

constexpr int kOpenAs = O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC;

std::string the_only_port() {
  const std::vector<std::string> ports = serial_ports();
  if (ports.size() == 1) return ports.front();
  std::string text = ports.empty() ? "no serial port is listed in " + std::string(kSerialPorts) +
                                         ": plug the board in, or name its port with the key port"
                                   : "several serial ports; choose one with the key port:";
  for (const std::string& port : ports) text += ' ' + port;
  throw std::runtime_error(text);
}

std::string last_error() { return std::generic_category().message(errno); }

/// Bytes as they are, at the board's rate.
bool make_raw(int descriptor) {
  termios settings{};
  if (tcgetattr(descriptor, &settings) != 0) return false;
  cfmakeraw(&settings);
  settings.c_cflag |= CLOCAL | CREAD;
  return cfsetspeed(&settings, kBaudRate) == 0 && tcsetattr(descriptor, TCSANOW, &settings) == 0 &&
         tcflush(descriptor, TCIOFLUSH) == 0;
}

}  // namespace

std::vector<std::string> serial_ports() {
  std::vector<std::string> ports;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(kSerialPorts, none)) {
    ports.push_back(entry.path());
  }
  std::sort(ports.begin(), ports.end());
  return ports;
}

void DiyBoard::fail(const std::string& what) const {
  throw std::runtime_error("the board at " + port_ + ' ' + what);
}

void DiyBoard::open() {
  if (port_.empty()) port_ = options_.port.empty() ? the_only_port() : options_.port;
  std::error_code none;
  lock_.take("the board at " + std::filesystem::weakly_canonical(port_, none).string());
  descriptor_ = ::open(port_.c_str(), kOpenAs);
  if (descriptor_ < 0) fail("cannot be opened: " + last_error());
  if (!make_raw(descriptor_)) fail("is no serial port: " + last_error());
  received_ = 0;
  J_.setZero();
  theta_at_ = {};
  if (is_set_up_) {
    expect_same_setup();
  } else {
    const DiySetupFrame setup = encode(options_.board, options_.setup);
    write(setup.data(), setup.size());
    is_set_up_ = true;
  }
}

/// A board that was reset replies to nothing, and only a person can say where its arms are.
void DiyBoard::expect_same_setup() {
  send(std::nullopt);
  if (receive(steady_clock::now() + kAwake)) return;
  fail("does not reply, so it was reset: put the arms in the start posture and restart the server");
}

void DiyBoard::close() noexcept {
  const int descriptor = descriptor_.exchange(-1);
  if (descriptor >= 0) ::close(descriptor);
}

void DiyBoard::write(const std::uint8_t* bytes, std::size_t size) const {
  const ssize_t written = ::write(descriptor_, bytes, size);
  if (written < 0) fail("is gone: " + last_error());
  if (written != static_cast<ssize_t>(size)) fail("takes no more bytes");
}

void DiyBoard::send(const std::optional<Vector3>& force) {
  Vector2 torques = J_.transpose() * force.value_or(Vector3::Zero()).head<2>();
  const double largest = torques.cwiseAbs().maxCoeff();
  is_saturated_ = largest > options_.max_torque;
  if (is_saturated_) torques *= options_.max_torque / largest;
  const DiyTorqueFrame frame = encode_torques(options_.board, torques);
  write(frame.data(), frame.size());
}

void DiyBoard::expect_silence() {
  if (!waits_for_input(steady_clock::now())) return;
  fail("broke its rule of one reply for each request: it sent what it was not asked for");
}

bool DiyBoard::waits_for_input(SteadyTime deadline) const {
  const auto left = std::max(std::chrono::nanoseconds(0),
                             std::chrono::nanoseconds(deadline - steady_clock::now()));
  const timespec timeout{.tv_sec = left.count() / 1'000'000'000,
                         .tv_nsec = left.count() % 1'000'000'000};
  pollfd input{.fd = descriptor_, .events = POLLIN, .revents = 0};
  return ppoll(&input, 1, &timeout, nullptr) > 0;
}

std::optional<HandleState> DiyBoard::receive(SteadyTime deadline) {
  while (received_ < frame_.size()) {
    if (!waits_for_input(deadline)) return std::nullopt;
    const ssize_t count = ::read(descriptor_, &frame_[received_], frame_.size() - received_);
    if (count == 0) fail("is gone");
    if (count < 0 && errno != EAGAIN) fail("is gone: " + last_error());
    if (count > 0) received_ += static_cast<std::size_t>(count);
  }
  received_ = 0;
  if (frame_[0] != options_.board) {
    fail("sent the frame of board " + std::to_string(frame_[0]) + ", must be " +
         std::to_string(options_.board));
  }
  const auto theta = decode_angles(options_.board, frame_);
  if (!theta) fail("sent an angle that is not finite");
  return state_at(*theta);
}

HandleState DiyBoard::state_at(const Vector2& theta) {
  const auto handle = options_.pantograph.handle(theta);
  if (!handle) {
    constexpr double kDegree = std::numbers::pi / 180;
    fail("has its arms at " + std::to_string(theta[0] / kDegree) + " and " +
         std::to_string(theta[1] / kDegree) +
         " degrees, where the handle is not held: start with the arms as the offsets say");
  }
  const SteadyTime now = steady_clock::now();
  if (theta_at_ == SteadyTime{}) {
    rate_.setZero();
  } else {
    const double dt = std::chrono::duration<double>(now - theta_at_).count();
    const double gain = -std::expm1(-2 * std::numbers::pi * options_.velocity_cutoff * dt);
    rate_ += gain * ((theta - theta_) / dt - rate_);
  }
  theta_ = theta;
  theta_at_ = now;
  J_ = handle->J;
  HandleState state;
  state.X.p.head<2>() = handle->p;
  state.V.head<2>() = J_ * rate_;
  state.saturated = is_saturated_;
  return state;
}

void DiyBoard::halt() noexcept {
  const DiyTorqueFrame frame = encode_torques(options_.board, Vector2::Zero());
  if (::write(descriptor_, frame.data(), frame.size()) > 0) return;
  const int port = ::open(port_.c_str(), kOpenAs);
  if (port < 0) return;
  [[maybe_unused]] const ssize_t written = ::write(port, frame.data(), frame.size());
  ::close(port);
}

}  // namespace hlm::server
