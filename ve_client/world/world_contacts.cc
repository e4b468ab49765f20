// The contacts that the engine's solver gets in each step.
#include <algorithm>
#include <cmath>

#include "hlm/ve_client/world/world.h"

namespace hlm::ve {
namespace {

/// Stiffness (N/m) and damping (N·s/m) of a contact between bodies. The solver goes through few
/// sweeps: rigid contacts would leave a pile unsolved after each, so that it creeps and falls. A
/// corner of a 0.3 kg cube yields 4 µm.
constexpr double kContactStiffness = 2e5;
constexpr double kContactDamping = 100;
/// Overlap, m, that bodies keep when they rest on each other. With none, a resting body is in
/// contact in some steps and not in others: friction slips, and the tool's active contacts (σ <= 0)
/// flicker. With more than a tenth of a millimetre it can be seen.
constexpr double kRestingOverlap = 2e-5;
/// Friction acts against the slip from this speed on, m/s; below, as it did in the step before.
/// Lower takes the solver's noise for slip.
constexpr double kSlipSpeed = 1e-3;
/// Least share of the bound that friction has across the direction in which it acts. With none it
/// could not turn; more lets it exceed its bound, 0.1 by half a per cent.
constexpr double kLeastShare = 0.1;

void set(dVector3& target, const Vector3& v) {
  target[0] = v.x();
  target[1] = v.y();
  target[2] = v.z();
}

dContact frictional_contact(double friction, const Vector3& p_W, const Vector3& n_W) {
  dContact contact{};
  contact.surface.mode = dContactApprox1;
  contact.surface.mu = friction;
  set(contact.geom.pos, p_W);
  set(contact.geom.normal, n_W);
  return contact;
}

}  // namespace

void World::collide_all() {
  rest_->begin_step();
  for (std::size_t i = 0; i < rest_->awake().size(); ++i) {
    woken_.clear();
    broad_phase_->for_still_near(rest_->awake()[i], [&](const auto& own, const auto& other) {
      if (!rests(other.body)) {
        collide(own, other);
      } else if (touch(own, other)) {
        woken_.push_back(other.body);
      }
    });
    for (const int body : woken_) wake(body);
  }
  broad_phase_->for_moving_pairs(
      [&](const auto& first, const auto& second) { collide(first, second); });
}

bool World::touch(const CollisionId& first, const CollisionId& second) {
  return can_touch(first.body, second.body) &&
         !find_contacts(convex(first), X_WG(first), convex(second), X_WG(second), 0, statistics_)
              .empty();
}

void World::collide(CollisionId first, CollisionId second) {
  if (!can_touch(first.body, second.body)) return;
  // The side that the normal points to can move.
  if (handle(first.body) == nullptr) std::swap(first, second);
  const PairSide a{pieces_->of(first), X_WG(first)};
  const PairSide b{pieces_->of(second), X_WG(second)};
  const double both = combine(a.piece.friction, b.piece.friction);
  const double friction = both < 0 ? kDefaultFriction : both;
  const auto side = [](const CollisionId& id) {
    return ContactSide{SideKind::kMovableBody, static_cast<std::uint32_t>(id.body)};
  };
  if (b.piece.mesh && b.piece.mesh->is_sheet() &&
      !is_before(b.piece, convex(first), b.piece.X_FG * (b.X_WG.inverse() * a.X_WG))) {
    return;
  }
  touching_.clear();
  for (const ManifoldPoint& point :
       find_contacts(convex(first), a.X_WG, convex(second), b.X_WG, 0, statistics_)) {
    touching_.push_back(found_contact(point, side(first), first, side(second), second));
    touching_.back().friction = friction;
  }
  remove_internal_edges(*pieces_, a, b, touching_, 0);
  for (const FoundContact& contact : touching_) add_contact(contact);
}

void World::add_contact(const FoundContact& found) {
  const int first = static_cast<int>(found.key.a.index);
  const int second = static_cast<int>(found.key.b.index);
  dContact contact = frictional_contact(found.friction, found.p_WC, found.n_W);
  contact.geom.depth = std::max(0.0, -found.separation - kRestingOverlap);
  const double spring = substep_ * kContactStiffness;
  contact.surface.mode |= dContactSoftERP | dContactSoftCFM;
  contact.surface.soft_erp = spring / (spring + kContactDamping);
  contact.surface.soft_cfm = 1 / (spring + kContactDamping);

  bound_friction(contact, found);
  const dJointID joint = dJointCreateContact(world_.get(), contacts_.get(), &contact);
  dJointAttach(joint, handle(first), handle(second));
  rest_->touch(first, second);
  dJointSetFeedback(joint, &memory_.add(found.key, found.n_W));
}

/// The engine bounds friction along two directions, each by μ f_n: together by up to √2 of that.
/// So the first is that in which it acts, and the second gets what that leaves.
void World::bound_friction(dContact& contact, const FoundContact& found) const {
  const ContactKey& key = found.key;
  const Vector3& n = found.n_W;
  const auto across = [&](const Vector3& v) { return Vector3(v - v.dot(n) * n); };
  const Vector3 slip = across(velocity_at(static_cast<int>(key.a.index), found.p_WC) -
                              velocity_at(static_cast<int>(key.b.index), found.p_WC));
  const ContactMemory::Carried latest = memory_.latest(key);
  const double bound = contact.surface.mu * latest.normal;
  const bool slips = slip.norm() > kSlipSpeed;
  const Vector3 direction = slips ? slip : across(latest.friction);
  if (direction.isZero(0) || !(bound > 0)) return;
  const double used = slips ? 1 : std::min(1.0, latest.friction.norm() / bound);
  contact.surface.mode |= dContactFDir1 | dContactMu2;
  set(contact.fdir1, direction.normalized());
  contact.surface.mu2 = contact.surface.mu * std::max(kLeastShare, std::sqrt(1 - used * used));
}

void World::add_contact(const ToolContact& tool_contact) {
  const dBodyID first = handle(tool_contact.tool_body);
  const dBodyID second = handle(tool_contact.body);
  const auto yields = [](dBodyID body) { return body != nullptr && !dBodyIsKinematic(body); };
  if (!yields(first) && !yields(second)) return;
  dContact contact = frictional_contact(tool_contact.friction, tool_contact.p_W, tool_contact.n_W);
  const double gap = tool_contact.separation + kRestingOverlap;
  contact.geom.depth = std::max(0.0, -gap);
  contact.surface.mode |= dContactMotionN;
  contact.surface.motionN = -std::max(0.0, gap) / substep_;  // Least velocity along the normal.
  dJointAttach(dJointCreateContact(world_.get(), contacts_.get(), &contact), first, second);
}

}  // namespace hlm::ve
