#include "hlm/haptic_server/local_model/contact_update.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace hlm::server {
namespace {

bool is_tool(const ContactSide& side) noexcept { return side.kind == SideKind::kToolLink; }

/// What of the change from s_p to s_plus, and from there to sigma, the rule defers. s_plus stays
/// behind by as much.
void defer(LocalContact& contact, double sigma, std::optional<double> s_p, double& s_plus,
           const UpdatePolicy& policy) noexcept {
  const double held = std::min(s_p.value_or(0.0), 0.0);
  const bool releases = held < std::min(s_plus, 0.0);
  const bool recovers = policy.traits().ramps_depth && (held < 0 || s_plus < 0);
  const bool retains = policy.traits().releases_load && (s_plus <= 0 || releases);
  if (!recovers && !retains) return;

  LocalContact::Deformation& deformation = contact.deformation;
  deformation.deferred = (releases || recovers ? s_plus : sigma) - held;
  if (recovers) {
    deformation.deferred_step = std::abs(deformation.deferred) / policy.recovery_steps;
  } else if (releases && !touches_body(contact)) {
    deformation.deferred_step = policy.release_step();
  } else {
    deformation.deferred_step =
        std::min(policy.release_step(), policy.healing_share * std::abs(deformation.deferred));
    if (!releases || policy.healing_step > 0) {
      deformation.deferred_step = std::min(deformation.deferred_step, policy.healing_step);
    }
  }
  s_plus = held;
}

/// s_p of an existing contact, if there is one.
std::optional<double> held(const LocalContact* existing, const UpdateFrames& frames,
                           const UpdatePolicy& policy) noexcept {
  if (existing == nullptr) return std::nullopt;
  return held_separation(*existing, separation(*existing, frames.before), policy);
}

void set_tool_contact(LocalContact& contact, const Placed& placed, const LocalContact* existing,
                      const UpdateFrames& frames, double age, const UpdatePolicy& policy) noexcept {
  describe(contact, placed, frames, age);
  const Vector3 x_W = frames.moved[placed.a] * reported_point(placed);
  const double sigma = true_separation(contact, frames.now, x_W);
  contact.now.p_W = x_W;
  deform(contact, frames.now[placed.a], sigma, held(existing, frames, policy), policy);

  if (existing != nullptr) {
    inherit(contact, *existing);
    if (contact.latest.loaded && contact.frame_b == kWorldFrame &&
        existing->frame_b == kWorldFrame) {
      contact.constraint.v_WC = existing->constraint.v_WC;
    }
  } else if (policy.traits().active_only && sigma <= 0) {
    // Without history a contact that arrives penetrating is no collision: it would be one at every
    // update.
    contact.now.state = ContactState::kPenetrating;
  }
}

/// A contact among bodies and world, which begins with its load.
void set_support(LocalContact& contact, const Placed& placed, const LocalContact* existing,
                 const UpdateFrames& frames, double stiffness) noexcept {
  describe(contact, placed, frames, 0);
  const Vector3 x_W = reported_point(placed);
  const double sigma = true_separation(contact, frames.reported, x_W);
  const double load = placed.report->load;
  const double s_plus = load > 0 ? -load / stiffness : std::max(sigma, 0.0);
  contact.material.ahead = touches_reported(contact, frames);
  place_contact_point(contact, frames.reported[placed.a], x_W, sigma, s_plus);
  if (existing != nullptr) inherit(contact, *existing);
}

void advance_constraint(LocalContact& contact, double dt) noexcept {
  LocalContact::Constraint& constraint = contact.constraint;
  if (contact.frame_b == kWorldFrame) constraint.c_B += constraint.v_constr * dt * constraint.n_P;
}

/// How much of what was deferred a step gives, m. What adds force is paid for from the tank.
double due(const LocalContact& contact, const FramePoses& poses, const UpdatePolicy& policy,
           double& tank) noexcept {
  const LocalContact::Deformation& deformation = contact.deformation;
  const double given =
      std::clamp(deformation.deferred, -deformation.deferred_step, deformation.deferred_step);
  if (given > 0) {
    // Once the contact is open, giving back the rest changes no force.
    return separation(contact, poses) >= 0 ? deformation.deferred : given;
  }
  if (!policy.traits().releases_load) return given;
  if (!contact.latest.loaded) return 0;
  const double cost =
      contact.latest.f_W.dot(contact.now.n_W) * -given + 0.5 * policy.stiffness * given * given;
  if (cost > tank) return 0;
  tank -= cost;
  return given;
}

/// Walks along the reports with the existing contact of the same identity or null, and along the
/// existing contacts that are not reported. Those of the scene are no reports.
template <class Reported, class Unreported>
void match(const PlacedReports& reports, const LocalContacts& existing, Reported reported,
           Unreported unreported) noexcept {
  auto old = existing.begin();
  const auto skip_those_of_scene = [&] {
    while (old != existing.end() && old->of_scene) ++old;
    return old != existing.end();
  };
  for (const Placed& placed : reports) {
    while (skip_those_of_scene() && old->identity < placed.report->identity) unreported(*old++);
    const bool known = skip_those_of_scene() && old->identity == placed.report->identity;
    reported(placed, known ? &*old++ : nullptr);
  }
  while (skip_those_of_scene()) unreported(*old++);
}

}  // namespace

