// What the hand holds: bodies that bear upon the tool belong to the server until they are let go
// (docs/method.md 21).
#include <algorithm>

#include "hlm/haptic_server/local_model/local_model.h"

namespace hlm::server {
namespace {

/// A body bears upon the tool, or upon one that does, where they are no farther apart than this, m:
/// engines leave some space between what rests. Larger takes what only passes.
constexpr double kTouches = 2e-4;
/// Or where they will be so in so many steps: what is hit must be there when it is.
constexpr double kStepsAhead = 2;
/// A body that has not borne upon the tool for so long is given back, s. Less: what bounces goes to
/// and fro. More: the environment's own forces act late on it.
constexpr double kGiveAfter = 0.3;

/// A contact with a body goes over from the world's frame to the body's, or back.
void reframe(LocalContact& contact, FrameIndex frame_b, const Placement& X_WB) noexcept {
  const bool to_world = frame_b == kWorldFrame;
  const bool changes = to_world != (contact.frame_b == kWorldFrame);
  contact.frame_b = frame_b;
  if (!changes) return;
  LocalContact::Constraint& constraint = contact.constraint;
  if (to_world) {
    constraint.c_B = contact.now.c_W;
    constraint.n_P = contact.now.n_W;
  } else {
    constraint.c_B = X_WB.inverse() * constraint.c_B;
    constraint.n_P = X_WB.R.transpose() * constraint.n_P;
  }
  constraint.plane = PlaneOwner::kB;
  constraint.v_constr = 0;
  constraint.v_WC.setZero();
  constraint.v_reported_W.setZero();
}

}  // namespace

bool LocalModel::is_local(std::uint32_t body) const noexcept {
  return std::ranges::find(bodies_, body, &LocalBody::id) != bodies_.end();
}

NearBody* LocalModel::near_body(const ContactSide& side) noexcept {
  if (side.kind != SideKind::kMovableBody) return nullptr;
  const auto found = std::ranges::find_if(
      near_bodies_, [&](const NearBody& body) { return body.pose.body == side.index; });
  return found == near_bodies_.end() ? nullptr : &*found;
}

/// Whether the scene says of a body that is held what it said when that began.
bool LocalModel::is_as_it_was(std::uint32_t body) const noexcept {
  const auto local = std::ranges::find(bodies_, body, &LocalBody::id);
  if (local == bodies_.end() || !local->inertia) return false;
  const BodyInertia* inertia = scene_->inertia(body);
  const Mechanism* mechanism = scene_->mechanism(body);
  if (inertia == nullptr || *inertia != *local->inertia) return false;
  if (local->mechanism < 0) return mechanism == nullptr;
  return mechanism != nullptr &&
         mechanism->is_built_as(mechanisms_[static_cast<std::size_t>(local->mechanism)]);
}

/// Those that the server goes on to move, whatever an update says of where they are. What joints
/// connect stays as a whole, or goes.
LocalBodies LocalModel::that_stay(const ModelUpdate& update) noexcept {
  LocalBodies stay;
  if (!holds()) return stay;
  const auto stays = [&](std::uint32_t body) {
    const NearBody* known = near_body({SideKind::kMovableBody, body});
    const Ownership owner = owner_of(body, update.owners);
    const bool is_reported =
        std::ranges::find(update.bodies, body, &MovableBody::id) != update.bodies.end();
    return update.holds && !owner.kept && !is_reported && known != nullptr && is_as_it_was(body) &&
           std::ranges::find(update.poses, body, &BodyPose::body) != update.poses.end() &&
           owner.number < known->number + (known->owner == Owner::kServer ? 1 : 0);
  };
  StaticVector<bool, kMaxMovedBodies> whole;
  for (const Mechanism& mechanism : mechanisms_) {
    whole.push_back(true);
    for (std::size_t i = 0; i < mechanism.size(); ++i) {
      whole.back() = whole.back() && stays(mechanism.body(i));
    }
  }
  for (const LocalBody& body : bodies_) {
    const bool is_alone = body.mechanism < 0;
    if (!(is_alone ? stays(body.id) : whole[static_cast<std::size_t>(body.mechanism)])) continue;
    stay.push_back(body);
    stay.back().wanted_pace = owner_of(body.id, update.owners).pace();
  }
  return stay;
}

/// Other bodies are the local model's from here on: contacts go over to their frames. What was on
/// one that is gone stays in the world, as the tool's, or goes.
void LocalModel::set_bodies(const LocalBodies& bodies) noexcept {
  bodies_ = bodies;
  keep_mechanisms(bodies_);
  const FramePoses poses = poses_of(proxy_, bodies_);
  const auto go_over = [&](LocalContacts& contacts) {
    erase_if(contacts, [&](LocalContact& contact) {
      const auto a = frame_of(contact.a, proxy_, bodies_);
      const auto b = frame_of(contact.b, proxy_, bodies_);
      if (!a || !b || *a == kWorldFrame) return true;
      contact.frame_a = *a;
      reframe(contact, *b, poses[*b]);
      return false;
    });
  };
  go_over(present());
  go_over(present_supports());
}

/// Of the bodies that there are.
void LocalModel::keep_mechanisms(LocalBodies& bodies) noexcept {
  Mechanisms kept;
  for (LocalBody& body : bodies) {
    if (body.mechanism < 0) continue;
    if (body.member == 0) kept.push_back(mechanisms_[static_cast<std::size_t>(body.mechanism)]);
    body.mechanism = static_cast<int>(kept.size()) - 1;
  }
  mechanisms_ = kept;
}

/// All bodies of it, if there is room and all of them are known.
void LocalModel::take_mechanism(const Mechanism& mechanism) noexcept {
  StaticVector<BodyPose, kMaxMovedBodies> poses;
  if (bodies_.size() + mechanism.size() > bodies_.capacity()) return;
  for (std::size_t i = 0; i < mechanism.size(); ++i) {
    const NearBody* near = near_body({SideKind::kMovableBody, mechanism.body(i)});
    if (near == nullptr || near->kept || is_local(mechanism.body(i))) return;
    poses.push_back(near->pose);
  }
  mechanisms_.push_back(mechanism);
  const double pace = near_body({SideKind::kMovableBody, mechanism.body(0)})->pace;
  mechanisms_.back().set_state({poses.data(), poses.size()}, pace);
  LocalBodies bodies = bodies_;
  for (std::size_t i = 0; i < mechanism.size(); ++i) {
    LocalBody& local = bodies.emplace_back(*scene_->inertia(mechanism.body(i)), poses[i]);
    local.mechanism = static_cast<int>(mechanisms_.size()) - 1;
    local.member = i;
    begin_holding(*near_body({SideKind::kMovableBody, local.id}), local);
    move_with(local, mechanisms_.back());
  }
  set_bodies(bodies);
}

void LocalModel::begin_holding(NearBody& near, LocalBody& local) noexcept {
  local.pace = local.wanted_pace = near.pace;
  near.X_CB = local.X_WB.inverse() * near.pose.X_WB;
  near.owner = Owner::kServer;
  ++near.number;
  near.apart = 0;
}

/// As the environment reported it last, if there is room, and enough is known of it.
void LocalModel::take(NearBody& body) noexcept {
  const BodyInertia* inertia = scene_->inertia(body.pose.body);
  if (inertia == nullptr || body.kept || !may_hold_) return;
  const Mechanism* mechanism = scene_->mechanism(body.pose.body);
  if (mechanism != nullptr) return take_mechanism(*mechanism);
  if (bodies_.size() == bodies_.capacity()) return;
  LocalBodies bodies = bodies_;
  begin_holding(body, bodies.emplace_back(*inertia, body.pose));
  set_bodies(bodies);
}

/// The velocity of a side's point, world, m/s.
Vector3 LocalModel::velocity_of(const ContactSide& side, const Vector3& p_W) noexcept {
  if (side.kind == SideKind::kToolLink) {
    return proxy_.point_jacobian(static_cast<int>(side.index), p_W).lazyProduct(v_);
  }
  const auto local = std::ranges::find(bodies_, side.index, &LocalBody::id);
  if (side.kind == SideKind::kMovableBody && local != bodies_.end()) {
    return shifted(local->V_W, p_W - local->X_WB.p).head<3>();
  }
  const NearBody* near = near_body(side);
  return near == nullptr ? Vector3(Vector3::Zero()) : velocity_at(near->pose, p_W);
}

bool LocalModel::bears(const geometry::FoundContact& found) noexcept {
  const Vector3 v = velocity_of(found.key.a, found.p_WC) - velocity_of(found.key.b, found.p_WC);
  const double ahead = std::min(0.0, found.n_W.dot(v)) * kStepsAhead * dt_;
  return found.separation + ahead <= kTouches;
}

/// Takes the bodies that bear upon the tool, or upon one that is taken already.
void LocalModel::take_bearing(std::span<const geometry::FoundContact> found) noexcept {
  for (const geometry::FoundContact& contact : found) {
    for (const ContactSide& side : {contact.key.a, contact.key.b}) {
      NearBody* near = near_body(side);
      if (near == nullptr || is_local(side.index) || !bears(contact)) continue;
      take(*near);
    }
  }
}

/// Which of the bodies bear upon the tool, themselves or by others; those that have not for a while
/// are given back.
void LocalModel::give_back(const MetContacts& met, const MetContacts& met_by_bodies) noexcept {
  StaticVector<bool, kMaxFrames> reached(kMaxFrames, false);
  const FrameIndex first = frame_of_body(proxy_, 0);
  const auto reach = [&](FrameIndex a, FrameIndex b) {
    if (a < first || b < first) {
      if (b >= first) reached[b] = true;
      return false;
    }
    const bool changes = reached[a] != reached[b];
    if (changes) reached[a] = reached[b] = true;
    return changes;
  };
  for (const MetContact& contact : met) {
    if (bears(*contact.found)) reach(contact.a, contact.b);
  }
  for (const LocalContact& contact : contacts()) {
    if (contact.latest.loaded) reach(contact.frame_a, contact.frame_b);
  }
  for (bool changes = true; changes;) {
    changes = false;
    for (const MetContact& contact : met_by_bodies) {
      if (contact.b < first || contact.a < first || !bears(*contact.found)) continue;
      changes = reach(contact.a, contact.b) || changes;
    }
    for (std::size_t slot = 1; slot < bodies_.size(); ++slot) {
      if (bodies_[slot].member == 0) continue;  // It is none of the one before.
      const FrameIndex frame = frame_of_body(proxy_, slot);
      changes = reach(frame, static_cast<FrameIndex>(frame - 1)) || changes;
    }
  }
  for (std::size_t slot = 0; slot < bodies_.size(); ++slot) {
    NearBody* near = near_body({SideKind::kMovableBody, bodies_[slot].id});
    if (near == nullptr || !bodies_[slot].inertia) continue;
    const bool bears_now = reached[frame_of_body(proxy_, slot)];
    near->apart = bears_now ? 0 : near->apart + dt_;
    if (near->owner == Owner::kServer && near->apart > kGiveAfter) {
      near->owner = Owner::kGivenBack;
      ++near->number;
    } else if (near->owner == Owner::kGivenBack && bears_now && may_hold_) {
      near->owner = Owner::kServer;
      ++near->number;
    }
  }
}

/// Nothing is moved ahead of reports: the contacts of what is held go on.
void LocalModel::adopt_held(const ModelUpdate& update, const LocalBodies& held) noexcept {
  set_bodies(held);
  UpdateFrames frames{.tool = proxy_,
                      .bodies = bodies_,
                      .reported = poses_of(ve_tool_, bodies_),
                      .before = poses_of(proxy_, bodies_)};
  frames.set_now(frames.before);
  const LocalContacts& existing = contacts();
  const LocalContacts& existing_supports = supports();
  current_ = 1 - current_;
  adopt_supports(existing_supports, update.contacts, frames, kSupportStiffness, present_supports());
  fill_tank(
      adopt_update(existing, update.contacts, frames, update.age, policy(), contacts_[current_]));
  keep_scene(existing, present());
  keep_scene(existing_supports, present_supports());
  for (LocalContacts* contacts : {&present(), &present_supports()}) {
    std::ranges::sort(*contacts, {}, &LocalContact::identity);
  }
  change_.of_bodies = true;
  looked_ = false;
}

StaticVector<HeldState, kMaxPoses> LocalModel::held() const noexcept {
  StaticVector<HeldState, kMaxPoses> held;
  for (const NearBody& near : near_bodies_) {
    if (near.owner == Owner::kEnvironment) continue;
    HeldState& state = held.emplace_back();
    state.number = near.number;
    state.pose = near.pose;
    const auto local = std::ranges::find(bodies_, near.pose.body, &LocalBody::id);
    if (local == bodies_.end()) continue;
    state.pose.X_WB = local->X_WB * near.X_CB;
    state.pose.V_W = shifted(local->V_W, state.pose.X_WB.p - local->X_WB.p);
  }
  return held;
}

}  // namespace hlm::server
