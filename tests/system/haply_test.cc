// Haply's devices in the real programs, against stand-ins for the Inverse Service and the 2DIY's
// board.
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include <unistd.h>

#include "tests/support/catch.h"
#include "tests/system/stand_in_session.h"

namespace hlm::test {
namespace {

using namespace std::chrono_literals;
using Catch::Matchers::ContainsSubstring;

/// A device that works again is found within that.
constexpr auto kReopening = 800ms;

const std::string kSteady = "{ force = [0, 1, 0] }";
constexpr double kPush = 1;  // N.

/// A server on an Inverse Service.
struct InverseSession : StandInSession {
  explicit InverseSession(const std::string& wrench, const Arguments& options = {})
      : StandInSession(wrench), port(free_port()), events(free_port()) {
    start_service();
    serve(Arguments{"--without-time-guard", "--device", "haply", "--device-option",
                    "address=ws://" + loopback(port), "--device-option",
                    "events=" + std::to_string(events), "--stiffness", "1000"} +
          options);
  }

  void start_service() {
    service.reset();
    service.emplace(Arguments{HLM_INVERSE_SERVICE, std::to_string(port), std::to_string(events)});
    REQUIRE(service->wait_for_error("listening", 5));
  }

  int port;
  int events;
  std::optional<Process> service;
};

/// A server on a 2DIY, whose hand pushes with 0.5 N in the testbed's hole, at its floor.
struct DiySession : StandInSession {
  DiySession() : StandInSession("{ force = [0, 0.5, 0] }") {
    board.emplace(Arguments{HLM_DIY_BOARD, file("port")});
    REQUIRE(wait_until(5, [&] { return access(file("port").c_str(), F_OK) == 0; }));
    // Its bytes pass through a thread of the kernel's, which a busy machine keeps waiting.
    serve({"--without-time-guard", "--device", "haply2diy", "--device-option",
           "port=" + file("port"), "--device-option", "oldest=0.5", "--stiffness", "500",
           "--coupling-stiffness", "200", "--coupling-damping", "5"});
  }

  void press() {
    arm({"--start", "hole"});
    const bool rises = server().wait_for_error("force is on", 10);
    INFO(server().error());
    REQUIRE(rises);
    order("press 0");
    StandInSession::press(-0.5, 0.5);  // The encoders' steps let it tremble.
  }

