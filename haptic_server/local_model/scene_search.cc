#include "hlm/haptic_server/local_model/scene_search.h"

#include <algorithm>

#include "hlm/geometry/work.h"

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

/// Work in a second of searching for contacts (geometry::Work): about a tick for each tick, for
/// what the worlds that are shipped take at worst. More: ticks are late where much overlaps. Less:
/// contacts are cut that a tick has the time for.
constexpr double kWorkPerSecond = 1.25e9;
/// Shares of a tick's work of searching: the tool's, which is what is felt, and each look of it at
/// the end of a step, of which there are two at most; bodies have the rest.
constexpr double kWorkOfTool = 1 - SceneSearch::kWorkOfBodies;
constexpr double kWorkAtEnd = 0.05;

/// Of something whose origin has that twist, and which reaches so far from it, m.
double speed(const Twist& V, double reach) noexcept {
  return V.head<3>().norm() + reach * V.tail<3>().norm();
}

/// How far contacts are looked for, m, of something of that speed, m/s, that moves on by steps of
/// dt, s, and has those `contacts`: deformed ones carry load where nothing touches.
double margin(double speed, const LocalContacts& contacts, double dt) noexcept {
  double open = 0;
  for (const LocalContact& contact : contacts) {
    if (contact.of_scene) open = std::max(open, -contact.deformation.delta);
  }
  return std::min(open + kLeastMargin + kMarginSteps * speed * dt, kLargestMargin);
}

}  // namespace

void SceneSearch::set_scene(Scene* scene, const NearBodies& near) noexcept {
  scene_ = scene;
  keeps_contacts_ = false;
  change_.of_all = true;
  looked_ = false;
  if (scene == nullptr) return;
  for (const NearBody& body : near) {
    scene->place({SideKind::kMovableBody, body.pose.body}, body.pose.X_WB);
  }
}

void SceneSearch::keep_contacts() noexcept {
  scene_ = nullptr;
  keeps_contacts_ = true;
}

void SceneSearch::place(const Around& around, double ahead) noexcept {
  for (int link = 0; link < around.tool.links(); ++link) {
    scene_->place({SideKind::kToolLink, static_cast<std::uint32_t>(link)}, around.tool.X_WL(link));
  }
  for (const NearBody& body : around.near) {
    const auto local = std::ranges::find(around.bodies, body.pose.body, &LocalBody::id);
    BodyPose pose = body.pose;
    if (local != around.bodies.end()) {
      pose.X_WB = local->X_WB * body.X_CB;
    } else if (ahead > 0) {
      advance(pose, ahead);
    }
    scene_->place({SideKind::kMovableBody, body.pose.body}, pose.X_WB);
  }
  scene_->forget();
}

/// Speed of the fastest point of all bodies, m/s.
double SceneSearch::fastest_body(const Around& around) const noexcept {
  double fastest = 0;
  for (const NearBody& body : around.near) {
    const double reach = scene_->reach({SideKind::kMovableBody, body.pose.body});
    const auto local = std::ranges::find(around.bodies, body.pose.body, &LocalBody::id);
    const Twist& V = local != around.bodies.end() ? local->V_W : body.pose.V_W;
    fastest = std::max(fastest, speed(V, body.X_CB.p.norm() + reach));
  }
  return fastest;
}

std::span<const geometry::FoundContact> SceneSearch::of_tool(
    const Around& around, const LocalContacts& existing) noexcept {
  double fastest = 0;
  for (int link = 0; link < around.tool.links(); ++link) {
    const Twist V = around.tool.jacobian(link, around.tool.X_WL(link).p).lazyProduct(around.v);
    const double reach = scene_->reach({SideKind::kToolLink, static_cast<std::uint32_t>(link)});
    fastest = std::max(fastest, speed(V, reach));
  }
  const double epsilon = margin(fastest + fastest_body(around), existing, dt_);
  const auto found = scene_->of_tool(epsilon, work_in_tick(kWorkOfTool));
  cut_ += scene_->cut();
  return found;
}

SceneSearch::Reach SceneSearch::reach_of_bodies(const Around& around, const LocalContacts& existing,
                                                double dt) const noexcept {
  const double share = (kWorkOfBodies - 2 * kWorkAtEnd) /
                       static_cast<double>(std::max<std::size_t>(1, around.bodies.size()));
  return {.epsilon = margin(2 * fastest_body(around), existing, dt), .work = work_in_tick(share)};
}

std::span<const geometry::FoundContact> SceneSearch::of_body(std::uint32_t id,
                                                             const Reach& reach) noexcept {
  const auto found = scene_->of_body(id, reach.epsilon, reach.work);
  cut_ += scene_->cut();
  return found;
}

std::optional<MetContacts> SceneSearch::of_tool_at_end(const Around& around) noexcept {
  place(around, dt_);
  MetContacts met;
  meet(scene_->of_tool_ahead(kEndMargin, work_in_tick(kWorkAtEnd)), around, met);
  if (scene_->cut() != geometry::FinderCut{}) return std::nullopt;
  return met;
}

void SceneSearch::meet(std::span<const geometry::FoundContact> found, const Around& around,
                       MetContacts& met) const noexcept {
  for (const geometry::FoundContact& contact : found) {
    const auto a = frame_of(contact.key.a, around.tool, around.bodies);
    const auto b = frame_of(contact.key.b, around.tool, around.bodies);
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
        around.near, [&](const NearBody& body) { return body.pose.body == contact.key.b.index; });
    if (moving != around.near.end()) one.v_WC = velocity_at(moving->pose, contact.p_WC);
  }
}

std::uint64_t SceneSearch::work_in_tick(double share) const noexcept {
  return static_cast<std::uint64_t>(share * kWorkPerSecond * dt_);
}

}  // namespace hlm::server
