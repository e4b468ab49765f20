#include "hlm/haptic_server/device/hand_script.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include <unistd.h>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using Catch::Matchers::Message;

/// A file of its own for each process, gone with the object.
class TemporaryScript {
 public:
  explicit TemporaryScript(const std::string& text)
      : path_(std::filesystem::temp_directory_path() /
              ("hand_script_test_" + std::to_string(getpid()) + ".toml")) {
    std::ofstream(path_) << text;
  }
  ~TemporaryScript() { std::filesystem::remove(path_); }
  TemporaryScript(const TemporaryScript&) = delete;
  TemporaryScript& operator=(const TemporaryScript&) = delete;

  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

HandScript read(const std::string& text) { return read_hand_script(TemporaryScript(text).path()); }

/// The error for this text, without the file's name.
std::string error_of(const std::string& text) {
  const TemporaryScript script(text);
  try {
    read_hand_script(script.path());
  } catch (const std::runtime_error& error) {
    const std::string what = error.what();
    REQUIRE(what.starts_with(script.path() + ':'));
    return what.substr(script.path().size() + 1);
  }
  return "no error";
}

TEST_CASE("A script is read with every key in its place") {
  const HandScript script = read(R"(
    after = "repeat"
    [grip]
    stiffness = 300
    damping = 11.5
    [[segment]]
    duration = 2
    move_to = { position = [0.1, 0.2, 0.3], rotation = [0, 0, 1.5], relative = true }
    grip = { stiffness = 400, angular_stiffness = 3, angular_damping = 0.2, max_force = 5, max_torque = 0.4 }
    [[segment]]
    duration = 0.5
    move_to = {}
    opening = 0.25
    [[segment]]
    duration = 8
    wrench = { force = [1, 2, 3], torque = [4, 5, 6], force_amplitude = [7, 8, 9], torque_amplitude = [10, 11, 12], frequency = 2.5, phase = 0.1 }
  )");
  CHECK(script.after == AfterLastSegment::kRepeat);
  REQUIRE(script.segments.size() == 3);
  CHECK(script.segments[0].duration == 2);
  CHECK_FALSE(script.segments[0].opening);
  CHECK(script.segments[1].opening == 0.25);

  const Reach& reach = std::get<Reach>(script.segments[0].action);
  CHECK(*reach.position == Vector3(0.1, 0.2, 0.3));
  CHECK(*reach.rotation == Vector3(0, 0, 1.5));
  CHECK(reach.relative);
  CHECK(reach.grip.stiffness == 400);
  CHECK(reach.grip.damping == 11.5);
  CHECK(reach.grip.angular_stiffness == 3);
  CHECK(reach.grip.angular_damping == 0.2);
  CHECK(reach.grip.max_force == 5);
  CHECK(reach.grip.max_torque == 0.4);

  const Reach& rest = std::get<Reach>(script.segments[1].action);
  CHECK_FALSE(rest.position);
  CHECK_FALSE(rest.rotation);
  CHECK_FALSE(rest.relative);
  CHECK(rest.grip.stiffness == 300);

  const Push& push = std::get<Push>(script.segments[2].action);
  CHECK(push.constant == (Wrench() << 1, 2, 3, 4, 5, 6).finished());
  CHECK(push.amplitude == (Wrench() << 7, 8, 9, 10, 11, 12).finished());
  CHECK(push.frequency == 2.5);
  CHECK(push.phase == 0.1);
}

TEST_CASE("The hand releases unless the script says otherwise") {
  const std::string segment = "[[segment]]\nduration = 1\nwrench = {}\n";
  CHECK(read(segment).after == AfterLastSegment::kRelease);
  CHECK(read("after = 'hold'\n" + segment).after == AfterLastSegment::kHold);
}

TEST_CASE("The demonstration's session is a valid script of 30 to 35 s") {
  const HandScript script = read_hand_script(HLM_HANDS "/session.toml");
  double duration = 0;
  for (const HandSegment& segment : script.segments) duration += segment.duration;
  CHECK(duration >= 30);
  CHECK(duration <= 35);
}

TEST_CASE("A missing file is named") {
  CHECK_THROWS_MATCHES(read_hand_script("/nowhere/hand.toml"), std::runtime_error,
                       Message("/nowhere/hand.toml: File could not be opened for reading"));
}

TEST_CASE("A mistake in a script is one line that says where, what, and what is allowed") {
  const std::string segment = "[[segment]]\nduration = 1\n";
  const std::string reach = segment + "move_to = {}\n";
  CHECK(error_of("") == "1: hand script: has no [[segment]]");
  CHECK(error_of("speed = 1\n" + reach) ==
        "1: hand script: unknown key 'speed'; allowed: after, grip, segment");
  CHECK(error_of("after = 'stop'\n" + reach) ==
        "1: hand script: after 'stop' must be 'release', 'hold' or 'repeat'");
  CHECK(error_of("after = 3\n" + reach) ==
        "1: hand script: after 3 must be 'release', 'hold' or 'repeat'");
  CHECK(error_of("segment = 3\n") == "1: hand script: segments must be written [[segment]]");
  CHECK(error_of("segment = [3]\n") == "1: hand script: segment 1 must be a table");
  CHECK(error_of("grip = 3\n" + reach) ==
        "1: hand script: grip must be a table { key = value, … }");
  CHECK(error_of("[grip]\nstiffness = 1e6\n" + reach) ==
        "2: hand script: grip: stiffness 1000000 N/m must be 0 to 20000 N/m");
  CHECK(error_of(reach + "[[segment]]\nwrench = {}\n") == "4: segment 2: duration is missing");
  CHECK(error_of("[[segment]]\nduration = 0\nmove_to = {}\n") ==
        "2: segment 1: duration 0 s must be 0.001 to 3600 s");
  CHECK(error_of("[[segment]]\nduration = 1\nmove_to = {}\nopening = 1.5\n") ==
        "4: segment 1: opening 1.5 must be 0 to 1");
  CHECK(error_of("[[segment]]\nduration = '1'\nmove_to = {}\n") ==
        "2: segment 1: duration must be a number");
  CHECK(error_of("[[segment]]\nduration = nan\nmove_to = {}\n") ==
        "2: segment 1: duration nan s must be 0.001 to 3600 s");
  CHECK(error_of(segment) == "1: segment 1: must have either wrench or move_to");
  CHECK(error_of(reach + "wrench = {}\n") == "1: segment 1: must have either wrench or move_to");
  CHECK(error_of(segment + "wrench = {}\ngrip = {}\n") == "4: segment 1: grip needs move_to");
  CHECK(error_of(segment + "wrench = { force = [1, 2] }\n") ==
        "3: segment 1: wrench: force must be three numbers [x, y, z]");
  CHECK(error_of(segment + "wrench = { force = [1, 2, 2000] }\n") ==
        "3: segment 1: wrench: force[2] 2000 N must be -1000 to 1000 N");
  CHECK(error_of(segment + "wrench = { frequency = -2 }\n") ==
        "3: segment 1: wrench: frequency -2 Hz must be 0 to 1000 Hz");
  CHECK(error_of(segment + "move_to = { relative = 1 }\n") ==
        "3: segment 1: move_to: relative must be true or false");
  CHECK(error_of(segment + "move_to = { position = [0, 0, 'a'] }\n") ==
        "3: segment 1: move_to: position[2] must be a number");
  CHECK(error_of(reach + "grip = { stifness = 1 }\n") ==
        "4: segment 1: grip: unknown key 'stifness'; allowed: stiffness, damping, "
        "angular_stiffness, angular_damping, max_force, max_torque");
  CHECK_THAT(error_of("duration = = 1\n"), Catch::Matchers::StartsWith("1: "));
}

}  // namespace
}  // namespace hlm::server
