#include "hlm/device/replay_device.h"

#include <charconv>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include <unistd.h>

#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"
#include "tests/support/random.h"

namespace hlm::server {
namespace {

const std::string kHeader =
    "session,step,time_s,device_x_m,device_y_m,device_z_m,device_qw,device_qx,device_qy,device_qz,"
    "device_vx_m_per_s,device_vy_m_per_s,device_vz_m_per_s,device_wx_rad_per_s,device_wy_rad_per_s,"
    "device_wz_rad_per_s,hand_measured,hand_observed,hand_force_x_N,hand_force_y_N,hand_force_z_N,"
    "hand_torque_x_N_m,hand_torque_y_N_m,hand_torque_z_N_m,dropped\n";

std::string exact(double value) {
  std::array<char, 32> digits;
  return {digits.data(), std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr};
}

/// One line of a tick log, with columns around those that a replay needs.
std::string line(const RecordedStep& recorded) {
  const DeviceState& state = recorded.state;
  std::string text = std::to_string(recorded.session) + ',' + std::to_string(recorded.step) + ",0";
  for (const double value : state.X_WD.p) text += ',' + exact(value);
  const Quaternion& R = state.X_WD.R;
  for (const double value : {R.w(), R.x(), R.y(), R.z()}) text += ',' + exact(value);
  for (const double value : state.V_WD) text += ',' + exact(value);
  text += state.F_hand ? ",1" : ",0";
  text += state.hand_observed ? ",1" : ",0";
  for (const double value : state.F_hand.value_or(Wrench::Zero())) text += ',' + exact(value);
  return text + ",7\n";
}

DeviceState random_state(test::Random& random) {
  DeviceState state;
  state.X_WD = random.pose(0.3);
  for (double& value : state.V_WD) value = random.uniform(-1e-9, 1e3);
  state.F_hand.emplace();
  state.hand_observed = random.integer(0, 1) == 1;
  for (double& value : *state.F_hand) value = random.uniform(-12, 12);
  return state;
}

std::vector<RecordedStep> recorded(test::Random& random, std::uint64_t session,
                                   std::uint64_t count) {
  std::vector<RecordedStep> steps;
  for (std::uint64_t step = 1; step <= count; ++step) {
    steps.push_back({session, step, random_state(random)});
  }
  return steps;
}

/// A file of its own for each process, gone with the object.
class TemporaryLog {
 public:
  explicit TemporaryLog(const std::string& text)
      : path_(std::filesystem::temp_directory_path() /
              ("replay_device_test_" + std::to_string(getpid()) + ".csv")) {
    std::ofstream(path_) << text;
  }
  ~TemporaryLog() { std::filesystem::remove(path_); }
  TemporaryLog(const TemporaryLog&) = delete;
  TemporaryLog& operator=(const TemporaryLog&) = delete;

  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

bool same(const DeviceState& a, const DeviceState& b) {
  return a.X_WD == b.X_WD && a.V_WD == b.V_WD && a.F_hand == b.F_hand;
}

/// The error for this log, without the file's name.
std::string error_of(const std::string& text) {
  const TemporaryLog log(text);
  try {
    read_recorded_steps(log.path());
  } catch (const std::runtime_error& error) {
    std::string what = error.what();
    const std::size_t at = what.find(log.path());
    REQUIRE(at != std::string::npos);
    return what.erase(at, log.path().size());
  }
  return "no error";
}

/// `text` with its only `old` changed.
std::string replaced(std::string text, const std::string& old, const std::string& with) {
  const std::size_t at = text.find(old);
  REQUIRE(at != std::string::npos);
  return text.replace(at, old.size(), with);
}

TEST_CASE("A log gives the recorded doubles back bit for bit") {
  test::Random random;
  const std::vector<RecordedStep> steps = recorded(random, 42, 1000);
  std::string text = kHeader;
  for (const RecordedStep& step : steps) text += line(step);
  const std::vector<RecordedStep> read = read_recorded_steps(TemporaryLog(text).path());
  REQUIRE(read.size() == steps.size());
  for (std::size_t i = 0; i < steps.size(); ++i) {
    REQUIRE(read[i].session == 42);
    REQUIRE(read[i].step == steps[i].step);
    REQUIRE(same(read[i].state, steps[i].state));
  }
}

TEST_CASE("Ticks without a session are left out, and so is an unmeasured hand") {
  test::Random random;
  RecordedStep idle{0, 0, random_state(random)};
  RecordedStep first{5, 1, random_state(random)};
  first.state.F_hand.reset();
  const TemporaryLog log(kHeader + line(idle) + line(first) + line(idle));
  const std::vector<RecordedStep> steps = read_recorded_steps(log.path());
  REQUIRE(steps.size() == 1);
  CHECK_FALSE(steps[0].state.F_hand);
  CHECK_FALSE(ReplayDevice(steps, {}).measures_hand_wrench());
}

TEST_CASE("The device plays one step for each write, whatever is written") {
  test::Random random;
  const std::vector<RecordedStep> steps = recorded(random, 1, 3);
  ReplayDevice device(steps, {.max_force = 3});
  CHECK(device.ratings().max_force == 3);
  CHECK(device.measures_hand_wrench());
  CHECK(same(*device.read(), steps[0].state));
  CHECK(device.write(Wrench::Zero()));
  CHECK(same(*device.read(), steps[0].state));

  device.align(random.pose(1));
  device.enable();
  for (const RecordedStep& step : steps) {
    CHECK(same(*device.read(), step.state));
    CHECK(device.write(Wrench::Ones()));
  }
  CHECK_FALSE(device.read());
  CHECK_FALSE(device.write(Wrench::Zero()));
}

TEST_CASE("Each align begins the next recorded session") {
  test::Random random;
  std::vector<RecordedStep> steps = recorded(random, 1, 3);
  const std::vector<RecordedStep> second = recorded(random, 2, 2);
  steps.insert(steps.end(), second.begin(), second.end());
  ReplayDevice device(steps, {});
  device.align(Pose{});
  device.write(Wrench::Zero());
  device.align(Pose{});
  CHECK(same(*device.read(), second[0].state));
  device.write(Wrench::Zero());
  CHECK(same(*device.read(), second[1].state));
  device.align(Pose{});
  CHECK_FALSE(device.read());
}

TEST_CASE("Playing a log allocates nothing") {
  test::Random random;
  ReplayDevice device(recorded(random, 1, 3), {});
  const test::NoMalloc guard;
  device.align(Pose{});
  for (int i = 0; i < 5; ++i) {
    device.read();
    device.write(Wrench::Zero());
  }
  const std::size_t allocations = guard.allocations();
  CHECK(allocations == 0);
}

TEST_CASE("A log that cannot be replayed is refused with file, line and column") {
  test::Random random;
  std::vector<RecordedStep> steps = recorded(random, 1, 3);
  steps[1].state.X_WD.p.x() = 0.125;
  steps[1].state.X_WD.R = Quaternion(1, 0, 0, 0);
  steps[1].state.V_WD[5] = 0.25;
  const std::string good = kHeader + line(steps[0]) + line(steps[1]) + line(steps[2]);
  const std::string third = ":3: column device_x_m: ";
  CHECK(error_of(good) == "no error");
  CHECK(error_of(replaced(good, ",0.125,", ",a,")) == third + "'a' must be a number");
  CHECK(error_of(replaced(good, ",0.125,", ",0.125x,")) == third + "'0.125x' must be a number");
  CHECK(error_of(replaced(good, ",0.125,", ",,")) == third + "'' must be a number");
  CHECK(error_of(replaced(good, ",0.125,", ",nan,")) == third + "'nan' must be a finite number");
  CHECK(error_of(replaced(good, ",1,0,0,0,", ",0.5,0,0,0,")) ==
        ":3: columns device_qw to device_qz must be a unit quaternion, its length is 0.500000");
  CHECK(error_of(replaced(good, ",0.25,1,", ",0.25,2,")) ==
        ":3: column hand_measured: '2' must be 0 or 1");
  CHECK(error_of(replaced(good, "\n1,2,", "\n-1,2,")) ==
        ":3: column session: '-1' must be a whole number");
  CHECK(error_of(kHeader + line(steps[0]) + line(steps[2])) ==
        ":3: column step: '3' must be 2; a replay needs every step of a session");
  CHECK(error_of(kHeader + line(steps[1])) ==
        ":2: column step: '2' must be 1; a replay needs every step of a session");
  CHECK(error_of(kHeader) == "tick log : holds no step of a session");
  CHECK_THAT(error_of(replaced(good, "device_y_m", "device_y")),
             Catch::Matchers::ContainsSubstring("Missing column \"device_y_m\""));
  CHECK_THAT(error_of(good + "1,4,0\n"), Catch::Matchers::ContainsSubstring("line 5"));
  CHECK_THROWS_AS(read_recorded_steps("/nowhere/ticks.csv"), std::runtime_error);
}

}  // namespace
}  // namespace hlm::server
