#include "hlm/haptic_server/local_model/scene_contacts.h"

#include <algorithm>
#include <limits>

namespace hlm::server {
namespace {

/// Cosine of the angle between normals up to which a new contact is a former one's that went on to
/// another feature: 45 degrees.
constexpr double kGoesOn = 0.7;

/// Added to the distance of one with another normal, m: it comes last.
constexpr double kLast = 1e3;

/// Farthest that a contact goes on to another feature with its load, m. Farther it would push where
/// nothing was touched; nearer a body that is corrected drops its load.
constexpr double kNearBy = 5e-3;

/// A contact of a body that carries load stays while the environment has it no farther from
/// touching than this, m: engines leave some space. Smaller drops what rests; larger carries what
/// was lifted.
constexpr double kStillTouches = 5e-4;

/// A plane that closes holds while the geometry where the step ends is no farther than so much
/// beyond it, m: rounding, and what bends.
constexpr double kSamePlane = 1e-6;
/// And its normal within so much of it, cosine: 1 degree.
constexpr double kSameNormal = 0.99985;

/// Separation of a contact that takes no part in the step, m.
constexpr double kBeyond = 1e3;

/// Friction of bodies with what is not the tool, where neither says: as in SDFormat.
constexpr double kUnsaidFriction = 1;

/// The contact as it was found, undeformed, with now.p_W its true point on a.
LocalContact met_contact(const MetContact& met, const FramePoses& poses) noexcept {
  const geometry::FoundContact& found = *met.found;
  LocalContact contact;
  contact.of_scene = true;
  contact.identity = met.identity;
  contact.a = found.key.a;
  contact.b = found.key.b;
  contact.frame_a = met.a;
  contact.frame_b = met.b;
  contact.material.friction = found.friction;
  LocalContact::Constraint& constraint = contact.constraint;
  if (met.b == kWorldFrame) {
    constraint.c_B = found.p_WC;
    constraint.n_P = found.n_W;
    constraint.v_constr = found.n_W.dot(met.v_WC);
    constraint.v_WC = constraint.v_reported_W = met.v_WC;
  } else {
    constraint.plane = found.plane;
    const Placement& X_WB = poses[met.b];
    constraint.c_B = X_WB.inverse() * found.p_WC;
    constraint.n_P =
        (found.plane == PlaneOwner::kA ? poses[met.a] : X_WB).R.transpose() * found.n_W;
  }
  contact.now.c_W = found.p_WC;
  contact.now.n_W = found.n_W;
  contact.now.p_W = found.p_WC + found.separation * found.n_W;
  return contact;
}

/// Gives the contact the separation σ + δ.
void set_delta(LocalContact& contact, const FramePoses& poses, double sigma,
               double delta) noexcept {
  const Vector3 x_W = contact.now.p_W;
  place_contact_point(contact, poses[contact.frame_a], x_W, sigma, sigma + delta);
  contact.deformation.delta = delta;
}

/// What is left of δ at σ: while a contact is open it brings nothing back, so δ goes as far as the
/// contact stays open.
double left_of(double delta, double sigma) noexcept {
  if (sigma + delta < 0) return delta;
  return std::clamp(-sigma, 0.0, std::max(0.0, delta));
}

/// What a contact that was met goes on from.
struct Predecessor {
  const LocalContact* known = nullptr;  ///< Null: from none.
  bool alone = false;  ///< Near by, and for no other: its load and its friction are this one's.
};

/// Which contacts that were met go on from which existing ones. By their identity, or on another
/// feature from the nearest of the same two sides whose normal is about the same; one that is
/// closed from the nearest of any.
class Succession {
 public:
  Succession(const LocalContacts& existing, const MetContacts& met) noexcept : existing_(existing) {
    goes_on_.resize(existing.size(), false);
    predecessors_.resize(met.size());
    std::size_t next = 0;
    for (std::size_t i = 0; i < met.size(); ++i) {
      while (next < existing.size() && existing[next].identity < met[i].identity) ++next;
      for (std::size_t k = next; k < existing.size(); ++k) {
        if (existing[k].identity != met[i].identity) break;
        if (existing[k].of_scene) claim(i, k, true);
      }
    }
    for (std::size_t i = 0; i < met.size(); ++i) {
      if (predecessors_[i].known == nullptr) find_nearest(i, met[i]);
    }
  }

