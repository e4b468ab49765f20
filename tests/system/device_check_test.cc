// haptic_doctor device with a scripted person: answers come through a pipe, a stand-in's hand moves
// the handle as it was asked. Each fault is named, and each check ends without force.
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <thread>

#include <fcntl.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>
#include <unistd.h>

#include "hlm/protocol/transport/udp_socket.h"
#include "tests/support/catch.h"
#include "tests/system/process.h"
#include "tests/system/session.h"

namespace hlm::test {
namespace {

using namespace std::chrono_literals;
using Catch::Matchers::ContainsSubstring;
using nlohmann::json;

constexpr int kNoProblem = 0;
constexpr int kNotAll = 1;
constexpr int kProblem = 4;
constexpr double kUntilOff = 0.02 + 0.015;  // s, and what a busy machine adds.

/// The steps' place among the examinations.
enum Step { kDevice, kRest, kFrame, kForce, kExchange };

/// A stand-in, haptic_doctor on it, and the person. The stand-ins' environment is that of this
/// process: one of these at a time.
class Visit {
 public:
  Visit() {
    std::ofstream(file("orders"));
    unsetenv("HAPTIC_STAND_IN_HAND");
    setenv("HAPTIC_STAND_IN_ORDERS", file("orders").c_str(), 1);
    setenv("HAPTIC_STAND_IN_MOTORS", file("motors").c_str(), 1);
    setenv("LD_LIBRARY_PATH", HLM_STAND_INS, 1);
    REQUIRE(mkfifo(file("answers").c_str(), 0600) == 0);
    watcher_ = std::jthread([this](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        if (motor() > largest_) largest_ = motor();
        std::this_thread::sleep_for(1ms);
      }
    });
  }
  ~Visit() { end_answers(); }

  std::string file(const std::string& name) const { return directory_.file(name); }

  /// Starts the doctor; the person has the handle in the middle once it is asked.
  void begin(const Arguments& options) {
    doctor_.emplace(Arguments{"sh", "-c", "exec \"$0\" \"$@\" <" + file("answers"), HLM_DOCTOR,
                              "device", "--json", "--server", loopback(free_port())} +
                    options);
    answers_ = open(file("answers").c_str(), O_WRONLY | O_CLOEXEC);
    expect("to the middle");
  }
  void expect(const std::string& words) {
    const bool asked = doctor_->wait_for_error(words, 15);
    INFO(doctor_->error() << doctor_->output());
    REQUIRE(asked);
  }
  void answer(const std::string& lines) const {
    REQUIRE(write(answers_, lines.data(), lines.size()) == static_cast<ssize_t>(lines.size()));
  }
  void order(const std::string& line) const {
    std::ofstream(file("orders"), std::ios::app) << line << '\n';
  }
  /// Moves the handle to the right, away and up, the device's x, y and z, each when asked.
  void move(double distance = 0.05, bool has_up = true) {
    answer("\n");
    std::array<double, 3> p{};
    const std::array<const char*, 3> asked{"5 cm to the right", "5 cm away", "5 cm up"};
    for (std::size_t i = 0; i < 3; ++i) {
      expect(asked[i]);
      if (i == 2 && !has_up) return answer("skip\n");
      p[i] = distance;
      std::ostringstream text;
      text << "hold " << p[0] << ' ' << p[1] << ' ' << p[2];
      order(text.str());
      std::this_thread::sleep_for(600ms);
      answer("\n");
    }
  }
  /// The hand lets go; the person allows pushes and sees them go where they should.
  void allow_pushes(const std::string& directions) {
    expect("The force:");
    order("let_go");
    std::this_thread::sleep_for(20ms);
    answer("yes\nYes\n" + directions);
  }
  void end_answers() {
    if (answers_ >= 0) close(std::exchange(answers_, -1));
  }
  /// Ends by itself, motors without force. What was found.
  json finish(int status) {
    const int code = doctor_->wait(20);
    INFO(doctor_->error() << doctor_->output());
    CHECK(code == status);
    CHECK(motor() == 0);
    return json::parse(doctor_->output());
  }
  /// N, of the motors now, and the most so far.
  double motor() const {
    std::array<double, 6> F{};
    std::ifstream(file("motors"), std::ios::binary)
        .read(reinterpret_cast<char*>(F.data()), sizeof F);
    return std::hypot(F[0], F[1], F[2]);
  }
  double largest() const { return largest_; }
  /// s, up to 1.
  double time_until_off() const {
    const auto begin = std::chrono::steady_clock::now();
    const auto elapsed = [&] { return std::chrono::steady_clock::now() - begin; };
    while (motor() > 0 && elapsed() < 1s) std::this_thread::sleep_for(200us);
    return std::chrono::duration<double>(elapsed()).count();
  }
  Process& doctor() { return *doctor_; }

