#include "hlm/doctor/body_examination.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <utility>

#include <spdlog/fmt/fmt.h>

#include "hlm/protocol/codec.h"

namespace hlm::server {
namespace {

/// Of the updates that are whole.
std::set<std::uint32_t> reported_bodies(const RecordedSession& session) {
  std::set<std::uint32_t> bodies;
  for (const RecordedUpdate& recorded : session.updates) {
    protocol::ContactUpdate update;
    if (decode(recorded.parts, update)) continue;
    for (const MovableBody& body : update.bodies) bodies.insert(body.id);
  }
  return bodies;
}

}  // namespace

Examination examine_bodies(const RecordedSession& session) {
  std::map<std::pair<BodyDoubt, std::uint32_t>, std::size_t> doubts;
  for (const protocol::ProxyState& state : session.acknowledgements) {
    if (state.doubt != BodyDoubt::kNone) ++doubts[{state.doubt, state.doubted}];
  }
  std::vector<std::pair<std::size_t, Finding>> found;
  for (const auto& [doubt, count] : doubts) {
    found.push_back({count,
                     {Verdict::kProblem, "bodies",
                      fmt::format("body {}: {} (in {} of {} states)", doubt.second,
                                  meaning_of(doubt.first), count, session.acknowledgements.size()),
                      std::string(remedy_of(doubt.first))}});
  }
  std::ranges::stable_sort(found, std::ranges::greater(),
                           [](const auto& each) { return each.first; });
  std::vector<Finding> findings;
  for (auto& [count, finding] : found) findings.push_back(std::move(finding));
  const std::size_t bodies = reported_bodies(session).size();
  if (bodies == 0) {
    findings.push_back({Verdict::kNote, "bodies", "no update has a body that the tool can push",
                        "record a session in which the tool pushes, lifts and lets go of bodies"});
  } else if (findings.empty()) {
    findings.push_back({Verdict::kGood, "bodies",
                        fmt::format("{} bodies moved as their reports say, as far as the tool "
                                    "moved them",
                                    bodies),
                        ""});
  }
  return {fmt::format("Do bodies move as reported? (session {:016x} of the capture)", session.id),
          findings};
}

}  // namespace hlm::server