  const Predecessor& of(std::size_t met) const noexcept { return predecessors_[met]; }

  template <class Use>
  void for_each_gone(Use use) const {
    for (std::size_t i = 0; i < existing_.size(); ++i) {
      if (existing_[i].of_scene && !goes_on_[i]) use(existing_[i]);
    }
  }

 private:
  void claim(std::size_t met, std::size_t known, bool is_near) noexcept {
    predecessors_[met] = {&existing_[known], is_near && !goes_on_[known]};
    if (is_near) goes_on_[known] = true;
  }

  void find_nearest(std::size_t place, const MetContact& met) noexcept {
    const geometry::FoundContact& found = *met.found;
    const Vector3 x_W = found.p_WC + found.separation * found.n_W;
    std::size_t best = existing_.size();
    double least = std::numeric_limits<double>::infinity();
    double distance = 0;  // m
    for (std::size_t i = 0; i < existing_.size(); ++i) {
      const LocalContact& known = existing_[i];
      if (!known.of_scene || known.a != found.key.a || known.b != found.key.b) continue;
      const bool similar = known.now.n_W.dot(found.n_W) > kGoesOn;
      if (!similar && found.separation > 0) continue;
      const double away = (known.now.p_W - x_W).norm();
      const double rank = away + (similar ? 0 : kLast);
      if (rank >= least) continue;
      least = rank;
      distance = away;
      best = i;
    }
    if (best < existing_.size()) claim(place, best, distance < kNearBy);
  }

