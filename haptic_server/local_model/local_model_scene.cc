// What the local model meets in the geometry near the hand (docs/method.md 18).
#include <algorithm>
#include <utility>

#include "hlm/geometry/work.h"
#include "hlm/haptic_server/local_model/free_motion.h"
#include "hlm/haptic_server/local_model/local_model.h"

namespace hlm::server {
namespace {

/// A body bears upon the tool, or upon one that does, where they are no farther apart than this, m:
/// engines leave some space between what rests. Larger takes what only passes.
constexpr double kTouches = 2e-4;
/// Or where they will be so in so many steps: what is hit must be there when it is.
constexpr double kStepsAhead = 2;

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

/// From frame to frame until no more is reached: which frames are in touch with the tool.
class Reached {
 public:
  explicit Reached(FrameIndex first_body) noexcept : first_(first_body) {}

  /// Of two frames that bear upon each other. Whether that is new.
  bool join(FrameIndex a, FrameIndex b) noexcept {
    if (a < first_ || b < first_) {
      if (b >= first_) reached_[b] = true;
      return false;
    }
    const bool changes = reached_[a] != reached_[b];
    if (changes) reached_[a] = reached_[b] = true;
    return changes;
  }
  bool has(FrameIndex frame) const noexcept { return reached_[frame]; }

