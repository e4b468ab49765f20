// What the local model meets in the geometry near the hand (docs/method.md 18).
#include <algorithm>
#include <utility>

#include "hlm/geometry/work.h"
#include "hlm/haptic_server/local_model/free_motion.h"
#include "hlm/haptic_server/local_model/local_model.h"

namespace hlm::server {
namespace {

/// Contacts are looked for within what tool and bodies may travel in so many steps, and at least
/// within kLeastMargin, m: one that a step would close must be known before.
constexpr double kMarginSteps = 4;
constexpr double kLeastMargin = 1e-3;
/// Largest margin, m: what is faster is no hand's.
constexpr double kLargestMargin = 0.05;

/// Contacts are looked for within this at the end of a step, m. Less: what is no farther from its
/// plane than a step goes is taken for what is not there. More: time.
constexpr double kEndMargin = 1e-3;

/// What the environment moves stands still where no update has come for so long, s: nobody knows
/// where it is. Less stops it between the updates of a slow environment.
constexpr double kLongestUnheard = 0.25;

/// Work in a second of searching for contacts (geometry::Work): about a tick for each tick, for
/// what the worlds that are shipped take at worst. More: ticks are late where much overlaps. Less:
/// contacts are cut that a tick has the time for.
constexpr double kWorkPerSecond = 1.25e9;

/// Of something whose origin has that twist, and which reaches so far from it, m.
double speed(const Twist& V, double reach) noexcept {
  return V.head<3>().norm() + reach * V.tail<3>().norm();
}

void copy_reported(const LocalContacts& from, LocalContacts& to) noexcept {
  to.clear();
  for (const LocalContact& contact : from) {
    if (!contact.of_scene) to.push_back(contact);
  }
}

/// Those of bodies that are moved ahead of reports stay.
void keep_reported(MetContacts& met, const UpdateFrames& frames) noexcept {
  erase_if(met, [&](const MetContact& contact) {
    return !is_ahead(contact.a, frames) && !is_ahead(contact.b, frames);
  });
}

void sort_by_identity(LocalContacts& contacts) noexcept {
  if (!std::ranges::is_sorted(contacts, {}, &LocalContact::identity)) {
    std::ranges::sort(contacts, {}, &LocalContact::identity);
  }
}

}  // namespace

void LocalModel::set_scene(Scene* scene) noexcept {
  scene_ = scene;
  keeps_contacts_ = false;
  change_.of_all = true;
  looked_ = false;
  if (scene == nullptr) return;
  for (const NearBody& body : near_bodies_) {
    scene_->place({SideKind::kMovableBody, body.pose.body}, body.pose.X_WB);
  }
}

/// Where tool and bodies are now, without taking anything of it.
geometry::FinderCut LocalModel::try_scene(Scene& scene) noexcept {
  Scene* const in_force = std::exchange(scene_, &scene);
  const geometry::FinderCut before = std::exchange(cut_, {});
  for (const NearBody& body : near_bodies_) {
    scene.place({SideKind::kMovableBody, body.pose.body}, body.pose.X_WB);
  }
  place_scene(proxy_, bodies_);
  MetContacts met;
  meet_tool(bodies_, contacts(), false, met);
  met.clear();
  meet_bodies(bodies_, supports(), dt_, false, met);
  scene.forget();
  scene_ = in_force;
  return std::exchange(cut_, before);
}

void LocalModel::keep_contacts() noexcept {
  scene_ = nullptr;
  keeps_contacts_ = true;
}

/// What an update says of who moves the bodies, and where those are that the environment moves. The
/// others go on here, whatever it says of them. bodies: of the update, as they are reported.
void LocalModel::adopt_poses(const ModelUpdate& update, const LocalBodies& bodies) noexcept {
  NearBodies renewed;
  for (const BodyPose& pose : update.poses) {
    NearBody& body = renewed.emplace_back();
    const NearBody* known = near_body({SideKind::kMovableBody, pose.body});
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
      advance(body.pose, update.age);
    }
    body.number = std::max(owner.number, known != nullptr ? known->number : 0);
    if (is_held(body.number)) ++body.number;  // Nobody moves it here.
    if (body.number > owner.number) body.owner = Owner::kGivenBack;
  }
  for (const NearBody& body : near_bodies_) {
    if (scene_ != nullptr) scene_->place({SideKind::kMovableBody, body.pose.body}, std::nullopt);
  }
  near_bodies_ = renewed;
}