void place_contact_point(LocalContact& contact, const Placement& X_WA, const Vector3& x_W,
                         double sigma, double s_plus) noexcept {
  contact.now.p_W = x_W + (s_plus - sigma) * contact.now.n_W;
  contact.deformation.p_A = X_WA.R.transpose() * (contact.now.p_W - X_WA.p);
  contact.now.s = contact.latest.s_left = s_plus;
}

bool touches_body(const LocalContact& contact) noexcept {
  const auto is_local_body = [](const ContactSide& side, FrameIndex frame) {
    return side.kind == SideKind::kMovableBody && frame != kWorldFrame;
  };
  return is_local_body(contact.a, contact.frame_a) || is_local_body(contact.b, contact.frame_b);
}

bool goes_over(LocalContact& contact, const UpdateFrames& frames) noexcept {
  const auto lacks = [](FrameIndex before, FrameIndex now) {
    return before != kWorldFrame && now == kWorldFrame;
  };
  const auto a = frame_of(contact.a, frames.tool, frames.bodies).value_or(kWorldFrame);
  const auto b = frame_of(contact.b, frames.tool, frames.bodies).value_or(kWorldFrame);
  if (lacks(contact.frame_a, a) || lacks(contact.frame_b, b)) return false;
  contact.frame_a = a;
  contact.frame_b = b;
  return true;
}

bool is_ahead(FrameIndex frame, const UpdateFrames& frames) noexcept {
  const FrameIndex first = frame_of_body(frames.tool, 0);
  return frame >= first && !frames.bodies[static_cast<std::size_t>(frame - first)].inertia;
}

bool touches_reported(const LocalContact& contact, const UpdateFrames& frames) noexcept {
  return is_ahead(contact.frame_a, frames) || is_ahead(contact.frame_b, frames);
}

LocalContact& add_to(LocalContacts& contacts) noexcept {
  contacts.resize(contacts.size() + 1, boost::container::default_init);
  return contacts.back();
}

void deform(LocalContact& contact, const Placement& X_WA, double sigma, std::optional<double> s_p,
            const UpdatePolicy& policy) noexcept {
  double s_plus = updated_separation(policy.rule, sigma, s_p);
  defer(contact, sigma, s_p, s_plus, policy);
  place_contact_point(contact, X_WA, contact.now.p_W, sigma, s_plus);
}

double held_separation(const LocalContact& known, double s, const UpdatePolicy& policy) noexcept {
  return known.orphaned() ? std::max(s, -std::max(0.0, known.deformation.cap) / policy.stiffness)
                          : s;
}

void inherit(LocalContact& contact, const LocalContact& known) noexcept {
  contact.friction.z_W =
      known.friction.z_W - contact.now.n_W.dot(known.friction.z_W) * contact.now.n_W;
  contact.friction.slipping = known.friction.slipping;
  contact.latest.loaded = known.latest.loaded;
  contact.now.state = known.now.state;
  contact.latest.f_W = known.latest.f_W;
}

bool release(LocalContact& contact, const UpdatePolicy& policy) noexcept {
  const double f_n =
      std::max(contact.latest.f_W.dot(contact.now.n_W), -policy.stiffness * contact.now.s);
  if (!policy.traits().releases_load || contact.now.s >= 0 || f_n <= 0) return false;
  contact.deformation.cap = std::min(contact.deformation.cap, f_n);
  contact.deformation.deferred = 0;
  return true;
}

std::optional<LocalContact> released(LocalContact contact, const UpdateFrames& frames,
                                     const UpdatePolicy& policy) noexcept {
  locate(contact, frames.before[contact.frame_a], frames.before[contact.frame_b]);
  const auto a = frame_of(contact.a, frames.tool, frames.bodies);
  if (!release(contact, policy) || !a || *a == kWorldFrame) return std::nullopt;
  LocalContact::Constraint& constraint = contact.constraint;
  contact.frame_a = *a;
  contact.frame_b = frame_of(contact.b, frames.tool, frames.bodies).value_or(kWorldFrame);
  if (contact.frame_b == kWorldFrame) constraint.plane = PlaneOwner::kB;
  const Placement& X_WA = frames.now[contact.frame_a];
  const Placement& X_WB = frames.now[contact.frame_b];
  contact.deformation.p_A = X_WA.inverse() * contact.now.p_W;
  constraint.c_B = X_WB.inverse() * contact.now.c_W;
  constraint.n_P =
      (constraint.plane == PlaneOwner::kA ? X_WA : X_WB).R.transpose() * contact.now.n_W;
  contact.of_scene = false;
  return contact;
}

