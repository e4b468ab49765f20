#include "hlm/local_model/body_audit.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace hlm::server {
namespace {

/// Time constant in which votes fade, s.
constexpr double kMemory = 5;
/// Accelerations that tell something, m/s²: what the tool gives a body, and what else acts on it.
constexpr double kPushed = 0.5;
constexpr double kAccelerated = 2;
/// An error up to this share of what was to change the velocity is none, and one that an
/// explanation leaves up to this share of is explained.
constexpr double kNoError = 0.25;
constexpr double kExplained = 0.4;
constexpr double kTiny = 1e-9;  // m/s
/// Share of what it should have gained that a body may gain that stays as it was.
constexpr double kStays = 0.2;
/// Cosine of an error that gravity explains.
constexpr double kDown = 0.8;
/// Votes against a body that are enough, and the share of all, and of those, that the commonest
/// must have.
constexpr double kEnough = 5;
constexpr double kShare = 0.2;
constexpr double kCommonest = 0.6;
/// Time over which a way and a velocity are compared, s, and what a body must move in it, m: an
/// engine's steps may be longer than its frames.
constexpr double kWayTime = 0.1;
constexpr double kLeastWay = 0.002;
/// Share of a way that may go otherwise than the velocity says.
constexpr double kAstray = 0.4;
/// Votes against a velocity: a body that is put elsewhere makes one.
constexpr double kOnce = 0.5;
constexpr double kMoreThanOnce = 1.5;
/// A body that was not reported for so long is another one, s.
constexpr double kLongestAway = 0.5;

/// How a body takes the tool's impulses, of the factor by which it takes them.
BodyDoubt of_factor(double factor) noexcept {
  if (factor < -0.3) return BodyDoubt::kReversed;
  if (factor < 0.3) return BodyDoubt::kIgnored;
  // Up to 3 where friction holds it, as far as is known.
  if (factor > 1.7 && factor < 3) return BodyDoubt::kTwice;
  return BodyDoubt::kMass;
}

/// Of those that explain an error of the velocity.
constexpr std::size_t kFirst = static_cast<std::size_t>(BodyDoubt::kIgnored);

constexpr std::size_t at(BodyDoubt doubt) noexcept { return static_cast<std::size_t>(doubt); }

}  // namespace

void BodyAudit::begin(double time) noexcept {
  if (!(time > 0)) return;
  const double kept = std::exp(-time / kMemory);
  for (Record& record : records_) {
    record.away += time;
    record.kept_way *= kept;
    for (double& votes : record.votes) votes *= kept;
  }
  erase_if(records_, [](const Record& record) { return record.away > kLongestAway; });
}

BodyAudit::Record& BodyAudit::of(std::uint32_t body) noexcept {
  const auto known = std::ranges::find(records_, body, &Record::id);
  if (known != records_.end()) return *known;
  Record fresh;
  fresh.id = body;
  if (records_.size() < records_.capacity()) return records_.emplace_back(fresh);
  Record& oldest = *std::ranges::max_element(records_, {}, &Record::away);
  oldest = fresh;
  return oldest;
}

