#include "hlm/haptic_server/local_model/bodies.h"

#include <algorithm>

namespace hlm::server {
namespace {

/// A body that has not borne upon the tool for so long is given back, s. Less: what bounces goes to
/// and fro. More: the environment's own forces act late on it.
constexpr double kGiveAfter = 0.3;

/// What the environment moves stands still where no update has come for so long, s: nobody knows
/// where it is. Less stops it between the updates of a slow environment.
constexpr double kLongestUnheard = 0.25;

template <class NearBodiesOf>
auto find_near(NearBodiesOf& bodies, const ContactSide& side) noexcept -> decltype(bodies.data()) {
  if (side.kind != SideKind::kMovableBody) return nullptr;
  const auto found = std::ranges::find_if(
      bodies, [&](const NearBody& body) { return body.pose.body == side.index; });
  return found == bodies.end() ? nullptr : &*found;
}

}  // namespace

bool Bodies::is_local(std::uint32_t body) const noexcept {
  return std::ranges::find(local_, body, &LocalBody::id) != local_.end();
}

NearBody* Bodies::near_of(const ContactSide& side) noexcept { return find_near(near_, side); }

bool Bodies::moves_ahead() const noexcept {
  return std::ranges::any_of(local_, [](const LocalBody& body) { return !body.inertia; });
}

StaticVector<HeldState, kMaxPoses> Bodies::held() const noexcept {
  StaticVector<HeldState, kMaxPoses> held;
  for (const NearBody& near : near_) {
    if (near.owner == Owner::kEnvironment) continue;
    HeldState& state = held.emplace_back();
    state.number = near.number;
    state.pose = near.pose;
    const auto local = std::ranges::find(local_, near.pose.body, &LocalBody::id);
    if (local == local_.end()) continue;
    state.pose.X_WB = local->X_WB * near.X_CB;
    state.pose.V_W = shifted(local->V_W, state.pose.X_WB.p - local->X_WB.p);
  }
  return held;
}

Vector3 Bodies::velocity_of(const ContactSide& side, const Vector3& p_W) const noexcept {
  const auto local = std::ranges::find(local_, side.index, &LocalBody::id);
  if (side.kind == SideKind::kMovableBody && local != local_.end()) {
    return shifted(local->V_W, p_W - local->X_WB.p).head<3>();
  }
  const NearBody* near = find_near(near_, side);
  return near == nullptr ? Vector3(Vector3::Zero()) : velocity_at(near->pose, p_W);
}

/// Whether the scene says of a body that is held what it said when that began.
bool Bodies::is_as_it_was(std::uint32_t body, const Scene& scene) const noexcept {
  const auto local = std::ranges::find(local_, body, &LocalBody::id);
  if (local == local_.end() || !local->inertia) return false;
  const BodyInertia* inertia = scene.inertia(body);
  const Mechanism* mechanism = scene.mechanism(body);
  if (inertia == nullptr || *inertia != *local->inertia) return false;
  if (local->mechanism < 0) return mechanism == nullptr;
  return mechanism != nullptr &&
         mechanism->is_built_as(mechanisms_[static_cast<std::size_t>(local->mechanism)]);
}

LocalBodies Bodies::that_stay(const ModelUpdate& update, const Scene* scene) noexcept {
  unheard_ = 0;
  may_hold_ = update.holds;
  LocalBodies stay;
  if (scene == nullptr || !scene->holds()) return stay;
  const auto stays = [&](std::uint32_t body) {
    const NearBody* known = near_of({SideKind::kMovableBody, body});
    const Ownership owner = owner_of(body, update.owners);
    const bool is_reported =
        std::ranges::find(update.bodies, body, &MovableBody::id) != update.bodies.end();
    return update.holds && !owner.kept && !is_reported && known != nullptr &&
           is_as_it_was(body, *scene) &&
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
  for (const LocalBody& body : local_) {
    const bool is_alone = body.mechanism < 0;
    if (!(is_alone ? stays(body.id) : whole[static_cast<std::size_t>(body.mechanism)])) continue;
    stay.push_back(body);
    stay.back().wanted_pace = owner_of(body.id, update.owners).pace();
  }
  return stay;
}

void Bodies::adopt_poses(const ModelUpdate& update, const LocalBodies& bodies,
                         Scene* scene) noexcept {
  NearBodies renewed;
  for (const BodyPose& pose : update.poses) {
    NearBody& body = renewed.emplace_back();
    const NearBody* known = near_of({SideKind::kMovableBody, pose.body});
    const auto local = std::ranges::find(bodies, pose.body, &LocalBody::id);
    if (local != bodies.end() && local->inertia) {
      body = *known;
      continue;
    }
    const Ownership owner = owner_of(pose.body, update.owners);
    body.pose = pose;
    body.kept = owner.kept;
    body.pace = owner.pace();
    if (local != bodies.end()) {
      body.X_CB = local->X_WB.inverse() * pose.X_WB;
    } else {
      hlm::server::advance(body.pose, update.age);
    }
    body.number = std::max(owner.number, known != nullptr ? known->number : 0);
    if (is_held(body.number)) ++body.number;  // Nobody moves it here.
    if (body.number > owner.number) body.owner = Owner::kGivenBack;
  }
  for (const NearBody& body : near_) {
    if (scene != nullptr) scene->place({SideKind::kMovableBody, body.pose.body}, std::nullopt);
  }
  near_ = renewed;
}

void Bodies::set(const LocalBodies& bodies) noexcept {
  local_ = bodies;
  Mechanisms kept;
  for (LocalBody& body : local_) {
    if (body.mechanism < 0) continue;
    if (body.member == 0) kept.push_back(mechanisms_[static_cast<std::size_t>(body.mechanism)]);
    body.mechanism = static_cast<int>(kept.size()) - 1;
  }
  mechanisms_ = kept;
}

void Bodies::forget_local(Scene* scene) noexcept {
  erase_if(near_, [&](const NearBody& body) {
    if (!is_local(body.pose.body)) return false;
    if (scene != nullptr) scene->place({SideKind::kMovableBody, body.pose.body}, std::nullopt);
    return true;
  });
  local_.clear();
  mechanisms_.clear();
}

LocalBodies Bodies::stop_ahead() noexcept {
  for (NearBody& near : near_) {
    const auto local = std::ranges::find(local_, near.pose.body, &LocalBody::id);
    if (local == local_.end() || local->inertia) continue;
    near.pose = {.body = near.pose.body, .X_WB = local->X_WB * near.X_CB};
  }
  LocalBodies held = local_;
  erase_if(held, [](const LocalBody& body) { return !body.inertia; });
  return held;
}

/// All bodies of it, if there is room and all of them are known.
bool Bodies::take_mechanism(const Mechanism& mechanism, const Scene& scene) noexcept {
  StaticVector<BodyPose, kMaxMovedBodies> poses;
  if (local_.size() + mechanism.size() > local_.capacity()) return false;
  for (std::size_t i = 0; i < mechanism.size(); ++i) {
    const NearBody* near = near_of({SideKind::kMovableBody, mechanism.body(i)});
    if (near == nullptr || near->kept || is_local(mechanism.body(i))) return false;
    poses.push_back(near->pose);
  }
  mechanisms_.push_back(mechanism);
  const double pace = near_of({SideKind::kMovableBody, mechanism.body(0)})->pace;
  mechanisms_.back().set_state({poses.data(), poses.size()}, pace);
  LocalBodies bodies = local_;
  for (std::size_t i = 0; i < mechanism.size(); ++i) {
    LocalBody& local = bodies.emplace_back(*scene.inertia(mechanism.body(i)), poses[i]);
    local.mechanism = static_cast<int>(mechanisms_.size()) - 1;
    local.member = i;
    begin_holding(*near_of({SideKind::kMovableBody, local.id}), local);
    move_with(local, mechanisms_.back());
  }
  set(bodies);
  return true;
}

void Bodies::begin_holding(NearBody& near, LocalBody& local) noexcept {
  local.pace = local.wanted_pace = near.pace;
  near.X_CB = local.X_WB.inverse() * near.pose.X_WB;
  near.owner = Owner::kServer;
  ++near.number;
  near.apart = 0;
}

bool Bodies::take(const ContactSide& side, const Scene& scene) noexcept {
  NearBody* const near = near_of(side);
  if (near == nullptr || is_local(side.index)) return false;
  const BodyInertia* inertia = scene.inertia(side.index);
  if (inertia == nullptr || near->kept || !may_hold_) return false;
  const Mechanism* mechanism = scene.mechanism(side.index);
  if (mechanism != nullptr) return take_mechanism(*mechanism, scene);
  if (local_.size() == local_.capacity()) return false;
  LocalBodies bodies = local_;
  begin_holding(*near, bodies.emplace_back(*inertia, near->pose));
  set(bodies);
  return true;
}

void Bodies::give_back(std::span<const bool> bears, double dt) noexcept {
  for (std::size_t slot = 0; slot < local_.size(); ++slot) {
    NearBody* near = near_of({SideKind::kMovableBody, local_[slot].id});
    if (near == nullptr || !local_[slot].inertia) continue;
    near->apart = bears[slot] ? 0 : near->apart + dt;
    const bool goes = near->owner == Owner::kServer && near->apart > kGiveAfter;
    const bool comes = near->owner == Owner::kGivenBack && bears[slot] && may_hold_;
    if (!goes && !comes) continue;
    near->owner = goes ? Owner::kGivenBack : Owner::kServer;
    ++near->number;
  }
}

void Bodies::push(const FrameMotions& frames, FrameIndex first, const Unknowns& u) noexcept {
  for (std::size_t slot = 0; slot < local_.size(); ++slot) {
    const FrameMotion& frame = frames[static_cast<FrameIndex>(first + slot)];
    LocalBody& body = local_[slot];
    const auto y = u.segment(frame.first, frame.J.cols());
    body.V_W += body.B.lazyProduct(y);
    if (body.mechanism >= 0 && body.member == 0) {
      mechanisms_[static_cast<std::size_t>(body.mechanism)].push(y);
    }
  }
}

void Bodies::advance(double dt) noexcept {
  unheard_ += dt;
  for (NearBody& body : near_) {
    if (unheard_ > kLongestUnheard) body.pose.V_W.setZero();
    hlm::server::advance(body.pose, dt);
  }
}

}  // namespace hlm::server
