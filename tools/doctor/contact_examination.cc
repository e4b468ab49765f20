#include "hlm/tools/doctor/contact_examination.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/QR>
#include <spdlog/fmt/fmt.h>

#include "hlm/protocol/codec.h"

namespace hlm::server {
namespace {

/// Shares of contacts above which something is odd, and above which it is wrong.
constexpr double kOdd = 0.005;
constexpr double kWrong = 0.05;
/// Share of the contacts that appear: corners of edges do so late with good reason.
constexpr double kOddLate = 0.6;
/// Share of the error that contacts of another age leave, and of the motion that it must be to
/// tell.
constexpr double kSameAge = 0.3;
constexpr double kOff = 1e-3;
/// Angle of normals that are wrong, degrees, and share of the error that they explain.
constexpr double kTilted = 3;
constexpr double kByTilt = 0.6;
/// Fewer tell nothing.
constexpr std::uint64_t kEnough = 20;

double share(std::uint64_t part, std::uint64_t of) {
  return of > 0 ? static_cast<double>(part) / static_cast<double>(of) : 0;
}

Verdict verdict_on(double share) {
  return share > kWrong ? Verdict::kProblem : share > kOdd ? Verdict::kWarning : Verdict::kGood;
}

/// A finding where it is odd.
void judge(std::vector<Finding>& findings, double share, const char* subject,
           const std::string& text, const char* advice) {
  const Verdict verdict = verdict_on(share);
  if (verdict == Verdict::kGood) return;
  findings.push_back({verdict, subject, fmt::format("{:.3g} % {}", 100 * share, text), advice});
}

void judge_prediction(std::vector<Finding>& findings, const ContactCounts& counts, double epsilon) {
  if (epsilon == 0) return;
  if (counts.predicted == 0) {
    findings.push_back(
        {Verdict::kProblem, "prediction",
         fmt::format("nothing is sent before it touches, though epsilon is {:g} mm", 1e3 * epsilon),
         "ask the engine for contacts within epsilon: margin, breaking threshold, contact offset"});
  } else if (share(counts.late, counts.appeared) > kOddLate) {
    findings.push_back(
        {Verdict::kWarning, "prediction",
         fmt::format("{:.3g} % of the contacts are first seen later than epsilon, {:g} mm, allows; "
                     "none from farther than {:.2g} mm",
                     100 * share(counts.late, counts.appeared), 1e3 * epsilon,
                     1e3 * counts.seen_from),
         "send contacts from epsilon on, with their true separation: add the engine's margin"});
  }
}

/// Contacts of an earlier configuration change as the tool moved then.
void judge_age(std::vector<Finding>& findings, const ContactCounts& counts) {
  const auto& off = counts.off_by_age;
  const auto least = std::min_element(off.begin(), off.end());
  if (least == off.begin() || *least > kSameAge * off[0] || off[0] < kOff * counts.motion2) return;
  findings.push_back(
      {Verdict::kProblem, "age",
       fmt::format("separations change as the tool moved {} updates before", least - off.begin()),
       "find the contacts for the configuration that is sampled, after the step"});
}

/// Along a surface a separation does not change, unless the normal is not the surface's.
void judge_tilt(std::vector<Finding>& findings, const ContactCounts& counts) {
  const Vector3 tilt = counts.ways.completeOrthogonalDecomposition().solve(counts.off_along);
  const double angle = std::atan(tilt.norm()) * 180 / std::numbers::pi;
  if (!(angle > kTilted) || tilt.dot(counts.off_along) < kByTilt * counts.off2) return;
  findings.push_back({Verdict::kProblem, "normal",
                      fmt::format("separations change along the surface as if normals were {:.2g} "
                                  "degrees off",
                                  angle),
                      "send the normal of the contact, not of an edge, a triangle nearby or a "
                      "rounded one; in double precision"});
}

}  // namespace

std::vector<Finding> findings_on(const ContactCounts& counts, double epsilon) {
  std::vector<Finding> findings;
  if (counts.contacts < kEnough) {
    return {{Verdict::kNote, "contacts",
             fmt::format("{} contacts of the tool in {} updates are too few to tell",
                         counts.contacts, counts.updates),
             "record a session in which the tool touches, slides and leaves"}};
  }
  const std::uint64_t followed = counts.kept + counts.wandered + counts.flipped;
  judge(findings, share(counts.far, counts.contacts), "units",
        "of the contacts are farther from the tool than it is large",
        "give lengths in metres, and contacts for the configuration that is sampled");
  judge(findings, share(counts.frozen, counts.moved), "age",
        "of the contacts of a tool that moves are sent again as they were",
        "find the contacts in every frame, for the configuration that is sampled");
  judge_age(findings, counts);
  judge(findings, share(counts.duplicates, counts.contacts), "identity",
        "of the contacts share the identity of another one, and are lost",
        "an identity is of one contact: not of the pair of geoms, but of the pair of features");
  judge(findings, share(counts.flipped, followed), "normal",
        "of the contacts have a normal that turned round since the update before",
        "let normals point to the tool (side a), whichever body the engine lists first");
  judge(findings, share(counts.reversed, counts.moved), "normal",
        "of the separations fall when the tool moves along the normal",
        "let normals point to the tool (side a)");
  judge(
      findings, share(counts.wandered, followed), "identity",
      "of the identities were at another place an update before",
      "do not use the index in the engine's list; track contacts: haptic_track(), IdentityTracker");
  judge(findings, share(counts.renamed, followed + counts.renamed), "identity",
        "of the contacts go on under another identity, and begin anew with it",
        "derive identities from features, or track contacts: haptic_track(), IdentityTracker");
  judge_tilt(findings, counts);
  judge_prediction(findings, counts, epsilon);
  judge(findings, share(counts.vanished, counts.contacts), "missing",
        "of the contacts are left out of an update while their place is still near",
        "send all corners of a face, and no fewer when the tool moves");
  judge(findings, share(counts.jumped, counts.kept), "separation",
        fmt::format("of the separations change otherwise than the tool moves, by up to {:.2g} mm",
                    1e3 * counts.largest_jump),
        "send the true separation for the sampled configuration, and the point's velocity");
  std::ranges::stable_sort(findings, std::ranges::greater(), &Finding::verdict);
  if (findings.empty()) {
    findings.push_back({Verdict::kGood, "contacts",
                        fmt::format("{} contacts in {} updates change as the tool moves, the first "
                                    "from {:.2g} mm on",
                                    counts.contacts, counts.updates, 1e3 * counts.seen_from),
                        ""});
  }
  return findings;
}

Examination examine_contacts(const RecordedSession& session) {
  const double epsilon = session.hello.epsilon;
  ContactAudit audit(session.hello.tool, epsilon);
  for (const RecordedUpdate& recorded : session.updates) {
    protocol::ContactUpdate update;
    const auto dof = session.hello.tool.dof();
    if (decode(recorded.parts, update) || update.v_VE.size() != dof ||
        update.q_VE.size() != session.hello.tool.configuration_size()) {
      continue;
    }
    audit.add(update);
  }
  return {fmt::format("Can the contacts be trusted? (session {:016x} of the capture)", session.id),
          findings_on(audit.counts(), epsilon)};
}

}  // namespace hlm::server