void add_released(LocalContacts& contacts, LocalContacts& orphans) noexcept {
  const std::size_t room = contacts.capacity() - contacts.size();
  if (orphans.size() > room) {
    std::nth_element(
        orphans.begin(), orphans.begin() + static_cast<std::ptrdiff_t>(room), orphans.end(),
        [](const auto& x, const auto& y) { return x.deformation.cap > y.deformation.cap; });
    orphans.resize(room);
  }
  contacts.insert(contacts.end(), orphans.begin(), orphans.end());
  std::sort(contacts.begin(), contacts.end(),
            [](const auto& x, const auto& y) { return x.identity < y.identity; });
}

double updated_separation(UpdateRule rule, double sigma, std::optional<double> s_p) noexcept {
  if (!traits(rule).keeps_deformation) return sigma;
  return std::max(sigma, s_p ? std::min(*s_p, 0.0) : 0.0);
}

double adopt_update(const LocalContacts& existing, const ReportedContacts& reported,
                    const UpdateFrames& frames, double age, const UpdatePolicy& policy,
                    LocalContacts& updated) noexcept {
  const bool only_active = policy.traits().active_only;
  const PlacedReports reports = sorted_reports(
      reported, frames, [](const ReportedContact& report) noexcept { return is_tool(report.a); });
  updated.clear();
  LocalContacts orphans;
  const auto orphan = [&](const LocalContact& contact) {
    if (!policy.traits().releases_load) return;
    if (const auto left = released(contact, frames, policy)) orphans.push_back(*left);
  };
  double unspent = 0;
  match(
      reports, existing,
      [&](const Placed& placed, const LocalContact* known) {
        if (only_active && placed.report->separation > 0) return;
        LocalContact& contact = add_to(updated);
        set_tool_contact(contact, placed, known, frames, age, policy);
        if (known == nullptr || !contact.latest.loaded || !touches_body(contact)) return;
        unspent += contact.latest.f_W.dot(contact.now.n_W) *
                   (known->deformation.deferred - contact.deformation.deferred);
      },
      orphan);
  if (!orphans.empty()) add_released(updated, orphans);
  return unspent;
}

void release_bodies(LocalContacts& contacts, const UpdateFrames& frames,
                    const UpdatePolicy& policy) noexcept {
  erase_if(contacts, [&](LocalContact& contact) {
    if (!touches_body(contact)) return false;
    const auto orphan = released(contact, frames, policy);
    if (orphan) contact = *orphan;
    return !orphan || !policy.traits().releases_load;
  });
}

void adopt_supports(const LocalContacts& existing, const ReportedContacts& reported,
                    const UpdateFrames& frames, double stiffness, LocalContacts& updated) noexcept {
  const PlacedReports reports =
      sorted_reports(reported, frames, [](const ReportedContact& report) noexcept {
        return !is_tool(report.a) && !is_tool(report.b);
      });
  updated.clear();
  match(
      reports, existing,
      [&](const Placed& placed, const LocalContact* known) {
        set_support(add_to(updated), placed, known, frames, stiffness);
      },
      [](const LocalContact&) {});
}

void advance_constraints(LocalContacts& contacts, double dt) noexcept {
  for (LocalContact& contact : contacts) advance_constraint(contact, dt);
}

void advance_contacts(LocalContacts& contacts, const FramePoses& poses, const UpdatePolicy& policy,
                      double dt, double& tank) noexcept {
  const double largest_change =
      policy.release_force / policy.damping;  // m/s; infinite without damping
  const auto orphans = std::count_if(contacts.begin(), contacts.end(),
                                     [](const auto& contact) { return contact.orphaned(); });
  for (LocalContact& contact : contacts) {
    LocalContact::Constraint& constraint = contact.constraint;
    LocalContact::Deformation& deformation = contact.deformation;
    advance_constraint(contact, dt);
    contact.latest.s_left = contact.now.s;
    if (contact.frame_b == kWorldFrame) {
      contact.latest.s_left -= constraint.v_constr * dt;
      const Vector3 change = constraint.v_reported_W - constraint.v_WC;
      const double size = contact.latest.loaded ? change.norm() : 0;
      constraint.v_WC += size > largest_change ? Vector3(largest_change / size * change) : change;
    }
    if (contact.orphaned()) deformation.cap -= policy.release_force / static_cast<double>(orphans);
    if (deformation.deferred == 0) continue;
    const double given = due(contact, poses, policy, tank);
    const Placement& X_WA = poses[contact.frame_a];
    const Vector3 n_W = normal_W(contact, X_WA, poses[contact.frame_b]);
    deformation.p_A += given * (X_WA.R.transpose() * n_W);
    deformation.delta += given;
    deformation.deferred -= given;
    contact.latest.s_left += given;
  }
  if (orphans == 0) return;
  erase_if(contacts, [&](const LocalContact& contact) {
    return contact.orphaned() && (contact.deformation.cap <= 0 || separation(contact, poses) >= 0);
  });
}

}  // namespace hlm::server