  const LocalContacts& existing_;
  StaticVector<Predecessor, kMaxLocalContacts> predecessors_;
  StaticVector<bool, kMaxLocalContacts> goes_on_;
};

/// The motion of tool and bodies alone has brought the contact to where it is.
void go_on(LocalContact& contact, const Predecessor& from, const FramePoses& poses,
           double sigma) noexcept {
  if (from.known == nullptr) return set_delta(contact, poses, sigma, 0);
  const LocalContact::Deformation& before = from.known->deformation;
  // What is held where nothing touches is held once.
  const double delta = from.alone ? before.delta : std::max(before.delta, 0.0);
  set_delta(contact, poses, sigma, left_of(delta, sigma));
  LocalContact::Deformation& deformation = contact.deformation;
  if (before.deferred != 0) {
    deformation.deferred = -deformation.delta;
    deformation.deferred_step = before.deferred_step;
  }
  inherit(contact, *from.known);
  contact.latest.s_left = from.known->latest.s_left;
  if (!from.alone) contact.friction.z_W.setZero();
}

/// It stays as it is, among the bodies of an update.
void keep(LocalContact contact, const UpdateFrames& frames, LocalContacts& updated) noexcept {
  if (updated.size() < updated.capacity() && goes_over(contact, frames)) updated.push_back(contact);
}

/// The velocity with which damping and friction meet a moving constraint goes on.
void keep_velocity(LocalContact& contact, const LocalContact& known) noexcept {
  const bool both = contact.frame_b == kWorldFrame && known.frame_b == kWorldFrame;
  if (both && known.latest.loaded) contact.constraint.v_WC = known.constraint.v_WC;
}

}  // namespace

void sort_met(MetContacts& met) noexcept {
  std::ranges::sort(met, {}, &MetContact::identity);
  const auto same = [](const MetContact& a, const MetContact& b) {
    return a.identity == b.identity;
  };
  met.erase(std::unique(met.begin(), met.end(), same), met.end());
}

void keep_supports_of_held(const LocalContacts& from, const UpdateFrames& frames,
                           LocalContacts& to) noexcept {
  for (LocalContact contact : from) {
    if (!contact.of_scene || !goes_over(contact, frames)) continue;
    if (touches_reported(contact, frames) || to.size() == to.capacity()) continue;
    if (std::ranges::find(to, contact.identity, &LocalContact::identity) == to.end()) {
      to.push_back(contact);
    }
  }
  std::ranges::sort(to, {}, &LocalContact::identity);
}

void keep_scene(const LocalContacts& from, LocalContacts& to) noexcept {
  for (const LocalContact& contact : from) {
    if (contact.of_scene && to.size() < to.capacity()) to.push_back(contact);
  }
}

double renew_contacts(const LocalContacts& existing, const MetContacts& met,
                      const UpdateFrames& frames, const GeometryChange& change,
                      const UpdatePolicy& policy, LocalContacts& updated) noexcept {
  const Succession succession(existing, met);
  double unspent = 0;
  for (std::size_t i = 0; i < met.size(); ++i) {
    if (updated.size() == updated.capacity()) break;
    LocalContact& contact = add_to(updated);
    contact = met_contact(met[i], frames.now);
    const double sigma = met[i].found->separation;
    const Predecessor& from = succession.of(i);
    if (!change.concerns(contact)) {
      go_on(contact, from, frames.now, sigma);
      if (from.known != nullptr) keep_velocity(contact, *from.known);
      continue;
    }
    std::optional<double> s_p;
    if (from.alone) s_p = separation(*from.known, frames.before);
    deform(contact, frames.now[contact.frame_a], sigma, s_p, policy);
    contact.deformation.delta = contact.now.s - sigma;
    if (!from.alone) continue;
    inherit(contact, *from.known);
    keep_velocity(contact, *from.known);
    if (!contact.latest.loaded || !touches_body(contact)) continue;
    unspent += contact.latest.f_W.dot(contact.now.n_W) *
               (from.known->deformation.deferred - contact.deformation.deferred);
  }
  LocalContacts orphans;
  succession.for_each_gone([&](const LocalContact& contact) {
    if (change.keeps(contact)) return keep(contact, frames, updated);
    // By motion over the geometry alone only what is not deformed may go.
    if (!change.concerns(contact) && contact.deformation.delta == 0) return;
    if (const auto left = released(contact, frames, policy)) orphans.push_back(*left);
  });
  if (!orphans.empty()) add_released(updated, orphans);
  return unspent;
}

void renew_supports(const LocalContacts& existing, const MetContacts& met,
                    const UpdateFrames& frames, const GeometryChange& change,
                    LocalContacts& updated) noexcept {
  const Succession succession(existing, met);
  for (std::size_t i = 0; i < met.size(); ++i) {
    if (updated.size() == updated.capacity()) break;
    LocalContact& contact = add_to(updated);
    contact = met_contact(met[i], frames.now);
    if (contact.material.friction < 0) contact.material.friction = kUnsaidFriction;
    const double sigma = met[i].found->separation;
    const Predecessor& from = succession.of(i);
    contact.material.ahead = touches_reported(contact, frames);
    if (from.known != nullptr) contact.material.scale = from.known->material.scale;
    if (from.known != nullptr && !change.concerns(contact)) {
      go_on(contact, from, frames.now, sigma);
      continue;
    }
    double s = std::max(sigma, 0.0);
    if (from.alone) {
      const double held = separation(*from.known, frames.before);
      if (held < 0 && sigma < kStillTouches) s = held;
      inherit(contact, *from.known);
    }
    set_delta(contact, frames.now, sigma, s - sigma);
  }
  succession.for_each_gone([&](const LocalContact& contact) {
    if (change.keeps(contact)) keep(contact, frames, updated);
  });
}

ClosingContacts find_closing(const ContactGroup& group, const FrameMotions& frames,
                             const Unknowns& x) noexcept {
  ClosingContacts closing;
  const FrameTwists twists = frames.twists(x);
  RelativeTwists relative(twists);
  for (LocalContact& contact : group.contacts) {
    if (!contact.of_scene || contact.now.s <= 0 || !takes_part(contact, group.law)) continue;
    const Vector3 arm = contact.now.p_W - frames.reference_W();
    const RelativeVelocity v = relative_velocity(contact, relative.of(contact), arm);
    if (penalty(contact, v.normal, group.law) > 0) closing.push_back(&contact);
  }
  return closing;
}

namespace {

/// Of the met contacts of the same two sides that may stand for a contact the nearest to its point
/// at the end of the step; met.size() if there is none.
template <class May>
std::size_t nearest_met(const LocalContact& contact, const MetContacts& met,
                        const FrameTwists& twists, const FrameMotions& frames, double dt,
                        May may) noexcept {
  const Vector3 arm = contact.now.p_W - frames.reference_W();
  const Vector3 there = contact.now.p_W + dt * point_velocity(twists[contact.frame_a], arm);
  std::size_t nearest = met.size();
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < met.size(); ++i) {
    const geometry::FoundContact& found = *met[i].found;
    if (found.key.a != contact.a || found.key.b != contact.b || !may(found)) continue;
    const double away = (found.p_WC + found.separation * found.n_W - there).norm();
    if (away >= least) continue;
    least = away;
    nearest = i;
  }
  return nearest;
}

/// The plane that was met at the end of the step, over which the contact is open at its start.
void put_on(LocalContact& contact, const MetContact& met, const FramePoses& end,
            const FrameMotions& frames, double dt) noexcept {
  const LocalContact there = met_contact(met, end);
  const double sigma = met.found->separation;
  contact.constraint = there.constraint;
  contact.now = there.now;
  place_contact_point(contact, end[contact.frame_a], there.now.p_W, sigma,
                      sigma + contact.deformation.delta);
  LocalContact::Constraint& constraint = contact.constraint;
  if (contact.frame_b == kWorldFrame) {
    constraint.c_B -= constraint.v_constr * dt * constraint.n_P;
  }
  locate(contact, frames[contact.frame_a].X_W, frames[contact.frame_b].X_W);
  contact.now.s = std::max(contact.now.s, 0.0);
  const FrameTwists twists = frames.twists();
  const Vector3 arm = contact.now.p_W - frames.reference_W();
  const Twist V = twists[contact.frame_a] - twists[contact.frame_b];
  contact.now.v_n = contact.now.n_W.dot(point_velocity(V, arm) - contact.constraint.v_WC);
}

}  // namespace

