// The fake of Force Dimension's library, called as public callers call the real one.

#include <array>
#include <cmath>
#include <cstring>
#include <sstream>
#include <string>

#include <catch2/catch.hpp>

#include "tests/fakes/force_dimension_api.h"

namespace {

constexpr char kId = 0;

// What the calls of a fixed session return, as text, so that two readings can be compared.
class Transcript {
 public:
  template <class... Values>
  void operator()(const char* call, Values... values) {
    text_ << call;
    ((text_ << ' ' << values), ...);
    text_ << " e" << dhdErrorGetLast() << '\n';
  }
  void tenths(const char* call, const double* values, int count) {
    text_ << call;
    for (int i = 0; i < count; ++i) text_ << ' ' << std::lround(values[i] * 1e4);
    text_ << '\n';
  }
  std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
};

struct Truth {
  double position[3], velocity[3], force[3], gripper, gripper_force;
  Truth() { fake_truth(position, velocity, force, &gripper, &gripper_force); }
};

void read_all(Transcript& say, char id) {
  std::array<double, 3> p{7, 7, 7}, v{7, 7, 7}, w{7, 7, 7};
  double m[3][3] = {}, angle = 7;
  say("frame", dhdGetPositionAndOrientationFrame(&p[0], &p[1], &p[2], m, id));
  say.tenths("p", p.data(), 3);
  say.tenths("m", m[0], 9);
  p = {7, 7, 7};
  say("linear", dhdGetLinearVelocity(&v[0], &v[1], &v[2], id));
  say("position", dhdGetPosition(&p[0], &p[1], &p[2], id));
  say.tenths("p", p.data(), 3);
  say("angular", dhdGetAngularVelocityRad(&w[0], &w[1], &w[2], id));
  say("gripper", dhdGetGripperAngleRad(&angle, id));
  say.tenths("angle", &angle, 1);
  say("buttons", dhdGetButtonMask(id));
}

void say_status(Transcript& say, char id) {
  std::array<int, 17> status;
  status.fill(-9);
  say("status", dhdGetStatus(status.data(), id));
  for (int value : status) say("", value);
}

void say_inertia(Transcript& say, char id) {
  double joints[8] = {}, inertia[6][6] = {};
  dhdEnableExpertMode();
  say("joints", dhdGetJointAngles(joints, id));
  say("inertia", dhdJointAnglesToInertiaMatrix(joints, inertia, id));
  dhdDisableExpertMode();
  say.tenths("mass", inertia[0], 1);
}

void prepare(Transcript& say, char id) {
  say("initialized", drdIsInitialized(id));
  if (!drdIsInitialized(id)) {
    read_all(say, id);
    say("init", drdAutoInit(id));
    say_status(say, id);
  }
  say("set early", dhdSetForce(0.5, 0, 0, id));
  say.tenths("force", Truth().force, 3);
  say("emulate", dhdEmulateButton(1, id));
  fake_set_gripper_hand(0.01);
  fake_advance(0.2);
  say("buttons", dhdGetButtonMask(id));
  say("stop", drdStop(true, id));
  say("stop", drdStop(true, id));
  say("enable", dhdEnableForce(1, id));
  say("brakes", dhdSetBrakes(0, id));
  say("limit", dhdSetMaxForce(6, id));
}

void set_guards(Transcript& say, char id) {
  dhdEnableExpertMode();
  say("watchdog", dhdSetWatchdog(255, id));
  say("guard", dhdSetTimeGuard(500, id));
  dhdDisableExpertMode();
}

// A session as CHAI3D's and the ROS drivers' are. Its end sends no force for longer than the
// longest watchdog, while it still reads positions.
void session(Transcript& say, bool by_drd) {
  const int opened = by_drd ? drdOpenID(0) : dhdOpenID(0);
  const char id = static_cast<char>(opened);
  say("open", opened, dhdGetSystemName(id));
  say_status(say, id);
  prepare(say, id);
  if (by_drd) set_guards(say, id);
  for (int tick = 0; tick < 60; ++tick) {
    fake_advance(1e-3);
    double p[3], m[3][3];
    if (tick == 0) say("frame", dhdGetPositionAndOrientationFrame(&p[0], &p[1], &p[2], m, id));
    if (tick == 0) {
      double v[3];
      fake_advance(1e-4);
      say("early speed", dhdGetLinearVelocity(&v[0], &v[1], &v[2], id));
    }
    if (tick > 0 && tick < 5) read_all(say, id);
    dhdGetOrientationFrame(m, id);
    if (tick >= 10) continue;
    say("set", dhdSetForceAndTorqueAndGripperForce(7, 0, 0, 0.01, 0, 0, 2, id));
    const Truth truth;
    say.tenths("gripper force", &truth.gripper_force, 1);
  }
  say.tenths("force", Truth().force, 3);
  say_status(say, id);
  fake_advance(0.04);  // Nor does it read.
  say_status(say, id);
  say_inertia(say, id);
  say("close", dhdClose(id));
}

std::string transcript(const std::string& readings) {
  Transcript say;
  for (const char* model : {"omega.3", "omega.6", "omega.7", "omega.7-left"})
    for (bool by_drd : {false, true}) {
      REQUIRE(fake_configure(model, readings.c_str()));
      session(say, by_drd);
      REQUIRE(fake_configure(model, readings.c_str()));
      dhdReset(static_cast<char>(dhdOpenID(0)));
      session(say, by_drd);
    }
  return say.text();
}

char open_with_force(const char* model, const char* readings = "") {
  REQUIRE(fake_configure(model, readings));
  fake_advance(0);
  const int id = drdOpenID(0);
  REQUIRE(id >= 0);
  REQUIRE(dhdEnableForce(1, static_cast<char>(id)) == 0);
  return static_cast<char>(id);
}

}  // namespace

