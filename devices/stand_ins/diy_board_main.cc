// Stands in for the Haply 2DIY's board: `diy_board FILE`, until SIGINT or SIGTERM. FILE becomes a
// link to a pseudo-terminal, which is its serial port.
//
// The handle lies where the kit's offsets put it when the board is set up. Its motors are on from
// then on, and hold torques between requests, as nothing known says otherwise. The kit has no
// buttons: the order `press 0` is that the hand takes the handle. Faults of StandInFault at this
// boundary:
//   error       replies are those of another board
//   not_finite  angles are not numbers
//   broken      two replies to each request
//   unplug      the port is gone; plugged in again, the board was reset: it replies to nothing
//   until
//               it is set up
//   late        replies come 30 ms late
// Those of the handle are the core's.
#include <cerrno>
#include <cmath>
#include <csignal>
#include <deque>
#include <filesystem>
#include <iostream>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include "hlm/devices/diy_frames.h"
#include "hlm/devices/stand_ins/stand_in.h"

namespace hlm::stand_in {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using server::Matrix2;
using server::Vector2;

constexpr auto kLateness = 30ms;
constexpr auto kLook = 1ms;  ///< Longest between two looks at orders and signals.
constexpr std::uint8_t kBoard = 5;
constexpr double kMaxTorque = 0.123;  // N·m.
constexpr double kDegree = std::numbers::pi / 180;

volatile std::sig_atomic_t stopped = 0;

/// A pseudo-terminal that passes bytes as they are, under a name of one's own.
class Port {
 public:
  explicit Port(std::string name) : name_(std::move(name)) {}
  ~Port() { unplug(); }
  Port(const Port&) = delete;
  Port& operator=(const Port&) = delete;

  bool is_plugged() const { return board_ >= 0; }

  void plug() {
    board_ = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (board_ < 0 || grantpt(board_) != 0 || unlockpt(board_) != 0) fail("no pseudo-terminal");
    const char* const other_side = ptsname(board_);
    // Held open, it does not hang up between two of its users.
    held_ = open(other_side, O_RDWR | O_NOCTTY | O_CLOEXEC);
    termios settings{};
    if (held_ < 0 || tcgetattr(held_, &settings) != 0) fail(other_side);
    cfmakeraw(&settings);
    tcsetattr(held_, TCSANOW, &settings);
    std::filesystem::remove(name_);
    std::filesystem::create_symlink(other_side, name_);
  }

  void unplug() {
    if (!is_plugged()) return;
    std::filesystem::remove(name_);
    close(held_);
    close(std::exchange(board_, -1));
  }

  /// A byte that has come within kLook, at most; -1 if none has.
  int next_byte() const {
    pollfd input{.fd = board_, .events = POLLIN, .revents = 0};
    if (poll(&input, 1, static_cast<int>(kLook / 1ms)) <= 0) return -1;
    std::uint8_t byte = 0;
    return read(board_, &byte, 1) == 1 ? byte : -1;
  }

  template <class Frame>
  void write(const Frame& frame) const {
    [[maybe_unused]] const ssize_t written = ::write(board_, frame.data(), frame.size());
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(what + ": " + std::generic_category().message(errno));
  }

  std::string name_;
  int board_ = -1;
  int held_ = -1;
};

class Board {
 public:
  explicit Board(const std::string& port)
      : stand_in_({.mass = 0.2, .damping = 10, .dry_friction = 0}), port_(port) {}

  void run() {
    while (stopped == 0) {
      if (stand_in_.has(StandInFault::kUnplug)) {
        port_.unplug();
        setup_.reset();
        std::this_thread::sleep_for(kLook);
        continue;
      }
      if (!port_.is_plugged()) port_.plug();
      if (const int byte = port_.next_byte(); byte >= 0) take(static_cast<std::uint8_t>(byte));
      if (!stand_in_.enabled() && setup_ && (stand_in_.state().buttons & 1) != 0) {
        stand_in_.enable();
      }
      reply();
    }
  }