std::optional<BodyDoubt> BodyAudit::vote(const BodyEvidence& e) noexcept {
  const double given = e.given_W.norm();
  const bool pushed = given > kPushed * e.time;
  const double error = e.error_W.norm();
  if (error < std::max(kNoError * given, kPushed * e.time)) {
    return pushed ? std::optional(BodyDoubt::kNone) : std::nullopt;
  }
  // Springs pull otherwise before the next report.
  if (e.time * e.A_change_W.norm() > kNoError * error) return std::nullopt;
  const Vector3 by_A = e.time * e.A_W;
  const double g = e.gravity_W.norm();
  const bool lacks_gravity = by_A.norm() <= kAccelerated * e.time && g > kAccelerated;
  if (lacks_gravity && !e.jointed && e.error_W.dot(e.gravity_W) > kDown * error * g) {
    return BodyDoubt::kGravity;
  }
  if (!pushed) {
    if (e.jointed) return std::nullopt;
    const bool stays = (e.error_W + by_A).norm() < kExplained * by_A.norm() &&
                       e.change_W.norm() < kStays * by_A.norm();
    return stays && by_A.norm() > kAccelerated * e.time ? std::optional(BodyDoubt::kSupport)
                                                        : std::nullopt;
  }
  const Vector3 way = e.given_W / given;
  const double along = e.error_W.dot(way);
  if ((e.error_W - along * way).norm() > kExplained * error) return std::nullopt;
  if (along > 0) return of_factor(1 + along / given);
  // What holds a joint, nobody says.
  if (e.jointed && -along < given) return std::nullopt;
  // Friction and supports take a part of what was given, from what was expected too.
  const double gained = e.change_W.dot(way);
  if (std::abs(gained) < kStays * -along) {
    return e.jointed ? std::nullopt : std::optional(BodyDoubt::kIgnored);
  }
  const double less = gained - by_A.dot(way);
  return of_factor(less / std::max(less - along, kTiny));
}

/// A blow changes the velocity at any time in between; a body that is put elsewhere makes one vote.
void BodyAudit::judge_way(const BodyEvidence& e, Record& record) noexcept {
  record.time += e.time;
  record.moved_W += e.moved_W;
  record.expected_W += e.time * e.V_W;
  record.unknown += e.time * e.change_W.norm() / 2;
  if (record.time < kWayTime) return;
  const double way = record.moved_W.norm();
  const double along = record.expected_W.dot(record.moved_W) / std::max(way, kTiny);
  const double astray = way - along - record.unknown;
  if (way > kLeastWay) {
    ++(astray > kAstray * way ? record.votes[at(BodyDoubt::kVelocity)] : record.kept_way);
  }
  record.time = record.unknown = 0;
  record.moved_W.setZero();
  record.expected_W.setZero();
}

void BodyAudit::add(const BodyEvidence& e) noexcept {
  if (!(e.time > 0)) return;
  Record& record = of(e.id);
  record.away = 0;
  judge_way(e, record);
  if (const auto doubt = vote(e)) ++record.votes[at(*doubt)];
}

BodyDoubt BodyAudit::judge(const Record& record) noexcept {
  const double astray = record.votes[at(BodyDoubt::kVelocity)];
  // With a wrong velocity all that is expected is wrong.
  if (astray > std::max(record.kept_way, kOnce)) {
    return astray > kMoreThanOnce ? BodyDoubt::kVelocity : BodyDoubt::kNone;
  }
  const auto& votes = record.votes;
  const double against = std::accumulate(votes.begin() + kFirst, votes.end(), 0.0);
  if (against < kEnough || against < kShare * (against + votes[0])) return BodyDoubt::kNone;
  // What nothing bears, as far as is known, does not give way to the tool either.
  if (votes[at(BodyDoubt::kSupport)] >= kEnough) return BodyDoubt::kSupport;
  const auto commonest = std::max_element(votes.begin() + kFirst, votes.end());
  if (*commonest < kCommonest * against) return BodyDoubt::kNone;
  return static_cast<BodyDoubt>(commonest - votes.begin());
}

BodyDoubt BodyAudit::doubt(std::uint32_t body) const noexcept {
  const auto known = std::ranges::find(records_, body, &Record::id);
  return known == records_.end() ? BodyDoubt::kNone : judge(*known);
}

BodyAudit::Finding BodyAudit::finding() const noexcept {
  Finding worst;
  double most = 0;
  for (const Record& record : records_) {
    const BodyDoubt doubt = judge(record);
    if (doubt == BodyDoubt::kNone || 1 + record.votes[at(doubt)] <= most) continue;
    most = 1 + record.votes[at(doubt)];
    worst = {doubt, record.id};
  }
  return worst;
}

}  // namespace hlm::server
