// Drivers of real devices, in the real programs, against stand-ins for the vendors' sides.
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <thread>

#include "tests/support/catch.h"
#include "tests/system/stand_in_session.h"

namespace hlm::test {
namespace {

using namespace std::chrono_literals;
using Catch::Matchers::ContainsSubstring;

constexpr double kPush = 2;  // N, of the hand.
/// A device that works again is found within that.
constexpr auto kReopening = 500ms;

/// A device behind a vendor's library; the hand usually pushes it with kPush along +y, which is
/// against the testbed's wall.
struct LibrarySession : StandInSession {
  explicit LibrarySession(const std::string& device, const Arguments& options = {},
                          const std::string& wrench = "{ force = [0, 2, 0] }")
      : StandInSession(wrench) {
    setenv("LD_LIBRARY_PATH", HLM_STAND_INS, 1);
    // A handle of 0.1 kg whose speed lags does not bear the usual coupling: it shakes.
    const Arguments coupling = {"--coupling-stiffness", "1000", "--coupling-damping", "10"};
    const bool is_light = device == "openhaptics";
    serve(device_of(device) + (is_light ? coupling : Arguments{}) + options);
  }

  /// Until the hand presses the wall and rests there.
  void press() { StandInSession::press(-kPush); }
};

/// An order to the stand-in, and what the server's log says of it.
struct SeededFault {
  const char* order;
  const char* cause;
};

/// Each fault takes the force away with its cause named, and an explicit arm brings it back.
void check_faults(LibrarySession& session, std::initializer_list<SeededFault> faults) {
  for (const SeededFault& fault : faults) {
    INFO(fault.order);
    session.arm();
    session.press();
    session.order(fault.order);
    const double time = session.time_until_off();
    WARN(fault.order << ": no force after " << 1e3 * time << " ms");
    CHECK(time < kMostUntilOff + kStall);
    CHECK(session.server().wait_for_error(fault.cause, 5));
    std::this_thread::sleep_for(50ms);
    CHECK(session.motor() == 0);
    session.order("good");
    std::this_thread::sleep_for(kReopening);
  }
  session.arm();
  session.press();
}

/// The wall's force is the hand's.
void check_press(LibrarySession& session) {
  session.arm();
  session.press();
  std::this_thread::sleep_for(500ms);
  double sum = 0;
  constexpr int kSamples = 500;
  for (int i = 0; i < kSamples; ++i) {
    sum += session.motor();
    std::this_thread::sleep_for(1ms);
  }
  // A Touch's encoder steps let it tremble by 0.1 N.
  CHECK(sum / kSamples == Approx(-kPush).epsilon(0.02));  // N
}

/// Only an explicit arm gives the force of a device that was unplugged back, and only once it is
/// there again.
void check_replug(LibrarySession& session, const std::string& cause) {
  session.arm();
  session.press();
  session.order("unplug");
  CHECK(session.time_until_off() < kMostUntilOff + kStall);
  CHECK(session.server().wait_for_error(cause, 5));
  session.arm();
  std::this_thread::sleep_for(1s);
  CHECK(session.motor() == 0);
  session.order("replug");
  std::this_thread::sleep_for(kReopening);
  CHECK(session.motor() == 0);
  session.arm();
  session.press();
}

TEST_CASE("A hand that presses a wall through a vendor's library feels it within 2 %") {
  const std::string device = GENERATE("forcedimension", "openhaptics");
  INFO(device);
  LibrarySession session(device);
  check_press(session);
}

TEST_CASE("A peg that is shaken in a hole that fits it exactly stays there, its handle near it") {
  // Largest distance of handle and proxy, mm: that of the coupling which each bears, some 1.5 kN/m
  // and 0.15 kN/m, and of the observer's lag.
  const auto [device, away] =
      GENERATE(table<std::string, double>({{"forcedimension", 1.2}, {"openhaptics", 15}}));
  INFO(device);
  // The hole is along the world's y, where the peg begins.
  LibrarySession session(device, {},
                         "{ force = [0, 0, 0], force_amplitude = [1, 0, 0], frequency = 2 }");
  session.arm({"--start", "hole"});
  REQUIRE(session.server().wait_for_error("force is on", 10));
  std::this_thread::sleep_for(3s);
  CHECK_THAT(session.server().error(), !ContainsSubstring("fault"));
  session.server().send_signal(SIGTERM);
  REQUIRE(session.server().wait(10) == 0);
  const std::string summary = session.server().output();
  INFO(summary);
  const auto number_after = [&summary](const std::string& words) {
    return std::stod(summary.substr(summary.find(words) + words.size()));
  };
  CHECK(number_after("device-proxy   largest ") < away);
  CHECK(number_after("proxy-tool     largest ") < 1);  // mm
  CHECK(number_after("peak force     ") > 0.8);        // N
}

TEST_CASE("In another frame and at twice the size a wall gives the same force") {
  // The hand pushes against the wall on the other side. At the handle a damping is four times that
  // of the world, too much for a speed that is a mean over 2 ms.
  LibrarySession session("forcedimension",
                         {"--device-option", "frame=-x -y z", "--device-option", "scale=2",
                          "--device-option", "rotation-scale=2", "--coupling-damping", "10"});
  check_press(session);
}

TEST_CASE("A Force Dimension device that fails gives no force within 20 ms, and says why") {
  LibrarySession session("forcedimension");
  check_faults(session, {{"error", "the controller reports an error"},
                         {"mirror", "its frame is left-handed"},
                         {"not_finite", "is not a number"},
                         {"timeguard", "its library holds back new values"},
                         {"force_off", "it was faster than its velocity threshold"}});
}

TEST_CASE("A device of OpenHaptics that fails gives no force within 20 ms, and says why") {
  LibrarySession session("openhaptics");
  check_faults(session, {{"error", "it reports a fault of its own"},
                         {"mirror", "its frame is left-handed"},
                         {"not_finite", "is not a number"},
                         {"broken", "the vendor's scheduler gives no new state"},
                         {"force_off", "its force could not be set"}});
}

TEST_CASE("A device that freezes while it moves gives no force within 20 ms, and says so") {
  const std::string device = GENERATE("forcedimension", "openhaptics");
  INFO(device);
  LibrarySession session(device);
  session.arm();
  REQUIRE(wait_until(10, [&] { return session.motor() < -0.3; }));  // N, on the way to the wall
  session.order("freeze");
  CHECK(session.time_until_off() < kMostUntilOff + kStall);
  CHECK(session.server().wait_for_error("its pose stays the same while it says that it moves", 5));
}

TEST_CASE("A device that is unplugged gives no force, and is back once a person arms it") {
  const std::string device = GENERATE("forcedimension", "openhaptics");
  INFO(device);
  LibrarySession session(device);
  check_replug(session, "fault: the device failed: ");
  CHECK_THAT(session.server().error(), ContainsSubstring("not answer"));
}

TEST_CASE("What is slow or saturated is said, and force goes on") {
  const auto [device, slow] = GENERATE(table<std::string, std::string>(
      {{"forcedimension", "at less than half the server's rate"},
       {"openhaptics", "the vendor's scheduler gives new states too seldom"}}));
  INFO(device);
  LibrarySession session(device);
  session.arm();
  session.press();
  session.order("slow");
  CHECK(session.server().wait_for_error(slow, 5));
  session.order("good\nsaturate");
  CHECK(session.server().wait_for_error("more was commanded than", 5));
  CHECK(session.motor() != 0);
}

TEST_CASE(
    "While its clutch is held a handle moves freely, and its force is back when it is let go") {
  LibrarySession session("forcedimension", {"--device-option", "clutch=1"});
  session.arm();
  session.press();
  session.order("press 0");
  CHECK(wait_until(1, [&] { return session.motor() == 0; }));
  std::this_thread::sleep_for(200ms);
  CHECK(session.motor() == 0);
  session.order("release 0");
  session.press();
  CHECK_THAT(session.server().error(), !ContainsSubstring("fault"));
}

TEST_CASE("A list of devices names those that the vendors' libraries find, or what is missing") {
  for (const char* order : {"HAND", "ORDERS", "MOTORS"}) {
    unsetenv((std::string("HAPTIC_STAND_IN_") + order).c_str());
  }
  setenv("LD_LIBRARY_PATH", HLM_STAND_INS, 1);
  CHECK_THAT(run({HLM_SERVER, "--device", "list"}).output,
             ContainsSubstring("number 0: sigma.7, through libdhd.so") &&
                 ContainsSubstring("'Default Device': OpenHaptics Touch, through libHD.so"));
  unsetenv("LD_LIBRARY_PATH");
  CHECK_THAT(run({HLM_SERVER, "--device", "list"}).output,
             ContainsSubstring("libdhd.so not found") && ContainsSubstring("forcedimension.com") &&
                 ContainsSubstring("libHD.so not found") && ContainsSubstring("3dsystems.com"));
  const std::string library = "library=" HLM_STAND_INS "/libdhd.so";
  CHECK_THAT(run({HLM_SERVER, "--device", "list", "--device-option", library}).output,
             ContainsSubstring("number 0: sigma.7, through " HLM_STAND_INS "/libdhd.so") &&
                 ContainsSubstring("libdhd.so has no function hdInitDevice"));
  const Finished unknown = run({HLM_SERVER, "--device", "list", "--device-option", "libary=x"});
  CHECK(unknown.exit_code == 2);
  CHECK_THAT(unknown.error, ContainsSubstring("libary: no device has such a key"));
  const Finished missing =
      run({HLM_SERVER, "--device", "openhaptics", "--device-option", "library=/nowhere/libHD.so"});
  CHECK(missing.exit_code == 1);
  CHECK_THAT(missing.error, ContainsSubstring("/nowhere/libHD.so not found"));
}

TEST_CASE(
    "A device that keeps its last force without commands is refused, unless that is accepted") {
  const Arguments touch{HLM_SERVER,
                        "--device",
                        "openhaptics",
                        "--duration",
                        "0.1",
                        "--device-option",
                        "library=" HLM_STAND_INS "/libHD.so"};
  const Finished refused = run(touch);
  CHECK(refused.exit_code == 2);
  CHECK_THAT(refused.error, ContainsSubstring("OpenHaptics Touch has no time guard") &&
                                ContainsSubstring("--without-time-guard"));
  CHECK(run(touch + Arguments{"--without-time-guard"}).exit_code == 0);
  const Arguments sigma{HLM_SERVER,
                        "--device",
                        "forcedimension",
                        "--duration",
                        "0.1",
                        "--device-option",
                        "library=" HLM_STAND_INS "/libdhd.so"};
  CHECK(run(sigma).exit_code == 0);
}

}  // namespace
}  // namespace hlm::test