 private:
  FrameIndex first_;
  StaticVector<bool, kMaxFrames> reached_ = StaticVector<bool, kMaxFrames>(kMaxFrames, false);
};

}  // namespace

/// Where tool and bodies are now, without taking anything of it.
geometry::FinderCut LocalModel::try_scene(Scene& scene) noexcept {
  SceneSearch trial(dt_);
  trial.set_scene(&scene, bodies_.near());
  std::swap(search_, trial);
  search_.place(around(bodies()));
  MetContacts met;
  meet_tool(around(bodies()), contacts(), false, met);
  met.clear();
  meet_bodies(around(bodies()), supports(), dt_, false, met);
  scene.forget();
  std::swap(search_, trial);
  return trial.cut();
}

UpdateFrames LocalModel::frames_here(const LocalBodies& bodies) const noexcept {
  const FramePoses poses = poses_of(proxy_, bodies);
  UpdateFrames frames{.tool = proxy_, .bodies = bodies, .reported = poses, .before = poses};
  frames.now = poses;
  return frames;
}

void LocalModel::meet_tool(const Around& around, const LocalContacts& existing, bool takes,
                           MetContacts& met) noexcept {
  const auto found = search_.of_tool(around, existing);
  if (takes) take_bearing(found);
  search_.meet(found, around, met);
  sort_met(met);
}

/// takes: those that bear upon them, too.
void LocalModel::meet_bodies(const Around& around, const LocalContacts& existing, double dt,
                             bool takes, MetContacts& met) noexcept {
  const SceneSearch::Reach reach = search_.reach_of_bodies(around, existing, dt);
  StaticVector<std::span<const geometry::FoundContact>, kMaxMovedBodies> found;
  for (std::size_t i = 0; i < around.bodies.size(); ++i) {
    const LocalBody& body = around.bodies[i];
    found.push_back(search_.of_body(body.id, reach));
    if (takes && (body.inertia || is_touched(body))) take_bearing(found.back());
  }
  for (const auto& of_one : found) search_.meet(of_one, around, met);
  sort_met(met);
}

/// Whether the tool does.
bool LocalModel::is_touched(const LocalBody& body) const noexcept {
  const ContactSide side{SideKind::kMovableBody, body.id};
  return std::ranges::any_of(contacts(), [&](const LocalContact& contact) {
    return contact.latest.loaded && contact.b == side;
  });
}

bool LocalModel::bears(const geometry::FoundContact& found) const noexcept {
  const auto velocity_of = [&](const ContactSide& side) -> Vector3 {
    if (side.kind != SideKind::kToolLink) return bodies_.velocity_of(side, found.p_WC);
    return proxy_.point_jacobian(static_cast<int>(side.index), found.p_WC).lazyProduct(v_);
  };
  const Vector3 v = velocity_of(found.key.a) - velocity_of(found.key.b);
  const double ahead = std::min(0.0, found.n_W.dot(v)) * kStepsAhead * dt_;
  return found.separation + ahead <= kTouches;
}

/// Takes the bodies that bear upon the tool, or upon one that is taken already.
void LocalModel::take_bearing(std::span<const geometry::FoundContact> found) noexcept {
  for (const geometry::FoundContact& contact : found) {
    for (const ContactSide& side : {contact.key.a, contact.key.b}) {
      if (side.kind != SideKind::kMovableBody || bodies_.is_local(side.index)) continue;
      if (bears(contact) && bodies_.take(side, *search_.scene())) reframe_contacts();
    }
  }
}

/// Which of the bodies bear upon the tool, themselves or by others; those that have not for a while
/// are given back.
void LocalModel::give_back(const MetContacts& met, const MetContacts& met_by_bodies) noexcept {
  const FrameIndex first = frame_of_body(proxy_, 0);
  Reached reached(first);
  for (const MetContact& contact : met) {
    if (bears(*contact.found)) reached.join(contact.a, contact.b);
  }
  for (const LocalContact& contact : contacts()) {
    if (contact.latest.loaded) reached.join(contact.frame_a, contact.frame_b);
  }
  for (bool changes = true; changes;) {
    changes = false;
    for (const MetContact& contact : met_by_bodies) {
      if (contact.b < first || contact.a < first || !bears(*contact.found)) continue;
      changes = reached.join(contact.a, contact.b) || changes;
    }
    for (std::size_t slot = 1; slot < bodies().size(); ++slot) {
      if (bodies()[slot].member == 0) continue;  // It is none of the one before.
      const FrameIndex frame = frame_of_body(proxy_, slot);
      changes = reached.join(frame, static_cast<FrameIndex>(frame - 1)) || changes;
    }
  }
  StaticVector<bool, kMaxMovedBodies> bearing;
  for (std::size_t slot = 0; slot < bodies().size(); ++slot) {
    bearing.push_back(reached.has(frame_of_body(proxy_, slot)));
  }
  bodies_.give_back({bearing.data(), bearing.size()}, dt_);
}

/// The contacts of the scene where tool and bodies are now.
void LocalModel::look_around() noexcept {
  GeometryChange change = search_.take_change();
  if (!search_.must_look() || (scene() == nullptr && !change.of_all)) return;
  search_.set_looked(true);
  search_.begin();
  MetContacts met;
  MetContacts met_by_bodies;
  if (scene() != nullptr) {
    search_.place(around(bodies()));
    const bool takes = holds();
    if (takes) {
      for (const LocalBody& body : bodies()) change.steady.push_back(body.id);
    }
    meet_tool(around(bodies()), contacts(), takes, met);
    meet_bodies(around(bodies()), supports(), dt_, takes, met_by_bodies);
    if (takes) give_back(met, met_by_bodies);
  }
  change.is_known_in_part = search_.is_cut();
  const UpdateFrames frames = frames_here(bodies());
  const LocalContacts& existing = contacts();
  const LocalContacts& existing_supports = supports();
  contacts_.renew();
  copy_reported(existing, contacts_.contacts());
  tank_.fill(renew_contacts(existing, met, frames, change, policy(), contacts_.contacts()));
  sort_by_identity(contacts_.contacts());
  copy_reported(existing_supports, contacts_.supports());
  renew_supports(existing_supports, met_by_bodies, frames, change, contacts_.supports());
  sort_by_identity(contacts_.supports());
}

/// What the scene's contacts are where the step ends that ends with x. Empty if not all are known.
std::optional<LocalModel::StepEnd> LocalModel::meet_at_end(const FrameMotions& frames,
                                                           const Unknowns& x) noexcept {
  ToolModel tool = proxy_;
  Velocity v = x.head(proxy_.dof());
  move_freely(tool, v, dt_);
  LocalBodies bodies = this->bodies();
  Mechanisms mechanisms = bodies_.mechanisms();
  advance_bodies(bodies, mechanisms, proxy_, frames, x, dt_);
  std::optional<MetContacts> met = search_.of_tool_at_end({tool, v, bodies, bodies_.near()});
  if (!met) return std::nullopt;
  return StepEnd{poses_of(tool, bodies), *met};
}

/// A plane has no end within a step, what it stands for has. So contacts of the scene that were
/// open and act in the step that ends with x are looked for once more where it ends: what is not
/// there is left out of the step, and comes back where it touches at the end of that.
void LocalModel::correct_step(ContactGroups groups, const FrameMotions& frames,
                              const StepSystem& system, Unknowns& x) noexcept {
  if (scene() == nullptr || search_.is_cut()) return;
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
  if (scene() == nullptr) return;
  GeometryChange& change = search_.change();
  change.of_bodies = true;
  search_.begin();
  MetContacts met;
  search_.place(around(bodies));
  meet_bodies(around(bodies), existing, dt_, false, met);
  keep_reported(met, frames);
  change.is_known_in_part = search_.is_cut();
  frames.now = frames.reported;
  renew_supports(existing, met, frames, change, contacts_.supports());
  sort_by_identity(contacts_.supports());
}

/// The same while bodies are brought from there to the present, in steps of dt, s: a body that runs
/// into another on the way meets it there, and not deep in it afterwards.
void LocalModel::look_along(LocalBodies& bodies, double dt) noexcept {
  if (scene() == nullptr || geometry::Work::is_spent()) return;  // Then they go on as planes.
  MetContacts met;
  search_.place(around(bodies));
  meet_bodies(around(bodies), supports(), dt, false, met);
  const UpdateFrames frames = frames_here(bodies);
  keep_reported(met, frames);
  const LocalContacts existing = supports();
  copy_reported(existing, contacts_.supports());
  renew_supports(existing, met, frames, {.is_known_in_part = search_.is_cut()},
                 contacts_.supports());
  sort_by_identity(contacts_.supports());
}

/// Those of the tool, with bodies where they are now.
void LocalModel::adopt_contacts_of_scene(const LocalContacts& existing, const UpdateFrames& frames,
                                         const LocalBodies& bodies) noexcept {
  GeometryChange change = search_.take_change();
  if (scene() == nullptr && !change.of_all) return;
  MetContacts met;
  if (scene() != nullptr) {
    search_.place(around(bodies));
    meet_tool(around(bodies), existing, false, met);
  }
  change.is_known_in_part = search_.is_cut();
  tank_.fill(renew_contacts(existing, met, frames, change, policy(), contacts_.contacts()));
  sort_by_identity(contacts_.contacts());
  search_.set_looked(!holds());  // What is held looks around by itself.
  search_.change().of_bodies = holds();
}

}  // namespace hlm::server
