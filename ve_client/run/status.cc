#include "hlm/ve_client/run/status.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include <spdlog/spdlog.h>

namespace hlm::ve {
namespace {

constexpr const char* kAfterFault =
    "a fault keeps its force off until a person asks for a new session: run haptic_doctor clear at "
    "the server where its log says so, then restart ve_client, or press Reset on its page if that "
    "shows this tool";

}  // namespace

void Connection::watch(double now, const HapticClient::Inbox& inbox, bool connected) {
  if (inbox.lost) spdlog::warn("session with {} lost; asking for a new one", server_);
  if (inbox.welcomed) {
    spdlog::info("session with {} began", server_);
    ever_connected_ = true;
    rejected_.clear();
    latest_reject_.reset();
  }
  if (connected) {
    next_message_ = now + kPatience;
    pause_ = kFirstPause;
    return;
  }
  if (inbox.reject) {
    const std::string before = std::exchange(rejected_, judge(*inbox.reject));
    if (rejected_ != before) next_message_ = now;
  }
  if (!ever_connected_ && timeout_ > 0 && now > timeout_) {
    give_up(fmt::format("within {} s (--connect-timeout)", timeout_));
  }
  say_what_is_awaited(now);
}

void Connection::end(double now) const {
  if (!ever_connected_) give_up(fmt::format("in {:.1f} s", now));
}

void Connection::give_up(const std::string& when) const {
  throw NeverAnswered("server " + server_ + ' ' +
                      (rejected_.empty() ? "has not answered " + when + ": " + reasons_for_silence()
                                         : "granted no session " + when + ": " + rejected_));
}

void Connection::say_what_is_awaited(double now) {
  if (now < next_message_) return;
  spdlog::warn("waiting for server {}: {}", server_,
               rejected_.empty() ? "it does not answer: " + reasons_for_silence() : rejected_);
  next_message_ = now + pause_;
  pause_ = std::min(2 * pause_, kLongestPause);
}

std::string Connection::reasons_for_silence() const {
  const std::string key = key_file_.empty()
                              ? "it has a key, which --key-file must name here too"
                              : "its key is not that of " + key_file_ + ", or it has none";
  return "haptic_server does not run there, the network is in the way, or " + key;
}

std::string Connection::judge(const protocol::Reject& reject) {
  const std::string text(reject.text.begin(), reject.text.end());
  const bool repeated = std::exchange(latest_reject_, reject.reason) == reject.reason;
  const auto end_if_repeated = [&](const std::string& why) {
    if (repeated) throw std::runtime_error(why);
    return rejected_;
  };
  switch (reject.reason) {
    case protocol::RejectReason::kVersion:
      return end_if_repeated(fmt::format(
          "server {} speaks version {} of the protocol, this client version {}; both must be equal",
          server_, reject.version, protocol::kProtocolVersion));
    case protocol::RejectReason::kTool:
      if (tool_may_change_) {
        return "it cannot use the tool: " + text + "; choose another scene on the page";
      }
      return end_if_repeated("server " + server_ + " cannot use the tool: " + text);
    case protocol::RejectReason::kBusy:
      return "it is busy with another client";  // It may be free later.
    case protocol::RejectReason::kFault:
      return kAfterFault;
  }
  return "it refuses for a reason that this version does not know";
}

void warn_of_mismatch(const ToolAssembly& tool, const protocol::DeviceReport& device) {
  ToolModel model(tool.description);
  model.set_configuration(tool.q);
  const Freedoms missing = missing_freedoms(model, device.freedoms);
  if (missing == 0) return;
  spdlog::warn(
      "{}; start haptic_server with one that does, for example --device-option freedom=spatial",
      describe_mismatch(missing));
}

std::string describe(const protocol::Refusal& refusal) {
  const std::string_view why = meaning_of(refusal.error);
  if (refusal.whole) {
    return fmt::format("the server refuses updates, {} so far: item {}: {}", refusal.count,
                       refusal.item, why);
  }
  return fmt::format("the server leaves out contact {}: {}", refusal.item, why);
}

void Status::count(const FrameResult& frame) {
  ++frames_;
  found_ = frame.found;
  active_ = frame.active;
  predicted_ = frame.predicted;
  if (frame.state_refused) ++refused_;
  if (frame.inbox.refusal) refusal_ = frame.inbox.refusal;
  if (frame.inbox.welcomed || frame.inbox.lost) fault_ = Fault::kNone;
  if (frame.inbox.state == nullptr) return;
  const Fault before = std::exchange(fault_, frame.inbox.state->fault);
  if (fault_ == before || fault_ == Fault::kNone) return;
  spdlog::error("{}fault of the server: {}; {}", prefix_, meaning_of(fault_), kAfterFault);
}

std::string Status::connection(const HapticClient& client) const {
  if (!client.connected()) return "no session";
  return fault_ == Fault::kNone ? "connected" : fmt::format("fault {}, no force", name_of(fault_));
}

void Status::report(double now, const HapticClient& client, const ProximityStatistics& proximity) {
  constexpr double kReportPeriod = 1;  // s.
  if (now - last_report_ < kReportPeriod) return;
  spdlog::info(
      "{}{:.1f} Hz | contacts {} active, {} predicted of {} found | round trip {:.2f} ms | {} | {}",
      prefix_, frames_ / (now - last_report_), active_, predicted_, found_,
      1e3 * client.round_trip(), connection(client),
      protocol::describe_drops(client.statistics().dropped));
  if (refusal_) spdlog::warn("{}{}", prefix_, describe(*refusal_));
  refusal_.reset();
  if (refused_ > warned_refused_)
    spdlog::warn("{}{} proxy states could not be followed", prefix_, refused_);
  if (proximity.failures > warned_failures_) {
    spdlog::warn("{}{} of {} proximity queries failed", prefix_, proximity.failures,
                 proximity.queries);
  }
  warned_refused_ = refused_;
  warned_failures_ = proximity.failures;
  last_report_ = now;
  frames_ = 0;
}

}  // namespace hlm::ve
