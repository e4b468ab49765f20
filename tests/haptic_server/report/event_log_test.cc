// Does the log say what changed, and when?
#include "hlm/haptic_server/report/event_log.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include <spdlog/sinks/base_sink.h>
#include <spdlog/spdlog.h>

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;

struct LogLine {
  double age = 0;  ///< When it was written, s.
  std::string text;
};

class LogSink : public spdlog::sinks::base_sink<spdlog::details::null_mutex> {
 public:
  std::vector<LogLine> lines;

 private:
  void sink_it_(const spdlog::details::log_msg& message) override {
    const std::chrono::duration<double> age = spdlog::log_clock::now() - message.time;
    lines.push_back({age.count(), std::string(message.payload.data(), message.payload.size())});
  }
  void flush_() override {}
};

/// Takes what is logged in its life.
class CapturedLog {
 public:
  CapturedLog() : before_(spdlog::default_logger()) {
    spdlog::set_default_logger(std::make_shared<spdlog::logger>("test", sink_));
  }
  ~CapturedLog() { spdlog::set_default_logger(before_); }
  CapturedLog(const CapturedLog&) = delete;
  CapturedLog& operator=(const CapturedLog&) = delete;

  const std::vector<LogLine>& lines() const { return sink_->lines; }

 private:
  std::shared_ptr<spdlog::logger> before_;
  std::shared_ptr<LogSink> sink_ = std::make_shared<LogSink>();
};

constexpr double kReadAt = 100;  // s since the server started.
constexpr double kAgeTolerance =
    10;  // s: a machine that stands still between the line and its reading.

TEST_CASE("A line has the time of the tick that it tells of, however late it is written") {
  const CapturedLog log;
  EventLog events([] { return kReadAt; });
  TickRecord record;
  record.session = 7;
  record.session_open = true;
  for (const auto& [time, state] : {std::pair{40.0, ServerState::kRamping},
                                    {60.0, ServerState::kActive},
                                    {80.0, ServerState::kFault}}) {
    record.time = time;
    record.server = state;
    events.observe(record);
  }
  REQUIRE(log.lines().size() == 4);
  CHECK_THAT(log.lines()[0].text, ContainsSubstring("session 0000000000000007 begins"));
  CHECK_THAT(log.lines()[1].text, ContainsSubstring("force rises"));
  CHECK_THAT(log.lines()[2].text, ContainsSubstring("force is on"));
  CHECK_THAT(log.lines()[3].text, ContainsSubstring("fault: "));
  CHECK_THAT(log.lines()[1].age, WithinAbs(60, kAgeTolerance));
  CHECK_THAT(log.lines()[2].age, WithinAbs(40, kAgeTolerance));
  CHECK_THAT(log.lines()[3].age, WithinAbs(20, kAgeTolerance));
}

TEST_CASE("Dropped datagrams are told with the time of their tick") {
  const CapturedLog log;
  EventLog drops([] { return kReadAt; });
  TickRecord record;
  record.time = 50;
  record.dropped_for[static_cast<std::size_t>(protocol::kFirstSealingReason)] = 3;
  drops.observe(record);
  REQUIRE(log.lines().size() == 1);
  CHECK_THAT(log.lines()[0].text, ContainsSubstring("dropped datagrams: 3 "));
  CHECK_THAT(log.lines()[0].age, WithinAbs(50, kAgeTolerance));
}

TEST_CASE("Each reason for a drop is told with its count, at most once a second") {
  const CapturedLog log;
  EventLog drops([] { return kReadAt; });
  TickRecord record;
  const auto drop = [&](protocol::DropReason reason, std::uint64_t count) {
    record.dropped_for[static_cast<std::size_t>(reason)] += count;
  };
  for (int tick = 0; tick < 2500; ++tick) {
    record.time = 1e-3 * tick;  // s
    drop(protocol::DropReason::kMalformed, 1);
    drop(protocol::DropReason::kNonFinite, 2);
    drop(protocol::DropReason::kForeignSession, 3);
    drop(protocol::DropReason::kStale, 1);
    drops.observe(record);
  }
  REQUIRE(log.lines().size() == 3);
  CHECK_THAT(log.lines()[1].text,
             ContainsSubstring("1000 malformed (") && ContainsSubstring("2000 non-finite (") &&
                 ContainsSubstring("3000 foreign session (") && !ContainsSubstring("stale"));
}

TEST_CASE("A scene that comes into force, and one that takes too long, are told") {
  const CapturedLog log;
  EventLog events([] { return kReadAt; });
  TickRecord record;
  record.server = ServerState::kActive;
  record.session_open = true;
  record.session = 1;
  events.observe(record);
  const std::size_t before = log.lines().size();
  record.scene = 3;
  record.placements = 2;
  record.pieces = 14;
  for (int i = 0; i < 3; ++i) events.observe(record);
  record.scene = 0;
  record.time = 2;  // s
  for (int i = 0; i < 3; ++i) events.observe(record);
  REQUIRE(log.lines().size() == before + 2);
  CHECK_THAT(log.lines()[before].text, ContainsSubstring("scene 3: 2 placements, 14 pieces"));
  CHECK_THAT(log.lines()[before + 1].text, ContainsSubstring("took more time than a tick has"));
}

TEST_CASE("Scenes that come each millisecond have a line a second, and the last has one") {
  const CapturedLog log;
  EventLog events([] { return kReadAt; });
  TickRecord record;
  record.server = ServerState::kActive;
  record.session_open = true;
  record.session = 1;
  events.observe(record);
  const std::size_t before = log.lines().size();
  for (int tick = 0; tick < 5000; ++tick) {
    record.time = 1e-3 * tick;  // s
    record.scene = static_cast<std::uint32_t>(std::min(tick, 2500));
    events.observe(record);
  }
  CHECK(log.lines().size() == before + 4);
  CHECK_THAT(log.lines().back().text, ContainsSubstring("scene 2500: "));
}

TEST_CASE("Where every update is refused the log says so, with the reason, once a second") {
  const CapturedLog log;
  EventLog events([] { return kReadAt; });
  TickRecord record;
  record.session = 7;
  record.session_open = true;
  record.server = GENERATE(ServerState::kArming, ServerState::kActive);
  events.observe(record);
  if (record.server == ServerState::kActive) record.server = ServerState::kFading;
  record.fade = Fade::kUpdatesInvalid;
  record.refusal = meaning_of(UpdateError::kNonFinite);
  for (int tick = 0; tick < 1000; ++tick) {
    record.time = 1 + 1e-3 * tick;  // s
    record.fade = tick % 2 == 0 ? Fade::kUpdatesInvalid : Fade::kNone;
    events.observe(record);
  }
  int told = 0;
  for (const LogLine& line : log.lines()) {
    CAPTURE(line.text);
    if (line.text.find("refused: a number is not finite") != std::string::npos) ++told;
  }
  CHECK(told >= 1);
  CHECK(told <= 2);
}

}  // namespace
}  // namespace hlm::server
