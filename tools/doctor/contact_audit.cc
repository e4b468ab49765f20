#include "hlm/tools/doctor/contact_audit.h"

#include <algorithm>
#include <cmath>

namespace hlm::server {
namespace {

/// Longest time between two updates that are compared, s.
constexpr double kGap = 0.25;
/// A contact goes on if its point on the tool stays within this, m, and half of its travel.
constexpr double kSamePlace = 0.003;
/// Further than this, m, and twice its travel, and it is another place.
constexpr double kOtherPlace = 0.005;
/// cos of the angle within which normals are the same: 18°.
constexpr double kSameNormal = 0.95;
/// Motion along the normal that tells whether a separation follows it, m.
constexpr double kNoticeable = 2e-4;
/// What a separation may be off by what the motion says, m, and as a part of the travel.
constexpr double kJump = 5e-4;
constexpr double kJumpShare = 0.25;
/// What is unknown of a body's motion between two updates after a blow, at most, m.
constexpr double kBlow = 5e-3;
/// How late a contact may be seen: this share of epsilon, or at most this distance, m.
constexpr double kLate = 1e-3;
/// A point farther from its link's origin than this many lengths of the tool, and this, m, is of
/// another unit.
constexpr double kLengths = 20;
constexpr double kFar = 2;

/// Contacts that one may go on as the other.
bool same_sides(const ReportedContact& a, const ReportedContact& b) {
  return a.a.index == b.a.index && a.b.index == b.b.index &&
         (a.b.kind == SideKind::kToolLink) == (b.b.kind == SideKind::kToolLink);
}

/// How much farther away a contact may be for a body that changed its velocity between two updates,
/// at any time, by this much, m.
double blow(double change, double dt) { return std::max(0.0, change * dt); }

}  // namespace

Vector3 ContactAudit::tool_point(const Seen& seen) const {
  return tool_.X_WL(static_cast<int>(seen.contact.a.index)) * seen.p_A;
}

std::vector<ContactAudit::Seen> ContactAudit::see(const protocol::ContactUpdate& update) {
  std::vector<Seen> seen;
  tool_.set_configuration(update.q_VE);
  for (const ReportedContact& contact : update.contacts) {
    const bool of_tool = contact.a.kind == SideKind::kToolLink &&
                         contact.a.index < static_cast<std::uint32_t>(tool_.links());
    if (!of_tool) continue;
    ++counts_.contacts;
    counts_.predicted += contact.separation > 0;
    counts_.seen_from = std::max(counts_.seen_from, contact.separation);
    const auto same = [&](const Seen& other) { return other.contact.identity == contact.identity; };
    if (std::ranges::any_of(seen, same)) {
      ++counts_.duplicates;
      continue;
    }
    const int link = static_cast<int>(contact.a.index);
    const Vector3 p_W = contact.p_WC + contact.separation * contact.n_W;
    Seen& one = seen.emplace_back();
    one.contact = contact;
    one.p_A = tool_.X_WL(link).inverse() * p_W;
    counts_.far += one.p_A.norm() > std::max(kFar, kLengths * tool_.description().length);
    const Vector3 v = tool_.point_jacobian(link, p_W).lazyProduct(update.v_VE);
    one.v_n = contact.n_W.dot(v - contact.v_WC);
  }
  return seen;
}

double ContactAudit::v_n_with(const Seen& seen, const MovableBodies& bodies) {
  const ReportedContact& contact = seen.contact;
  if (contact.b.kind != SideKind::kMovableBody) return seen.v_n;
  const auto body = std::ranges::find(bodies, contact.b.index, &MovableBody::id);
  if (body == bodies.end()) return -seen.v_n;
  const Vector3 arm = contact.p_WC - body->p_WCom;
  const Vector3 v_W = body->V_W.head<3>() + Vector3(body->V_W.tail<3>()).cross(arm);
  return seen.v_n - contact.n_W.dot(v_W - contact.v_WC);
}

void ContactAudit::add(const protocol::ContactUpdate& update) {
  const double dt = update.ve_time - time_;
  const bool follows = counts_.updates > 0 && dt > 0 && dt < kGap;
  std::vector<Seen> now = see(update);
  if (follows) compare(now, update.bodies, dt);
  before_ = std::move(now);
  bodies_before_ = update.bodies;
  time_ = update.ve_time;
  ++counts_.updates;
}

void ContactAudit::compare(std::vector<Seen>& now, const MovableBodies& bodies, double dt) {
  std::vector<const Seen*> unknown;
  for (Seen& one : now) {
    const auto known = std::ranges::find_if(before_, [&](const Seen& before) {
      return before.contact.identity == one.contact.identity;
    });
    if (known == before_.end()) {
      unknown.push_back(&one);
      continue;
    }
    known->goes_on = true;
    compare(*known, one, dt);
  }
  for (const Seen* one : unknown) {
    const auto goes_on = std::ranges::find_if(before_, [&](const Seen& before) {
      return !before.goes_on && same_sides(before.contact, one->contact) &&
             before.contact.n_W.dot(one->contact.n_W) > kSameNormal &&
             (before.p_A - one->p_A).norm() < kSamePlace;
    });
    if (goes_on != before_.end()) {
      goes_on->goes_on = true;
      ++counts_.renamed;
      continue;
    }
    ++counts_.appeared;
    const double one_update_ago = one->contact.separation - one->v_n * dt +
                                  blow(one->v_n - v_n_with(*one, bodies_before_), dt);
    counts_.late += one_update_ago < epsilon_ - std::min(kLate, epsilon_ / 2);
  }
  for (const Seen& before : before_) {
    if (before.goes_on) continue;
    const Vector3 c = before.contact.p_WC + dt * before.contact.v_WC;
    const double separation = before.contact.n_W.dot(tool_point(before) - c);
    const double farthest = separation + blow(v_n_with(before, bodies) - before.v_n, dt);
    counts_.vanished += farthest < std::min(epsilon_, counts_.seen_from) / 2;
  }
}

/// What tells of contacts that are late, and of tilted normals.
void ContactAudit::count_errors(const Seen& before, Seen& now, const Vector3& travel) {
  const Vector3& n = before.contact.n_W;
  const double motion = n.dot(travel);
  const double change = now.contact.separation - before.contact.separation;
  if (before.moved_for == before.motions.size()) {
    counts_.motion2 += motion * motion;
    counts_.off_by_age[0] += (change - motion) * (change - motion);
    for (std::size_t age = 1; age < counts_.off_by_age.size(); ++age) {
      const double off = change - before.motions[age - 1];
      counts_.off_by_age[age] += off * off;
    }
  }
  now.motions[0] = motion;
  std::copy_n(before.motions.begin(), now.motions.size() - 1, now.motions.begin() + 1);
  now.moved_for = std::min(before.moved_for + 1, now.motions.size());
  const Vector3 along = travel - motion * n;
  counts_.ways += along * along.transpose();
  counts_.off_along += (change - motion) * along;
  counts_.off2 += (change - motion) * (change - motion);
}

void ContactAudit::compare(const Seen& before, Seen& now, double dt) {
  const ReportedContact& was = before.contact;
  const ReportedContact& is = now.contact;
  // A body that is hit gets its new velocity at any time in between.
  const Vector3 relative = tool_point(before) - (was.p_WC + 0.5 * dt * (was.v_WC + is.v_WC));
  const double unknown = std::min(kBlow, 0.5 * dt * (is.v_WC - was.v_WC).norm());
  const Vector3 travel = relative - was.separation * was.n_W;
  const bool is_as_it_was = is.p_WC == was.p_WC && is.separation == was.separation;
  if (is_as_it_was && std::abs(was.n_W.dot(travel)) > kNoticeable + unknown) {
    ++counts_.moved;
    ++counts_.frozen;
    return;
  }
  if (!same_sides(was, is) || (before.p_A - now.p_A).norm() > kOtherPlace + 2 * travel.norm()) {
    ++counts_.wandered;
    return;
  }
  if (was.n_W.dot(is.n_W) < 0) {
    ++counts_.flipped;
    return;
  }
  ++counts_.kept;
  const double motion = was.n_W.dot(travel);
  const double change = is.separation - was.separation;
  const bool moves = std::abs(motion) > kNoticeable + unknown;
  counts_.moved += moves;
  if (unknown < kNoticeable) count_errors(before, now, travel);
  if (moves && std::abs(change + motion) < 0.3 * std::abs(motion)) {
    ++counts_.reversed;
    return;
  }
  const double jump = std::abs(change - motion);
  if (jump < kJump + kJumpShare * travel.norm() + unknown) return;
  ++counts_.jumped;
  counts_.largest_jump = std::max(counts_.largest_jump, jump);
}

}  // namespace hlm::server