TEST_CASE("Force Dimension: nothing but opening works before a device is open") {
  REQUIRE(fake_configure("omega.7", ""));
  double x, y, z;
  CHECK(dhdGetDeviceCount() == 1);
  CHECK(dhdGetPosition(&x, &y, &z, kId) == -1);
  CHECK(dhdErrorGetLast() == 5);
  CHECK(dhdSetForce(0, 0, 0, -1) == -1);
  CHECK(dhdGetSystemName(kId) == nullptr);
  CHECK(dhdOpenID(1) == -1);
  CHECK(dhdOpenID(0) == kId);
  CHECK(dhdGetSystemType(-1) == 35);
}

TEST_CASE("Force Dimension: a force moves the handle against the hand, once it is enabled") {
  const char id = open_with_force("omega.3");
  fake_set_hand(0, 0, 0, 300, 5);
  dhdStop(id);
  dhdSetForce(1, 0, 0, id);
  fake_advance(1.0);
  CHECK(std::abs(Truth().position[0]) < 1e-9);
  dhdEnableForce(1, id);
  dhdSetForce(1, 0, 0, id);
  fake_advance(1.0);
  double x, y, z;
  CHECK(dhdGetPosition(&x, &y, &z, id) == 0);
  CHECK(x == Approx(1.0 / 300).margin(2e-5));
  CHECK(dhdSetForce(0, 20, 0, id) == 2);  // 12 N is all that the motors have.
  CHECK(Truth().force[1] == Approx(12));
}

TEST_CASE("Force Dimension: speed is a mean over 20 ms and fails below two positions in it") {
  const char id = open_with_force("omega.3");
  double v[3];
  CHECK(dhdGetLinearVelocity(&v[0], &v[1], &v[2], id) == -1);
  CHECK(dhdErrorGetLast() == 7);
  fake_set_hand(0.05, 0, 0, 300, 5);
  for (int i = 0; i < 60; ++i) {
    fake_advance(1e-3);
    const double before = Truth().position[0];
    CHECK(dhdGetLinearVelocity(&v[0], &v[1], &v[2], id) == 0);
    if (i != 40) continue;
    fake_advance(0.02);
    const double after = Truth().position[0];
    for (int k = 0; k < 20; ++k) dhdGetLinearVelocity(&v[0], &v[1], &v[2], id);
    CHECK(v[0] == Approx((after - before) / 0.02).margin(2e-3));
  }
  fake_advance(0.025);
  CHECK(dhdGetLinearVelocity(&v[0], &v[1], &v[2], id) == -1);
  CHECK(dhdErrorGetLast() == 7);
}

TEST_CASE("Force Dimension: the watchdog takes the forces off until they are enabled again") {
  const char id = open_with_force("omega.3");
  std::array<int, 17> status{};
  CHECK(dhdSetWatchdog(255, id) == -1);
  CHECK(dhdErrorGetLast() == 9);
  dhdEnableExpertMode();
  CHECK(dhdSetWatchdog(255, id) == 0);
  dhdSetForce(1, 0, 0, id);
  fake_advance(0.031);
  dhdGetStatus(status.data(), id);
  CHECK(status[5] == 1);
  fake_advance(0.002);
  dhdSetForce(1, 0, 0, id);
  dhdGetStatus(status.data(), id);
  CHECK(status[5] == 0);
  CHECK(status[6] == 1);
  CHECK(status[14] == 3);
  CHECK(Truth().force[0] == 0);
  dhdEnableForce(1, id);
  dhdSetForce(1, 0, 0, id);
  dhdGetStatus(status.data(), id);
  CHECK(status[5] == 1);
  CHECK(status[14] == 0);
}

TEST_CASE("Force Dimension: the time guard answers with data that are recent enough") {
  const char id = open_with_force("omega.3");
  dhdEnableExpertMode();
  CHECK(dhdSetTimeGuard(500, id) == 0);
  double x, y, z;
  fake_advance(1e-3);
  CHECK(dhdGetPosition(&x, &y, &z, id) == 0);
  CHECK(dhdGetPosition(&x, &y, &z, id) == 1);
  fake_advance(1e-3);
  CHECK(dhdGetPosition(&x, &y, &z, id) == 0);
}