 private:
  TemporaryDirectory directory_;
  std::optional<Process> doctor_;
  int answers_ = -1;
  std::atomic<double> largest_ = 0;
  std::jthread watcher_;
};

/// All of one subject, as "VERDICT: TEXT > ADVICE" lines.
std::string words_on(const json& report, Step step, const std::string& subject) {
  std::string words;
  for (const json& finding : report.at("examinations").at(step).at("findings")) {
    if (finding.at("subject") != subject) continue;
    words += finding.at("verdict").get<std::string>() + ": " +
             finding.at("text").get<std::string>() + " > " +
             finding.at("advice").get<std::string>() + '\n';
  }
  return words;
}

/// The first number of a finding's text.
double number_of(const json& report, Step step, const std::string& subject) {
  const std::string words = words_on(report, step, subject);
  INFO(report.dump(1));
  REQUIRE(words.find(": ") != std::string::npos);
  return std::stod(words.substr(words.find(": ") + 2));
}

const Arguments kSigma = device_of("forcedimension");

TEST_CASE("A device that is as it is set passes, and its mass, friction and rate are found") {
  Visit visit;
  visit.begin(kSigma);
  visit.move();
  visit.allow_pushes("right\naway\nup\n");
  const json report = visit.finish(kNoProblem);
  INFO(report.dump(1));
  CHECK_THAT(words_on(report, kDevice, "present"), ContainsSubstring("/libdhd.so)"));
  CHECK_THAT(words_on(report, kDevice, "rated"),
             ContainsSubstring("0.3 kg") && ContainsSubstring("not known: exchange"));
  CHECK_THAT(words_on(report, kFrame, "speed"), ContainsSubstring("good"));
  CHECK(words_on(report, kFrame, "scale").empty());
  CHECK_THAT(words_on(report, kForce, "mass"), ContainsSubstring("good"));
  CHECK(words_on(report, kForce, "axes").empty());
  CHECK_THAT(words_on(report, kFrame, "frame"), ContainsSubstring("good: frame 'x y z' is right"));
  for (const char* direction : {"right", "away", "up"}) {
    CHECK_THAT(words_on(report, kForce, direction),
               ContainsSubstring("good") && ContainsSubstring(direction));
  }
  CHECK(number_of(report, kForce, "mass") == Approx(0.3).epsilon(0.1));       // kg
  CHECK(number_of(report, kForce, "friction") == Approx(0.02).margin(0.01));  // N
  CHECK(number_of(report, kForce, "delay") == Approx(0).margin(2));           // ms
  CHECK(number_of(report, kExchange, "rate") > 800);                          // Hz
  CHECK(visit.largest() > 0.9);                                               // N
  CHECK(visit.largest() < 1.01);                                              // N, as was said.
}

TEST_CASE("A device of OpenHaptics passes within the force that was asked for") {
  Visit visit;
  visit.begin({"--device", "openhaptics", "--device-option", "oldest=0.1", "--force-limit", "0.2"});
  visit.move();
  visit.allow_pushes("right\naway\nup\n");
  // That nothing takes its motors off in a crash stays a problem.
  const json report = visit.finish(kProblem);
  INFO(report.dump(1));
  CHECK_THAT(words_on(report, kDevice, "at a crash"), ContainsSubstring("problem"));
  CHECK_THAT(words_on(report, kForce, "up"), ContainsSubstring("good"));
  CHECK(number_of(report, kForce, "mass") == Approx(0.1).epsilon(0.15));  // kg
  CHECK(visit.largest() < 0.201);                                         // N
}

/// An Inverse Service beside the doctor, whose device a hand goes on holding.
struct HeldInverse : Visit {
  HeldInverse()
      : port(free_port()), service({HLM_STAND_INS "/inverse_service", std::to_string(port)}) {
    REQUIRE(service.wait_for_error("listening", 5));
    begin({"--device", "haply", "--device-option", "address=" + loopback(port), "--device-option",
           "oldest=0.5"});
    move();
    expect("The force:");
  }