/// The bodies that the local model moves are not there any more.
void LocalModel::forget_bodies_of_scene() noexcept {
  erase_if(near_bodies_, [&](const NearBody& body) {
    if (!is_local(body.pose.body)) return false;
    if (scene_) scene_->place({SideKind::kMovableBody, body.pose.body}, std::nullopt);
    return true;
  });
}

/// Places the tool, and the bodies: those that the local model moves as in `bodies`, others where
/// they will be so much later, s.
void LocalModel::place_scene(const ToolModel& tool, const LocalBodies& bodies,
                             double ahead) noexcept {
  for (int link = 0; link < tool.links(); ++link) {
    scene_->place({SideKind::kToolLink, static_cast<std::uint32_t>(link)}, tool.X_WL(link));
  }
  for (const NearBody& body : near_bodies_) {
    const auto local = std::ranges::find(bodies, body.pose.body, &LocalBody::id);
    BodyPose pose = body.pose;
    if (local != bodies.end()) {
      pose.X_WB = local->X_WB * body.X_CB;
    } else if (ahead > 0) {
      advance(pose, ahead);
    }
    scene_->place({SideKind::kMovableBody, body.pose.body}, pose.X_WB);
  }
}

void LocalModel::meet(std::span<const geometry::FoundContact> found, const LocalBodies& bodies,
                      MetContacts& met) const noexcept {
  for (const geometry::FoundContact& contact : found) {
    const auto a = frame_of(contact.key.a, proxy_, bodies);
    const auto b = frame_of(contact.key.b, proxy_, bodies);
    if (!a || !b || *a == kWorldFrame || met.size() == met.capacity()) continue;
    const bool of_body = contact.key.a.kind == SideKind::kMovableBody;
    if (of_body && *b != kWorldFrame && *b < *a) continue;  // The other body has found it, too.
    MetContact& one = met.emplace_back();
    one.found = &contact;
    one.identity = identity_of(contact.key);
    one.a = *a;
    one.b = *b;
    if (*b != kWorldFrame || contact.key.b.kind != SideKind::kMovableBody) continue;
    const auto moving = std::ranges::find_if(
        near_bodies_, [&](const NearBody& body) { return body.pose.body == contact.key.b.index; });
    if (moving != near_bodies_.end()) one.v_WC = velocity_at(moving->pose, contact.p_WC);
  }
}

/// What the local model does not move goes on as it was reported.
void LocalModel::advance_near_bodies() noexcept {
  looked_ = false;
  unheard_ += dt_;
  for (NearBody& body : near_bodies_) {
    if (unheard_ > kLongestUnheard) body.pose.V_W.setZero();
    advance(body.pose, dt_);
  }
}

/// How far contacts are looked for, m, of something of that speed, m/s, that moves on by steps of
/// dt, s, and has those `contacts`: deformed ones carry load where nothing touches.
double LocalModel::margin(double speed, const LocalContacts& contacts, double dt) const noexcept {
  double open = 0;
  for (const LocalContact& contact : contacts) {
    if (contact.of_scene) open = std::max(open, -contact.deformation.delta);
  }
  return std::min(open + kLeastMargin + kMarginSteps * speed * dt, kLargestMargin);
}

/// Speed of the fastest point of all bodies, m/s.
double LocalModel::fastest_body(const LocalBodies& bodies) const noexcept {
  const auto reach = [&](std::uint32_t id) { return scene_->reach({SideKind::kMovableBody, id}); };
  double fastest = 0;
  for (const NearBody& body : near_bodies_) {
    const double around = body.X_CB.p.norm() + reach(body.pose.body);
    const auto local = std::ranges::find(bodies, body.pose.body, &LocalBody::id);
    const Twist& V = local != bodies.end() ? local->V_W : body.pose.V_W;
    fastest = std::max(fastest, speed(V, around));
  }
  return fastest;
}