  std::optional<Process> board;
};

/// The motors are off in time, the log says why, and nothing brings the force back by itself.
void check_fault(StandInSession& session, const std::string& order, const std::string& cause) {
  session.order(order);
  const double time = session.time_until_off();
  WARN(order << ": no force after " << 1e3 * time << " ms");
  CHECK(time < kMostUntilOff + kStall);
  const bool named = session.server().wait_for_error(cause, 5);
  INFO(session.server().error());
  CHECK(named);
  std::this_thread::sleep_for(100ms);
  CHECK(session.motor() == 0);
}

/// Words on the stand-in's side, for as long as this lives.
struct StandInState {
  explicit StandInState(const char* words) { setenv("HAPTIC_STAND_IN_STATE", words, 1); }
  ~StandInState() { unsetenv("HAPTIC_STAND_IN_STATE"); }
};

TEST_CASE("An Inverse Service that knows a force as values only gives it, and a wired grip works") {
  const StandInState state("values wired");
  // Told the wrong name, it takes none: that is a fault, not a force of 0 N.
  const std::string field = GENERATE("auto", "vector");
  InverseSession session(
      kSteady, {"--device-option", "force-field=" + field, "--device-option", "oldest=0.5"});
  session.arm();
  if (field == "auto") return session.press(-kPush);
  CHECK(session.server().wait_for_error("takes no force", 10));
  CHECK(session.server().wait_for_error("fault", 5));
  CHECK(session.motor() == 0);
}

TEST_CASE("An Inverse3 without power, or with its emergency brake on, gives no force and says so") {
  {
    const StandInState state("no_power");
    InverseSession session(kSteady, {"--device-option", "oldest=0.5"});
    session.arm();
    CHECK(session.server().wait_for_error("its power supply is off", 10));
  }
  InverseSession session(kSteady, {"--device-option", "oldest=0.5"});
  session.arm();
  session.press(-kPush);
  session.order("force_off");
  CHECK(session.server().wait_for_error("its emergency brake is on", 5));
  CHECK(session.motor() == 0);
  session.order("good");
  CHECK(session.server().wait_for_error("ebrake_released", 5));
  session.press(-kPush);
}

TEST_CASE("A hand that presses a wall through an Inverse3 feels it within 2 %, also at 200 Hz") {
  // A reply that a busy machine keeps waiting is not what this is about.
  InverseSession session(kSteady, {"--device-option", "oldest=0.5"});
  session.arm();
  session.press(-kPush);
  std::this_thread::sleep_for(500ms);
  CHECK(session.motor() == Approx(-kPush).epsilon(0.02));  // N.
  session.order("slow");
  std::this_thread::sleep_for(1500ms);
  CHECK(session.motor() == Approx(-kPush).epsilon(0.02));
}

TEST_CASE(
    "An Inverse3 that fails gives no force within 20 ms, says why, and comes back when armed") {
  struct SeededFault {
    const char* order;
    const char* cause;
  };
  for (const SeededFault& fault : {
           SeededFault{"error", "reports an error: \"the device does not answer\""},
           SeededFault{"not_finite", "cursor_position.x null, must be a number"},
           SeededFault{"broken", "a message came that was not asked for"},
           SeededFault{"late", "no reply for 15"},
           SeededFault{"unplug", "has inverse3 'STANDIN' no more"},
       }) {
    InverseSession session(kSteady);  // Without a client the hand pushes its handle ever farther.
    session.arm();
    session.press(-kPush);
    check_fault(session, fault.order, fault.cause);
    session.order("good");
    std::this_thread::sleep_for(kReopening);
    CHECK(session.motor() == 0);
    session.arm();
    session.press(-kPush);
  }
}

TEST_CASE("An Inverse3 whose pose jumps by 50 mm gives no force within 20 ms") {
  InverseSession session(kSteady);
  session.arm();
  session.press(-kPush);
  check_fault(session, "jump", "its pose jumps farther than a hand can move it");
}

/// A second server on what the first one has, for as long as that lives.
void check_second_server(StandInSession& session, const Arguments& options,
                         const std::string& refusal) {
  const Arguments second =
      Arguments{HLM_SERVER,          "--listen", loopback(free_port()), "--status", "false",
                "--keep-recordings", "0",        "--without-time-guard"} +
      options;
  const Finished refused = run(second);
  CHECK(refused.exit_code == 1);
  CHECK_THAT(refused.error, ContainsSubstring(refusal));
  CHECK(session.server().running());
  session.server().send_signal(SIGKILL);  // Its guard outlives it for an instant.
  Process next(second);
  const bool listens = next.wait_for_error("listening", 10);
  INFO(next.error());
  CHECK(listens);
}

TEST_CASE("A second server on an Inverse3 is refused by its name, and served when the first ends") {
  InverseSession session(kSteady);
  const std::string place = loopback(session.port);
  check_second_server(
      session,
      {"--device", "haply", "--device-option", "address=localhost:" + std::to_string(session.port)},
      "another haptic_server or haptic_doctor has Inverse3 STANDIN at " + place);
}

TEST_CASE(
    "A second server on the port of a 2DIY is refused by its name, whatever link leads there") {
  DiySession session;
  const std::string port = std::filesystem::canonical(session.file("port"));
  check_second_server(session, {"--device", "haply2diy", "--device-option", "port=" + port},
                      "another haptic_server or haptic_doctor has the board at " + port);
}

TEST_CASE("A 2DIY that freezes at over 0.2 m/s is a fault that says so") {
  DiySession session;
  session.press();
  session.order("hold 0 -0.02 0");  // Off the floor, and back.
  std::this_thread::sleep_for(500ms);
  session.order("hold 0 0.05 0");
  std::this_thread::sleep_for(30ms);
  session.order("freeze");
  const bool named = session.server().wait_for_error("its state is frozen: its pose stands", 5);
  INFO(session.server().error());
  CHECK(named);
  CHECK(session.motor() == 0);
}

TEST_CASE("An Inverse3 that freezes while it moves gives no force within 20 ms") {
  InverseSession session("{ force = [0, 2, 0], force_amplitude = [0, 1, 0], frequency = 3 }");
  session.arm();
  REQUIRE(session.server().wait_for_error("force is on", 10));
  std::this_thread::sleep_for(1s);
  // Where the force is that of the middle, the handle is fastest.
  REQUIRE(wait_until(5, [&] { return std::abs(session.motor() + 2) < 0.2; }));
  check_fault(session, "freeze", "its state is frozen");
}

TEST_CASE(
    "An Inverse3 armed while it is unplugged is refused by its cause, and works when replugged") {
  InverseSession session(kSteady);
  session.arm();
  session.press(-kPush);
  check_fault(session, "unplug", "has inverse3 'STANDIN' no more");
  session.arm();
  std::this_thread::sleep_for(1s);
  CHECK(session.motor() == 0);
  session.order("replug");
  CHECK(session.server().wait_for_error("Haply Inverse3 STANDIN is back", 5));
  CHECK(session.motor() == 0);
  session.arm();
  session.press(-kPush);
}

TEST_CASE("An Inverse Service that dies is a fault, and started again it serves who arms") {
  InverseSession session(kSteady);
  session.arm();
  session.press(-kPush);
  session.service->send_signal(SIGKILL);
  CHECK(session.server().wait_for_error("the connection to the Inverse Service ended", 5));
  std::this_thread::sleep_for(1s);  // It is looked for meanwhile.
  CHECK(session.server().running());
  session.start_service();
  CHECK(session.server().wait_for_error("Haply Inverse3 STANDIN is back", 5));
  CHECK(session.server().wait_for_error("haptic_guard does not reach its new connection", 5));
  session.arm();
  session.press(-kPush);
}

TEST_CASE("A server that is killed leaves no force on an Inverse3") {
  const int signal = GENERATE(SIGKILL, SIGSEGV);
  INFO("signal " << signal);
  InverseSession session(kSteady);
  session.arm();
  session.press(-kPush);
  session.server().send_signal(signal);
  const double time = session.time_until_off();
  WARN("signal " << signal << ": no force after " << 1e3 * time << " ms");
  CHECK(time < 0.1);  // As crash_test.cc has it.
  std::this_thread::sleep_for(100ms);
  CHECK(session.motor() == 0);
}

TEST_CASE("A hand that presses a floor through a 2DIY feels it within 2 %") {
  DiySession session;
  session.press();
  double sum = 0;
  constexpr int kSamples = 500;
  for (int i = 0; i < kSamples; ++i) {
    sum += session.motor();
    std::this_thread::sleep_for(1ms);
  }
  CHECK(sum / kSamples == Approx(-0.5).epsilon(0.02));  // N.
}

TEST_CASE("A 2DIY that fails gives no force within 20 ms, says why, and comes back when armed") {
  const auto [order, cause] =
      GENERATE(table<std::string, std::string>({{"error", "sent the frame of board 6, must be 5"},
                                                {"not_finite", "an angle that is not finite"},
                                                {"broken", "it sent what it was not asked for"}}));
  DiySession session;
  session.press();
  check_fault(session, order, cause);
  session.order("good");
  CHECK(session.server().wait_for_error("Haply 2DIY is back", 5));
  CHECK(session.motor() == 0);
  session.press();
}

TEST_CASE("A 2DIY that was unplugged gives no force: nobody knows where its arms are") {
  DiySession session;
  session.press();
  check_fault(session, "unplug", "is gone");
  session.order("replug");
  CHECK(session.server().wait_for_error("put the arms in the start posture", 5));
  session.arm();
  std::this_thread::sleep_for(500ms);
  CHECK(session.motor() == 0);
}

TEST_CASE("What is missing is said before anything runs") {
  const std::string nowhere = "address=" + loopback(free_port());
  const Finished no_service = run({HLM_SERVER, "--device", "haply", "--device-option", nowhere});
  CHECK(no_service.exit_code == 1);
  CHECK_THAT(no_service.error, ContainsSubstring("no Inverse Service answers at 127.0.0.1:") &&
                                   ContainsSubstring("https://docs.haply.co"));
  const Finished no_port =
      run({HLM_SERVER, "--device", "haply2diy", "--device-option", "port=/nowhere/tty"});
  CHECK(no_port.exit_code == 1);
  CHECK_THAT(no_port.error, ContainsSubstring("/nowhere/tty cannot be opened: No such file"));
}

}  // namespace
}  // namespace hlm::test