 private:
  /// The first byte of a frame says how long it is; others are skipped until there is one.
  void take(std::uint8_t byte) {
    frame_.push_back(byte);
    if (frame_[0] == server::kDiySetup) {
      if (auto frame = whole<server::DiySetupFrame>()) set_up(*frame);
    } else if (frame_[0] == server::kDiyTorques) {
      if (auto frame = whole<server::DiyTorqueFrame>())
        obey(server::decode_torques(kBoard, *frame));
    } else {
      frame_.clear();
    }
  }

  void set_up(const server::DiySetupFrame& frame) {
    setup_ = server::decode_setup(kBoard, frame);
    if (!setup_) return;
    start_ = stand_in_.state().X_WD.p.head<2>();
    theta_ = kDegree * Vector2(setup_->offset[0], setup_->offset[1]);
    replies_.clear();
  }

  template <class Frame>
  std::optional<Frame> whole() {
    Frame frame;
    if (frame_.size() < frame.size()) return std::nullopt;
    std::copy(frame_.begin(), frame_.end(), frame.begin());
    frame_.clear();
    return frame;
  }

  /// Each motor is cut off by itself, as the kit's firmware does it.
  void obey(const std::optional<Vector2>& asked) {
    if (!asked || !setup_) return;
    const Vector2 torques = asked->cwiseMax(-kMaxTorque).cwiseMin(kMaxTorque);
    const Matrix2 J = arms_.handle(theta())->J;
    Wrench F = Wrench::Zero();
    F.head<2>() = J.transpose().inverse() * torques;
    stand_in_.command(F);
    const bool is_late = stand_in_.has(StandInFault::kLate);
    replies_.push_back(Clock::now() + (is_late ? Clock::duration(kLateness) : Clock::duration(0)));
    if (stand_in_.has(StandInFault::kBroken)) replies_.push_back(replies_.back());
  }

  /// Sends the replies whose time has come.
  void reply() {
    while (!replies_.empty() && replies_.front() <= Clock::now()) {
      replies_.pop_front();
      Vector2 counted;
      for (int i = 0; i < 2; ++i) {
        const double step = 2 * std::numbers::pi / setup_->resolution;
        const double offset = kDegree * setup_->offset[static_cast<std::size_t>(i)];
        counted[i] = offset + step * std::round((theta()[i] - offset) / step);
      }
      if (stand_in_.has(StandInFault::kNotFinite)) {
        counted.setConstant(std::numeric_limits<double>::quiet_NaN());
      }
      const bool is_other = stand_in_.has(StandInFault::kError);
      port_.write(server::encode_angles(is_other ? kBoard + 1 : kBoard, counted));
    }
  }

  /// Angles of the arms; out of their reach they stay where they were last.
  Vector2 theta() {
    const Vector2 offset = kDegree * Vector2(setup_->offset[0], setup_->offset[1]);
    const Vector2 p = arms_.handle(offset)->p + stand_in_.state().X_WD.p.head<2>() - start_;
    if (const auto angles = arms_.angles(p); angles && arms_.handle(*angles)) theta_ = *angles;
    return theta_;
  }

  StandIn stand_in_;
  Port port_;
  server::Pantograph arms_;
  std::optional<server::DiySetup> setup_;
  std::vector<std::uint8_t> frame_;        ///< The beginning of one.
  std::deque<Clock::time_point> replies_;  ///< When the replies must go out.
  Vector2 start_ = Vector2::Zero();        ///< Start of the handle when it was set up, m.
  Vector2 theta_ = Vector2::Zero();        ///< Angles as last reported.
};

}  // namespace
}  // namespace hlm::stand_in

int main(int argc, char** argv) {
  try {
    hlm::stand_in::run_as_hardware();
    if (argc != 2) throw std::invalid_argument("usage: diy_board FILE");
    for (const int signal : {SIGINT, SIGTERM}) {
      std::signal(signal, [](int) { hlm::stand_in::stopped = 1; });
    }
    hlm::stand_in::Board(argv[1]).run();
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "diy_board: " << error.what() << '\n';
    return 2;
  }
}
