// The line to a 2DIY's board, which is a pseudo-terminal here.
#include "hlm/devices/diy_board.h"

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <thread>

#include <fcntl.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include "tests/support/catch.h"
#include "tests/system/process.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;
using std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr double kDegree = std::numbers::pi / 180;
constexpr std::uint8_t kBoard = 5;

/// The board's end of a port that has a name of its own.
class Port {
 public:
  explicit Port(const std::string& name)
      : name_(name), board_(posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC)) {
    REQUIRE((board_ >= 0 && grantpt(board_) == 0 && unlockpt(board_) == 0));
    const char* const other_side = ptsname(board_);
    held_ = open(other_side, O_RDWR | O_NOCTTY | O_CLOEXEC);  // Between two of its users, too.
    termios settings{};
    tcgetattr(held_, &settings);
    cfmakeraw(&settings);
    tcsetattr(held_, TCSANOW, &settings);
    std::filesystem::create_symlink(other_side, name_);
  }
  ~Port() {
    std::filesystem::remove(name_);
    close(held_);
    close(board_);
  }
  Port(const Port&) = delete;
  Port& operator=(const Port&) = delete;

  /// A frame that comes within 2 s; empty if none does.
  template <class Frame>
  std::optional<Frame> next() const {
    Frame frame;
    std::size_t size = 0;
    while (size < frame.size()) {
      pollfd input{.fd = board_, .events = POLLIN, .revents = 0};
      if (poll(&input, 1, 2000) <= 0) return std::nullopt;
      const ssize_t count = read(board_, &frame[size], frame.size() - size);
      if (count <= 0) return std::nullopt;
      size += static_cast<std::size_t>(count);
    }
    return frame;
  }
  Vector2 next_torques() const {
    const auto frame = next<DiyTorqueFrame>();
    const auto torques = frame ? decode_torques(kBoard, *frame) : std::nullopt;
    REQUIRE(torques);
    return *torques;
  }
  bool is_silent() const {
    pollfd input{.fd = board_, .events = POLLIN, .revents = 0};
    return poll(&input, 1, 0) == 0;
  }
  void reply(const Vector2& theta) const {
    const DiyAngleFrame frame = encode_angles(kBoard, theta);
    REQUIRE(write(board_, frame.data(), frame.size()) == static_cast<ssize_t>(frame.size()));
  }

 private:
  std::string name_;
  int board_ = -1;
  int held_ = -1;
};

/// A board that was set up and has replied once, with its arms at the offsets.
struct Bench {
  Bench() {
    board.open();
    setup = port->next<DiySetupFrame>();
    exchange(start);
  }

  /// One request without force, and its reply.
  std::optional<HandleState> exchange(const Vector2& theta) {
    board.send(std::nullopt);
    CHECK(port->next_torques().isZero());
    port->reply(theta);
    return board.receive(steady_clock::now() + 2s);
  }

  test::TemporaryDirectory directory;
  std::string name = directory.file("port");
  std::unique_ptr<Port> port = std::make_unique<Port>(name);
  DiyBoard board{{.port = name, .max_torque = 0.1}};
  std::optional<DiySetupFrame> setup;
  Vector2 start = kDegree * Vector2(168, 12);
};

TEST_CASE(
    "A board that is opened again keeps its encoders' count: only the first time sets it up") {
  Bench bench;
  REQUIRE(bench.setup);
  CHECK(*bench.setup == encode(kBoard, DiySetup{}));
  bench.board.close();
  const Vector2 turned = kDegree * Vector2(150, 20);
  std::optional<DiyTorqueFrame> asked;
  std::thread board([&] {
    asked = bench.port->next<DiyTorqueFrame>();
    bench.port->reply(turned);
  });
  bench.board.open();
  board.join();
  REQUIRE(asked);
  CHECK(decode_torques(kBoard, *asked)->isZero());
  CHECK(bench.port->is_silent());
  const auto state = bench.exchange(turned);
  REQUIRE(state);
  const Vector2 expected = Pantograph().handle(turned)->p;
  CHECK((state->X.p.head<2>() - expected).norm() < 1e-7);  // m: angles have single precision.
}

TEST_CASE("A board that was reset is refused until the server starts anew, and told no posture") {
  Bench bench;
  for (int i = 0; i < 2; ++i) {
    bench.board.close();
    CHECK_THROWS_WITH(bench.board.open(), ContainsSubstring("it was reset") &&
                                              ContainsSubstring("start posture") &&
                                              ContainsSubstring("restart the server"));
    CHECK(bench.port->next_torques().isZero());
    CHECK(bench.port->is_silent());
  }
}

TEST_CASE("A halt reaches a board that was plugged in again, though its old port is gone") {
  Bench bench;
  bench.board.halt();
  CHECK(bench.port->next_torques().isZero());
  bench.port.reset();
  bench.port = std::make_unique<Port>(bench.name);
  bench.board.halt();
  CHECK(bench.port->next_torques().isZero());
}

TEST_CASE("A force beyond the motors' torque keeps its direction, and is reported as saturated") {
  Bench bench;
  const Matrix2 J = Pantograph().handle(bench.start)->J;
  const Vector2 torques = J.transpose() * Vector2(3, 1);
  bench.board.send(Vector3(3, 1, 0));
  const Vector2 given = bench.port->next_torques();
  CHECK(std::abs(given.cwiseAbs().maxCoeff() - 0.1) < 1e-8);  // N·m.
  CHECK((given.normalized() - torques.normalized()).norm() < 1e-6);
  bench.port->reply(bench.start);
  CHECK(bench.board.receive(steady_clock::now() + 2s)->saturated);
  CHECK_FALSE(bench.exchange(bench.start)->saturated);
}

/// The kit's firmware cuts each motor off at that by itself, N·m.
constexpr double kFirmwareTorque = 0.123;

TEST_CASE("By default no motor is asked for more than the firmware gives, so force keeps its way") {
  test::TemporaryDirectory directory;
  const Port port(directory.file("port"));
  DiyBoard board{{.port = directory.file("port")}};
  board.open();
  REQUIRE(port.next<DiySetupFrame>());
  board.send(std::nullopt);
  port.next_torques();
  const Vector2 start = kDegree * Vector2(168, 12);
  port.reply(start);
  REQUIRE(board.receive(steady_clock::now() + 2s));
  const Matrix2 J = Pantograph().handle(start)->J;
  for (const Vector3& force : {Vector3(3, 0, 0), Vector3(0, 9, 0), Vector3(-2, 2, 0)}) {
    board.send(force);
    const Vector2 asked = port.next_torques();
    const Vector2 given = asked.cwiseMax(-kFirmwareTorque).cwiseMin(kFirmwareTorque);
    const Vector2 felt = J.transpose().inverse() * given;
    const Vector2 needed = J.transpose() * force.head<2>();
    INFO(asked.transpose() << " N·m of " << needed.transpose());
    CHECK((felt.normalized() - force.head<2>().normalized()).norm() < 1e-5);
    port.reply(start);
    const bool is_too_much = needed.cwiseAbs().maxCoeff() > kFirmwareTorque;
    CHECK(board.receive(steady_clock::now() + 2s)->saturated == is_too_much);
  }
}

}  // namespace
}  // namespace hlm::server