TEST_CASE("Force Dimension: wrists, grippers and their buttons are those of the model") {
  double x, y, z, m[3][3], angle;
  char id = open_with_force("Falcon");
  CHECK(dhdGetPositionAndOrientationFrame(&x, &y, &z, m, id) == -1);
  CHECK(dhdErrorGetLast() == 6);
  CHECK(dhdGetOrientationFrame(m, id) == 0);
  CHECK(m[0][0] == 1);
  CHECK(dhdGetGripperAngleRad(&angle, id) == -1);
  CHECK_FALSE(dhdHasWrist(id));

  id = open_with_force("omega.7-left");
  CHECK(std::string(dhdGetSystemName(id)) == "omega.7 (left-hand)");
  CHECK(dhdIsLeftHanded(id));
  CHECK_FALSE(dhdHasActiveWrist(id));
  fake_set_gripper_hand(0.4);
  fake_advance(1.0);
  CHECK(dhdGetGripperAngleRad(&angle, id) == 0);
  CHECK(angle == Approx(-0.4).margin(1e-3));
  fake_set_gripper_hand(0.02);
  fake_advance(1.0);
  CHECK(dhdGetButtonMask(id) == 0);
  CHECK(dhdEmulateButton(1, id) == 0);
  CHECK(dhdGetButtonMask(id) == 1);
  dhdSetForceAndGripperForce(0, 0, 0, -2, id);  // Opens a left-handed gripper.
  fake_advance(1.0);
  CHECK(Truth().gripper > 0.06);
  CHECK(dhdGetButton(0, id) == 0);
}

TEST_CASE("Force Dimension: the hand turns a wrist, and torque does where there are motors") {
  double m[3][3];
  char id = open_with_force("sigma.7");
  fake_set_hand_rotation(0, 0, 0.3);
  fake_advance(1.0);
  CHECK(dhdGetOrientationFrame(m, id) == 0);
  CHECK(m[1][0] == Approx(std::sin(0.3)).margin(1e-3));
  dhdSetForceAndTorque(0, 0, 0, 0, 0, 0.1, id);
  fake_advance(1.0);
  CHECK(dhdGetOrientationFrame(m, id) == 0);
  CHECK(m[1][0] == Approx(std::sin(0.5)).margin(1e-3));  // 0.1 N·m on 0.5 N·m/rad.
}

TEST_CASE("Force Dimension: what is not calibrated takes its forces off, and not on") {
  const char id = open_with_force("omega.3");
  std::array<int, 17> status{};
  CHECK(dhdReset(id) == 0);
  CHECK(dhdEnableForce(0, id) == 0);
  CHECK(dhdEnableForce(1, id) == -1);
  CHECK(dhdErrorGetLast() == 12);
  dhdGetStatus(status.data(), id);
  CHECK(status[3] == 1);
  fake_calibrate();
  CHECK(dhdEnableForce(1, id) == 0);
}

TEST_CASE("Force Dimension: getters may share an exchange, which is then one position") {
  for (const char* readings : {"", "exchanges:shared"}) {
    const char id = open_with_force("omega.3", readings);
    double x, y, z, v[3];
    fake_advance(0.03);
    CHECK(dhdGetPosition(&x, &y, &z, id) == 0);
    fake_advance(1e-4);
    const int expected = *readings == 0 ? 0 : -1;
    CHECK(dhdGetLinearVelocity(&v[0], &v[1], &v[2], id) == expected);
    fake_advance(1e-4);
    CHECK(dhdGetLinearVelocity(&v[0], &v[1], &v[2], id) == 0);
  }
}

TEST_CASE("Force Dimension: what was unplugged fails every call and is not counted") {
  const char id = open_with_force("omega.6");
  fake_unplug();
  double x, y, z;
  CHECK(dhdGetPosition(&x, &y, &z, id) == -1);
  CHECK(dhdErrorGetLast() == 2);
  CHECK(dhdSetForce(0, 0, 0, id) == -1);
  CHECK(dhdGetDeviceCount() == 0);
}

TEST_CASE("Force Dimension: each doubtful sentence changes what a public caller meets") {
  fake_advance(0);
  const std::string likely = transcript("");
  const bool repeats = likely == transcript("first");  // Not in the CHECK, which would print all.
  CHECK(repeats);
  for (int i = 0; const char* doubt = fake_doubt(i); ++i) {
    const std::string words = doubt;
    const std::string other =
        words.substr(0, words.find(':') + 1) + words.substr(words.find('|') + 1);
    CAPTURE(other);
    const bool differs = likely != transcript(other);
    CHECK(differs);
  }
  CHECK_FALSE(fake_configure("omega.7", "open:perhaps"));
  CHECK_FALSE(fake_configure("omega.8", ""));
}