void LocalModel::meet_tool(const LocalBodies& bodies, const LocalContacts& existing, bool takes,
                           MetContacts& met) noexcept {
  double fastest = 0;
  for (int link = 0; link < proxy_.links(); ++link) {
    const Twist V = proxy_.jacobian(link, proxy_.X_WL(link).p).lazyProduct(v_);
    const double reach = scene_->reach({SideKind::kToolLink, static_cast<std::uint32_t>(link)});
    fastest = std::max(fastest, speed(V, reach));
  }
  const double epsilon = margin(fastest + fastest_body(bodies), existing, dt_);
  const auto found = scene_->of_tool(epsilon, work_in_tick(kWorkOfTool));
  cut_ += scene_->cut();
  if (takes) take_bearing(found);
  meet(found, bodies, met);
  sort_met(met);
}

/// Whether the tool does.
bool LocalModel::is_touched(const LocalBody& body) const noexcept {
  const ContactSide side{SideKind::kMovableBody, body.id};
  return std::ranges::any_of(contacts(), [&](const LocalContact& contact) {
    return contact.latest.loaded && contact.b == side;
  });
}

/// takes: those that bear upon them, too.
void LocalModel::meet_bodies(const LocalBodies& bodies, const LocalContacts& existing, double dt,
                             bool takes, MetContacts& met) noexcept {
  const double epsilon = margin(2 * fastest_body(bodies), existing, dt);
  const double share = (1 - kWorkOfTool - 2 * kWorkAtEnd) /
                       static_cast<double>(std::max<std::size_t>(1, bodies.size()));
  StaticVector<std::span<const geometry::FoundContact>, kMaxMovedBodies> found;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    found.push_back(scene_->of_body(bodies[i].id, epsilon, work_in_tick(share)));
    cut_ += scene_->cut();
    if (takes && (bodies[i].inertia || is_touched(bodies[i]))) take_bearing(found.back());
  }
  for (const auto& of_one : found) meet(of_one, bodies, met);
  sort_met(met);
}

std::uint64_t LocalModel::work_in_tick(double share) const noexcept {
  return static_cast<std::uint64_t>(share * kWorkPerSecond * dt_);
}

/// The contacts of the scene where tool and bodies are now.
void LocalModel::look_around() noexcept {
  GeometryChange change = std::exchange(change_, {});
  if (looked_ || (scene_ == nullptr && !change.of_all)) return;
  looked_ = true;
  cut_ = {};
  MetContacts met;
  MetContacts met_by_bodies;
  if (scene_ != nullptr) {
    place_scene(proxy_, bodies_);
    scene_->forget();
    const bool takes = scene_->holds();
    if (takes) {
      for (const LocalBody& body : bodies_) change.steady.push_back(body.id);
    }
    meet_tool(bodies_, contacts(), takes, met);
    meet_bodies(bodies_, supports(), dt_, takes, met_by_bodies);
    if (takes) give_back(met, met_by_bodies);
  }
  change.is_known_in_part = cut_ != geometry::FinderCut{};
  const FramePoses poses = poses_of(proxy_, bodies_);
  UpdateFrames frames{.tool = proxy_, .bodies = bodies_, .reported = poses, .before = poses};
  frames.now = poses;
  const LocalContacts& existing = contacts_[current_];
  const LocalContacts& existing_supports = supports_[current_];
  current_ = 1 - current_;
  LocalContacts& updated = contacts_[current_];
  copy_reported(existing, updated);
  fill_tank(renew_contacts(existing, met, frames, change, policy(), updated));
  sort_by_identity(updated);
  copy_reported(existing_supports, present_supports());
  renew_supports(existing_supports, met_by_bodies, frames, change, present_supports());
  sort_by_identity(present_supports());
}

/// What the scene's contacts are where the step ends that ends with x. Empty if not all are known.
std::optional<LocalModel::StepEnd> LocalModel::meet_at_end(const FrameMotions& frames,
                                                           const Unknowns& x) noexcept {
  ToolModel tool = proxy_;
  Velocity v = x.head(proxy_.dof());
  move_freely(tool, v, dt_);
  LocalBodies bodies = bodies_;
  Mechanisms mechanisms = mechanisms_;
  advance_bodies(bodies, mechanisms, proxy_, frames, x, dt_);
  place_scene(tool, bodies, dt_);
  scene_->forget();
  StepEnd end;
  end.poses = poses_of(tool, bodies);
  meet(scene_->of_tool_ahead(kEndMargin, work_in_tick(kWorkAtEnd)), bodies, end.met);
  if (scene_->cut() != geometry::FinderCut{}) return std::nullopt;
  return end;
}