ClosingContacts leave_out(const ClosingContacts& closing, const MetContacts& met,
                          const FrameMotions& frames, const Unknowns& x, double dt) noexcept {
  ClosingContacts left_out;
  const FrameTwists twists = frames.twists(x);
  RelativeTwists relative(twists);
  for (LocalContact* contact : closing) {
    const Vector3 arm = contact->now.p_W - frames.reference_W();
    const RelativeVelocity v = relative_velocity(*contact, relative.of(*contact), arm);
    const double s_end = contact->now.s + dt * v.normal;
    const std::size_t same =
        nearest_met(*contact, met, twists, frames, dt, [&](const geometry::FoundContact& found) {
          return found.n_W.dot(contact->now.n_W) > kSameNormal &&
                 found.separation + contact->deformation.delta <= s_end + kSamePlane;
        });
    if (same < met.size()) continue;
    contact->now.s = kBeyond;
    left_out.push_back(contact);
  }
  return left_out;
}

bool bring_back(const ClosingContacts& left_out, MetContacts& met, const FramePoses& end,
                const FrameMotions& frames, const Unknowns& x, double dt) noexcept {
  const FrameTwists twists = frames.twists(x);
  bool any = false;
  for (LocalContact* contact : left_out) {
    const std::size_t place =
        nearest_met(*contact, met, twists, frames, dt, [&](const geometry::FoundContact& found) {
          return found.separation + contact->deformation.delta <= 0;
        });
    if (place == met.size()) continue;
    put_on(*contact, met[place], end, frames, dt);
    met.erase(met.begin() + static_cast<std::ptrdiff_t>(place));  // One contact is on each plane.
    any = true;
  }
  return any;
}

}  // namespace hlm::server
