#include "hlm/tools/doctor/force_examination.h"

#include <algorithm>
#include <map>
#include <span>

#include <spdlog/fmt/fmt.h>

#include "hlm/protocol/codec.h"
#include "hlm/protocol/nanoseconds.h"

namespace hlm::server {
namespace {

constexpr const char* kQuestion = "Why do I feel nothing?";
constexpr double kBarelyFelt = 0.1;  // N.

bool is_in_session(const ChainLink& link) { return link.name != "session" || link.value != "none"; }

/// How bad it is that this link stops the force. Without a session, or without a hand, nothing is
/// broken.
Verdict verdict_on(const ChainLink& link, double force) {
  if (link.name == "hand" || !is_in_session(link)) return Verdict::kNote;
  if (link.name == "limiter" && link.value != "fade" && force >= kBarelyFelt)
    return Verdict::kWarning;
  return Verdict::kProblem;
}

std::string one_line(std::string value) {
  std::replace(value.begin(), value.end(), '\n', ' ');
  return value;
}

/// The links up to the one that stops the force, that one judged, and those behind it as they are.
std::vector<Finding> findings_on(std::span<const ChainLink> chain, double force) {
  std::vector<Finding> findings;
  const ChainLink* stop = nullptr;
  for (const ChainLink& link : chain) {
    Finding finding{stop == nullptr ? Verdict::kGood : Verdict::kNote, link.name,
                    one_line(link.value), ""};
    if (stop == nullptr && !link.reason.empty()) {
      stop = &link;
      finding.verdict = verdict_on(link, force);
      finding.text += ": " + link.reason;
    }
    findings.push_back(std::move(finding));
    if (stop != nullptr && !is_in_session(*stop)) return findings;
  }
  findings.push_back(stop != nullptr
                         ? Finding{Verdict::kNote, "so", "the force stops at " + stop->name, ""}
                         : Finding{Verdict::kGood, "so", "the force reaches the hand", ""});
  return findings;
}

double seconds(std::int64_t nanoseconds) { return 1e-9 * static_cast<double>(nanoseconds); }

/// What is known of a recorded session from the states that its server sent.
class RecordedFacts {
 public:
  explicit RecordedFacts(const RecordedSession& session) : session_(session) {
    tuning_ = session.welcome.tuning;
    for (const auto& [sequence, bytes] : session.controls) {
      protocol::Control control;
      if (!decode(protocol::view(bytes), control) && control.tuned) tuning_ = control.tuning;
    }
  }

  ForceFacts at(const protocol::ProxyState& state) const {
    ForceFacts facts;
    facts.session = true;
    facts.server = state.server;
    facts.fault = state.fault;
    facts.update_rate = update_rate();
    facts.least_update_rate = session_.welcome.least_update_rate;
    facts.age = state.age;
    facts.p_WD = state.X_WD.p;
    if (state.hand_measured) facts.F_hand = state.F_hand.head<3>();
    facts.uses_contacts = traits(tuning_.controller).uses_contacts;
    facts.active = state.active_contacts;
    facts.reported = facts.active + state.predicted_contacts;
    facts.epsilon = session_.hello.epsilon;
    facts.smallest_separation = state.smallest_separation;
    facts.stiffness = tuning_.stiffness;
    facts.F_env = state.F_env.head<3>();
    facts.F_command = state.F_command.head<3>();
    facts.limit = state.limit;
    return facts;
  }

 private:
  /// Mean of the session, Hz; empty for a session too short to tell.
  std::optional<double> update_rate() const {
    const auto& updates = session_.updates;
    if (updates.size() < 2) return std::nullopt;
    const double time = seconds(updates.back().time_ns - updates.front().time_ns);
    if (time < 0.5) return std::nullopt;
    return static_cast<double>(updates.size() - 1) / time;
  }

  const RecordedSession& session_;
  Tuning tuning_;  ///< The latest in effect.
};

}  // namespace

Examination examine_force(const std::optional<RunningServer>& running, const std::string& server) {
  if (!running) {
    return {kQuestion,
            {{Verdict::kNote, "unknown",
              "no state of a haptic_server at " + server + " can be read on this machine",
              "run haptic_doctor where haptic_server runs, as the same user or as root, or give it "
              "a capture: haptic_doctor run.pcap"}}};
  }
  if (running->stands_still()) {
    return {kQuestion,
            {{Verdict::kProblem, "server",
              fmt::format("haptic_server (process {}) stands still: its state is {:.0f} s old",
                          running->process, running->age),
              "see what stopped it, or restart it"}}};
  }
  return {kQuestion, findings_on(running->chain, running->force)};
}

Examination examine_force(const RecordedSession& session) {
  Examination examination{fmt::format("{} (session {:016x} of the capture)", kQuestion, session.id),
                          {}};
  if (session.acknowledgements.empty()) {
    const bool sent = !session.updates.empty();
    examination.findings = {
        {Verdict::kProblem, "updates",
         sent ? "the client sent contacts, but the server never acknowledged any"
              : "the client sent no contacts after it got its session",
         sent ? "see the counts of dropped datagrams on haptic_server's status line"
              : "see the client's log"}};
    return examination;
  }
  const RecordedFacts facts(session);
  std::map<std::string, std::size_t> stops;
  std::map<std::string, protocol::ProxyState> examples;
  for (const protocol::ProxyState& state : session.acknowledgements) {
    const ForceChain chain = force_chain(facts.at(state));
    const ChainLink* const stop = first_stop(chain);
    const std::string name = stop == nullptr ? "" : stop->name;
    ++stops[name];
    examples[name] = state;
  }
  const auto most = std::max_element(
      stops.begin(), stops.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  const protocol::ProxyState& example = examples.at(most->first);
  const ForceChain chain = force_chain(facts.at(example));
  examination.findings = findings_on(chain, example.F_command.head<3>().norm());
  std::string shares;
  for (const auto& [name, count] : stops) {
    const double share =
        100.0 * static_cast<double>(count) / static_cast<double>(session.acknowledgements.size());
    shares += fmt::format("{}in {:.0f} % of the states {}", shares.empty() ? "" : ", ", share,
                          name.empty() ? "nowhere" : "at " + name);
  }
  examination.findings.push_back({Verdict::kNote, "stops", shares, ""});
  return examination;
}

}  // namespace hlm::server