/// A plane has no end within a step, what it stands for has. So contacts of the scene that were
/// open and act in the step that ends with x are looked for once more where it ends: what is not
/// there is left out of the step, and comes back where it touches at the end of that.
void LocalModel::correct_step(ContactGroups groups, const FrameMotions& frames,
                              const StepSystem& system, Unknowns& x) noexcept {
  if (scene_ == nullptr || cut_ != geometry::FinderCut{}) return;
  const ClosingContacts closing = find_closing(groups[0], frames, x);
  if (closing.empty()) return;
  std::optional<StepEnd> end = meet_at_end(frames, x);
  if (!end) return;
  const ClosingContacts left_out = leave_out(closing, end->met, frames, x, dt_);
  if (left_out.empty()) return;
  const Unknowns with_all = std::exchange(x, solve_contact_step(groups, frames, system));
  end = meet_at_end(frames, x);
  if (!end) {  // What may be there stays.
    x = with_all;
    for (LocalContact* contact : left_out) {
      locate(*contact, frames[contact->frame_a].X_W, frames[contact->frame_b].X_W);
    }
  } else if (bring_back(left_out, end->met, end->poses, frames, x, dt_)) {
    x = solve_contact_step(groups, frames, system);
  }
}

/// Contacts of the scene after an update, for which `bodies` are where they were reported.
void LocalModel::adopt_supports_of_scene(const LocalContacts& existing, UpdateFrames& frames,
                                         const LocalBodies& bodies) noexcept {
  if (scene_ == nullptr) return;
  change_.of_bodies = true;
  cut_ = {};
  MetContacts met;
  place_scene(proxy_, bodies);
  scene_->forget();
  meet_bodies(bodies, existing, dt_, false, met);
  keep_reported(met, frames);
  change_.is_known_in_part = cut_ != geometry::FinderCut{};
  frames.now = frames.reported;
  renew_supports(existing, met, frames, change_, present_supports());
  sort_by_identity(present_supports());
}

/// The same while bodies are brought from there to the present, in steps of dt, s: a body that runs
/// into another on the way meets it there, and not deep in it afterwards.
void LocalModel::look_along(LocalBodies& bodies, double dt) noexcept {
  if (scene_ == nullptr || geometry::Work::is_spent()) return;  // Then they go on as planes.
  MetContacts met;
  place_scene(proxy_, bodies);
  scene_->forget();
  meet_bodies(bodies, supports(), dt, false, met);
  const FramePoses poses = poses_of(proxy_, bodies);
  UpdateFrames frames{.tool = proxy_, .bodies = bodies, .reported = poses, .before = poses};
  frames.now = poses;
  keep_reported(met, frames);
  const LocalContacts existing = supports();
  copy_reported(existing, present_supports());
  renew_supports(existing, met, frames, {.is_known_in_part = cut_ != geometry::FinderCut{}},
                 present_supports());
  sort_by_identity(present_supports());
}

/// Those of the tool, with bodies where they are now.
void LocalModel::adopt_contacts_of_scene(const LocalContacts& existing, const UpdateFrames& frames,
                                         const LocalBodies& bodies) noexcept {
  GeometryChange change = std::exchange(change_, {});
  if (scene_ == nullptr && !change.of_all) return;
  MetContacts met;
  if (scene_ != nullptr) {
    place_scene(proxy_, bodies);
    scene_->forget();
    meet_tool(bodies, existing, false, met);
  }
  change.is_known_in_part = cut_ != geometry::FinderCut{};
  fill_tank(renew_contacts(existing, met, frames, change, policy(), contacts_[current_]));
  sort_by_identity(present());
  looked_ = !holds();  // What is held looks around by itself.
  change_.of_bodies = holds();
}

}  // namespace hlm::server