  int port;
  Process service;
};

TEST_CASE(
    "An Inverse3 in a hand passes by what was measured and felt, and its mass stays unknown") {
  HeldInverse visit;
  visit.answer("yes\nno\nright\n\nup\n");
  const json report = visit.finish(kNoProblem);
  INFO(report.dump(1));
  CHECK_THAT(words_on(report, kFrame, "frame"), ContainsSubstring("good"));
  for (const char* direction : {"right", "away", "up"}) {
    CHECK_THAT(words_on(report, kForce, direction), ContainsSubstring("good"));
  }
  CHECK_THAT(words_on(report, kForce, "mass"), ContainsSubstring("not known"));
  CHECK(visit.largest() == Approx(0.5));  // N
}

TEST_CASE("A doctor that is killed in a push leaves motors without force") {
  HeldInverse visit;
  visit.answer("yes\nno\n");
  REQUIRE(wait_until(10, [&] { return visit.motor() > 0.2; }));
  visit.doctor().send_signal(SIGKILL);
  CHECK(visit.time_until_off() < kUntilOff);
  std::this_thread::sleep_for(100ms);
  CHECK(visit.motor() == 0);
}

TEST_CASE(
    "A planar 2DIY passes with a direction skipped, in a world whose y points to the person") {
  Visit visit;
  Process board({HLM_STAND_INS "/diy_board", visit.file("port")});
  REQUIRE(wait_until(5, [&] { return access(visit.file("port").c_str(), F_OK) == 0; }));
  visit.begin({"--device", "haply2diy", "--device-option", "port=" + visit.file("port"),
               "--device-option", "oldest=0.5", "--device-option", "frame=x -y -z", "--world-axes",
               "Right near DOWN"});
  visit.move(0.03, false);
  visit.order("press 0");
  visit.allow_pushes("right\nnear\n");
  const json report = visit.finish(kNoProblem);
  INFO(report.dump(1));
  CHECK_THAT(words_on(report, kFrame, "frame"), ContainsSubstring("good"));
  CHECK_THAT(
      words_on(report, kForce, "right") + words_on(report, kForce, "near"),
      ContainsSubstring("near") && !ContainsSubstring("problem") && !ContainsSubstring("warning"));
  // Two pushes, and a machine with other work: what one is worth is in device_fits_test.cc.
  CHECK(number_of(report, kForce, "mass") == Approx(0.2).epsilon(0.6));  // kg
}

TEST_CASE(
    "A frame that is wrong by a quarter turn is named with the right one, and nothing pushes") {
  Visit visit;
  visit.begin(kSigma + Arguments{"--device-option", "frame=-y x z"});
  visit.move();
  const json report = visit.finish(kProblem);
  CHECK_THAT(words_on(report, kFrame, "frame"),
             ContainsSubstring("frame '-y x z' is wrong by 90°") &&
                 ContainsSubstring("--device-option \"frame=x y z\""));
  CHECK_THAT(words_on(report, kForce, "step"), ContainsSubstring("not tried"));
  CHECK(visit.largest() == 0);
}

TEST_CASE("A person who goes back to the middle between two movements is asked once more") {
  Visit visit;
  visit.begin(kSigma);
  visit.answer("\n");
  const auto hold = [&](const std::string& asked, const std::string& place) {
    visit.expect(asked);
    visit.order("hold " + place);
    std::this_thread::sleep_for(600ms);
    visit.answer("\n");
  };
  hold("5 cm to the right", "0.05 0 0");
  hold("5 cm away", "0 0.05 0");
  hold("It also went back from where it was", "0 0.1 0");
  hold("5 cm up", "0 0.1 0.05");
  visit.expect("The force:");
  visit.answer("no\n");
  const json report = visit.finish(kNotAll);
  INFO(report.dump(1));
  CHECK_THAT(words_on(report, kFrame, "frame"), ContainsSubstring("good: frame 'x y z' is right"));
}

TEST_CASE("Positions of a mirror are named, and nothing pushes") {
  Visit visit;
  visit.begin(kSigma);
  visit.order("reflect");
  visit.move();
  CHECK_THAT(words_on(visit.finish(kProblem), kFrame, "frame"), ContainsSubstring("of a mirror"));
  CHECK(visit.largest() == 0);
}

TEST_CASE("A force of the wrong sign is named after one small push each way") {
  Visit visit;
  visit.begin(kSigma);
  visit.move();
  visit.order("reverse");
  visit.allow_pushes("left\n");
  const json report = visit.finish(kProblem);
  CHECK_THAT(words_on(report, kForce, "right"),
             ContainsSubstring("problem") && ContainsSubstring("wrong sign"));
  CHECK(words_on(report, kForce, "away").empty());
}

/// A device with that fault, examined to the end.
json examined_with(const std::string& fault) {
  Visit visit;
  visit.begin(kSigma);
  visit.order(fault);
  std::this_thread::sleep_for(50ms);
  visit.move();
  visit.allow_pushes("right\naway\nup\n");
  return visit.finish(kNoProblem);
}

TEST_CASE("Motors that give half or three times the force are named by the mass") {
  const auto [fault, times] =
      GENERATE(table<std::string, std::string>({{"weak", "0.5"}, {"strong", "3"}}));
  const json report = examined_with(fault);
  INFO(report.dump(1));
  CHECK_THAT(words_on(report, kForce, "mass"),
             ContainsSubstring("warning") && ContainsSubstring("times what was commanded"));
}

TEST_CASE("One motor that gives 30 % is named, with both directions") {
  const json report = examined_with("one_weak");
  INFO(report.dump(1));
  CHECK_THAT(words_on(report, kForce, "axes"),
             ContainsSubstring("warning") && ContainsSubstring("kg right"));
}

TEST_CASE("Positions of another scale are named") {
  const json report = examined_with("scaled");
  INFO(report.dump(1));
  CHECK_THAT(words_on(report, kFrame, "scale"),
             ContainsSubstring("warning") && ContainsSubstring("75 mm"));
}

TEST_CASE("Speeds of another unit are named by a handle that is moved slowly") {
  Visit visit;
  visit.begin(kSigma + Arguments{"--device-option", "velocity-cutoff=0"});  // The library's own.
  visit.order("fast");
  visit.answer("\n");
  std::array<double, 3> p{};
  const std::array<const char*, 3> asked{"5 cm to the right", "5 cm away", "5 cm up"};
  for (std::size_t i = 0; i < 3; ++i) {
    visit.expect(asked[i]);
    for (int step = 0; step < 10; ++step) {
      p[i] += 0.005;  // m; in one step it would be a fault of the device.
      std::ostringstream place;
      place << "hold " << p[0] << ' ' << p[1] << ' ' << p[2];
      visit.order(place.str());
      std::this_thread::sleep_for(100ms);
    }
    std::this_thread::sleep_for(300ms);
    visit.answer("\n");
  }
  visit.expect("The force:");
  visit.answer("no\n");
  const json report = visit.finish(kNotAll);
  INFO(report.dump(1));
  CHECK_THAT(words_on(report, kFrame, "speed"),
             ContainsSubstring("warning") && ContainsSubstring("leads 2 times"));
}

TEST_CASE("A device of 200 Hz is named, and without the word yes its motors stay off") {
  Visit visit;
  visit.begin(kSigma);
  visit.order("slow");
  visit.move();
  visit.expect("The force:");
  visit.answer("y\n\n");
  visit.expect("Type yes or no.");
  visit.answer("NO\n");
  const json report = visit.finish(kNotAll);
  INFO(report.dump(1));
  CHECK_THAT(words_on(report, kExchange, "rate"), ContainsSubstring("warning"));
  CHECK(number_of(report, kExchange, "rate") == Approx(200).epsilon(0.1));  // Hz
  CHECK_THAT(words_on(report, kForce, "force"), ContainsSubstring("not allowed"));
  CHECK(visit.largest() == 0);
}

TEST_CASE("Noise of half a millimetre is named, and a frozen state is by a handle that is moved") {
  Visit visit;
  const char* const order = GENERATE("noisy", "freeze");
  visit.order(order);
  if (std::string(order) == "noisy") {
    const Finished finished =
        run({"sh", "-c", "exec \"$0\" \"$@\" </dev/null", HLM_DOCTOR, "device", "--json",
             "--server", loopback(free_port()), "--device", "forcedimension"});
    INFO(finished.output << finished.error);
    CHECK(finished.exit_code == kProblem);
    const json report = json::parse(finished.output);
    CHECK_THAT(words_on(report, kRest, "noise"),
               ContainsSubstring("problem: position at rest 0.5"));
  } else {
    visit.begin(kSigma);
    visit.answer("\n\n\n\n");
    CHECK_THAT(words_on(visit.finish(kProblem), kFrame, "ended"), ContainsSubstring("frozen"));
  }
  CHECK(visit.largest() == 0);
}

TEST_CASE("Ctrl-C, the end of answers and a fault in a push take the force off at once") {
  struct End {
    const char* by;
    int status;
    const char* words;
  };
  const auto end = GENERATE(End{"signal", kNotAll, "warning: ended by a signal: Interrupt"},
                            End{"answers", kNotAll, "warning: the answers ended"},
                            End{"error", kProblem, "problem: the controller reports an error"},
                            End{"force_off", kProblem, "problem: it was faster than its velocity"});
  Visit visit;
  visit.begin(kSigma);
  visit.move();
  visit.expect("The force:");  // The hand goes on holding the handle: a push lasts.
  visit.answer("yes\nno\n");
  REQUIRE(wait_until(10, [&] { return visit.motor() > 0.5; }));
  const std::string by = end.by;
  if (by == "signal") visit.doctor().send_signal(SIGINT);
  if (by == "answers") visit.end_answers();
  if (end.status == kProblem) visit.order(by);
  INFO(by);
  CHECK(visit.time_until_off() < kUntilOff);
  CHECK_THAT(words_on(visit.finish(end.status), kForce, "ended"), ContainsSubstring(end.words));
}

TEST_CASE(
    "Where the frame was not checked nothing pushes, and a report says with what it was made") {
  Visit visit;
  std::ofstream(visit.file("lines")) << "\nskip\nskip\nskip\nyes\nyes\nright\naway\n";
  const Finished finished = run({"sh", "-c", "exec \"$0\" \"$@\" <" + visit.file("lines"),
                                 HLM_DOCTOR, "device", "--json", "--server", loopback(free_port()),
                                 "--report", visit.file("report"), "--device-option", "delay=8"});
  INFO(finished.output << finished.error);
  CHECK(finished.exit_code == kNotAll);
  const json report = json::parse(finished.output);
  CHECK(report.at("complete") == false);
  CHECK_THAT(words_on(report, kFrame, "frame"), ContainsSubstring("warning: not checked"));
  CHECK_THAT(words_on(report, kForce, "step"), ContainsSubstring("warning: not tried"));
  CHECK_THAT(finished.error, !ContainsSubstring("The force:"));
  std::ostringstream text;
  text << std::ifstream(visit.file("report")).rdbuf();
  CHECK_THAT(text.str(), ContainsSubstring("haptic_doctor ") && ContainsSubstring("Linux ") &&
                             ContainsSubstring("delay = 8") &&
                             ContainsSubstring("No problem was found, but not all was checked."));
}

TEST_CASE("A port that is named and cannot be opened is the problem, not the list of ports") {
  const Finished finished =
      run({HLM_DOCTOR, "--check", "device", "--device", "haply2diy", "--server",
           loopback(free_port()), "--device-option", "port=/nowhere"});
  INFO(finished.output << finished.error);
  CHECK(finished.exit_code == kProblem);
  CHECK_THAT(finished.output, ContainsSubstring("/nowhere cannot be opened"));
}

TEST_CASE("A device that a server of an older version has is left alone") {
  const TemporaryDirectory directory;
  const protocol::UdpSocket port({0x7F000001, 0});
  const std::string listen = protocol::to_string(port.local());
  std::filesystem::create_directory(directory.file("haptic_server"));
  // Without a socket, and without what newer servers say of their recording.
  const json state{
      {"process", getpid()},
      {"written", 0},
      {"listen", listen},
      {"rate", 1000},
      {"session", false},
      {"silence", 0},
      {"update_rate", nullptr},
      {"age", 0},
      {"datagrams", 0},
      {"dropped", json::object()},
      {"force", 0},
      {"chain", json::array()},
      {"loop", {{"ticks", 0}, {"missed", 0}, {"lateness_p99", 0}, {"lateness_max", 0}}},
      {"device",
       {{"name", "an omega.3"},
        {"health", "good"},
        {"max_force", 12},
        {"halts", false},
        {"time_guard", nullptr}}}};
  std::ofstream(directory.file("haptic_server/") + listen + ".json") << state;
  const Finished finished = run(
      {"env", "XDG_RUNTIME_DIR=" + directory.file(""), HLM_DOCTOR, "device", "--server", listen});
  CHECK(finished.exit_code == 1);
  CHECK_THAT(finished.error, ContainsSubstring("runs and has an omega.3: end it first"));
}

TEST_CASE("The rules of udev are those of the packages, under two comments") {
  const Finished finished = run({HLM_DOCTOR, "device", "--udev"});
  CHECK(finished.exit_code == kNoProblem);
  std::ifstream packaged(HLM_UDEV_RULES);
  REQUIRE(packaged);
  const std::string rules(std::istreambuf_iterator<char>(packaged), {});
  REQUIRE_THAT(rules, ContainsSubstring("KERNEL=="));
  CHECK_THAT(finished.output,
             ContainsSubstring(rules) && ContainsSubstring("{idVendor}==\"1451\""));
  std::istringstream lines(finished.output);
  std::string place;
  std::string groups;
  std::getline(lines, place);
  std::getline(lines, groups);
  CHECK_THAT(place,
             Catch::Matchers::StartsWith("# Save as /etc/udev/rules.d/60-haptic_server.rules"));
  CHECK_THAT(groups, Catch::Matchers::StartsWith("# sudo groupadd") &&
                         ContainsSubstring("usermod -aG haptic,dialout"));
  for (std::string line; std::getline(lines, line);) {
    CHECK_THAT(line, ContainsSubstring("GROUP=") || Catch::Matchers::StartsWith("# "));
  }
}

TEST_CASE("What cannot be checked is refused in one line") {
  const auto refuses = [](const Arguments& options, int status, const std::string& words) {
    const Finished finished = run(Arguments{HLM_DOCTOR, "device"} + options);
    INFO(finished.error);
    CHECK(finished.exit_code == status);
    CHECK_THAT(finished.error, ContainsSubstring(words));
  };
  refuses({"--push", "2"}, 2, "0.05 to 1 N");
  const Finished elsewhere = run({HLM_DOCTOR, "--push", "0.5"});
  CHECK(elsewhere.exit_code == 2);
  CHECK_THAT(elsewhere.error, ContainsSubstring("--push goes with 'device' only"));
  CHECK_THAT(run({HLM_DOCTOR, "--udev"}).error,
             ContainsSubstring("--udev goes with 'device' only"));
  refuses({"--udev", "--json"}, 2, "--udev stands alone after 'device'");
  refuses({"--world-axes", "right away down"}, 2, "that are right-handed");
  refuses({"--report", "/nowhere/report"}, 2, "--report /nowhere/report cannot be written");
  refuses({"--check", "force"}, 2, "does not go with 'device'");
  const TemporaryDirectory directory;
  std::ofstream(directory.file("report")) << "of yesterday";
  refuses({"--device", "omega", "--report", directory.file("report")}, 2,
          "--device omega must be one of");
  std::ifstream report(directory.file("report"));
  CHECK(std::string(std::istreambuf_iterator<char>(report), {}) == "of yesterday");
}

}  // namespace
}  // namespace hlm::test
