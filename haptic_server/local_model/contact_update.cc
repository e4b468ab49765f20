#include "haptic_server/local_model/contact_update.h"

#include <algorithm>

namespace hlm::server {
namespace {

using ReportsByIdentity = StaticVector<const ReportedContact*, kMaxContacts>;

/// Whether the local model has a place for the contact: the tool on side a, and not on both.
bool is_usable(const ReportedContact& contact, const ToolModel& tool) noexcept {
  return contact.a.kind == SideKind::kToolLink && contact.b.kind != SideKind::kToolLink &&
         contact.a.index < static_cast<std::uint32_t>(tool.links());
}

/// The reports that a rule uses, sorted by identity, of equal ones the first.
ReportsByIdentity sorted_reports(const ReportedContacts& reported, const ToolModel& tool,
                                 UpdateRule rule) noexcept {
  const bool only_active = rule == UpdateRule::kIntermediateRepresentation;
  ReportsByIdentity sorted;
  for (const ReportedContact& contact : reported) {
    if (!is_usable(contact, tool)) continue;
    if (!only_active || contact.separation <= 0) sorted.push_back(&contact);
  }
  const auto before = [](const auto* a, const auto* b) {
    return a->identity != b->identity ? a->identity < b->identity : a < b;
  };
  if (!std::is_sorted(sorted.begin(), sorted.end(), before)) {
    std::sort(sorted.begin(), sorted.end(), before);
  }
  const auto same = [](const auto* a, const auto* b) { return a->identity == b->identity; };
  sorted.erase(std::unique(sorted.begin(), sorted.end(), same), sorted.end());
  return sorted;
}

/// Deforms the proxy: places the local contact point so that Eq. 3 gives s_plus now, over the foot
/// of the tool's true point x_W on the constraint.
void place_contact_point(LocalContact& contact, const Pose& X_WL, const Vector3& x_W,
                         double s_plus) noexcept {
  const Vector3 foot = x_W - contact.n_W.dot(x_W - contact.c_W) * contact.n_W;
  contact.p_L = X_WL.R.conjugate() * (foot + s_plus * contact.n_W - X_WL.p);
}

/// The friction anchor and the history of an existing contact survive its update.
void inherit(LocalContact& contact, const LocalContact& existing) noexcept {
  contact.z_W = existing.z_W - contact.n_W.dot(existing.z_W) * contact.n_W;
  contact.slipping = existing.slipping;
  contact.loaded = existing.loaded;
  contact.state = existing.state;
}

/// What of the change from s_p to s_plus the rule defers: s_plus stays behind by as much.
void defer(LocalContact& contact, std::optional<double> s_p, double& s_plus,
           const UpdatePolicy& policy) noexcept {
  const double held = std::min(s_p.value_or(0.0), 0.0);
  if (policy.rule == UpdateRule::kRetain && held < std::min(s_plus, 0.0)) {
    contact.deferred_step = policy.release_step;
  } else if (policy.rule == UpdateRule::kPlaneRecovery && (held < 0 || s_plus < 0)) {
    contact.deferred_step = std::abs(s_plus - held) / policy.recovery_steps;
  } else {
    return;
  }
  contact.deferred = s_plus - held;
  s_plus = held;
}

void set_local_contact(LocalContact& contact, const ReportedContact& reported,
                       const LocalContact* existing, const ToolModel& ve_tool,
                       const ToolModel& proxy, double age, const UpdatePolicy& policy) noexcept {
  const auto link = static_cast<int>(reported.a.index);
  const Pose& X_WL = proxy.X_WL(link);
  contact.identity = reported.identity;
  contact.a = reported.a;
  contact.b = reported.b;
  contact.friction = reported.friction;
  contact.n_W = reported.n_W;
  contact.v_WC = reported.v_WC;
  contact.v_constr = reported.n_W.dot(reported.v_WC);
  contact.c_W = reported.p_WC + contact.v_constr * age * contact.n_W;

  const Pose& X_WL_VE = ve_tool.X_WL(link);
  const Vector3 p_true =
      X_WL_VE.R.conjugate() * (reported.p_WC + reported.separation * reported.n_W - X_WL_VE.p);
  const Vector3 x_W = X_WL * p_true;
  const double sigma = contact.n_W.dot(x_W - contact.c_W);

  std::optional<double> s_p;
  if (existing != nullptr) s_p = separation(*existing, proxy);
  double s_plus = updated_separation(policy.rule, sigma, s_p);
  defer(contact, s_p, s_plus, policy);
  place_contact_point(contact, X_WL, x_W, s_plus);

  if (existing != nullptr) {
    inherit(contact, *existing);
  } else if (policy.rule == UpdateRule::kIntermediateRepresentation && sigma <= 0) {
    // Without history a contact that arrives penetrating is no collision: it would be one at every
    // update.
    contact.state = ContactState::kPenetrating;
  }
}

/// Rule `retain`: a contact that carries load but is no longer reported is released, not dropped.
LocalContact released(const LocalContact& contact, double s, const UpdatePolicy& policy) noexcept {
  LocalContact retained = contact;
  retained.orphaned = true;
  retained.deferred = -s;
  retained.deferred_step = policy.release_step;
  return retained;
}

}  // namespace

double updated_separation(UpdateRule rule, double sigma, std::optional<double> s_p) noexcept {
  switch (rule) {
    case UpdateRule::kRetain:
    case UpdateRule::kPaper:
      return std::max(sigma, s_p ? std::min(*s_p, 0.0) : 0.0);
    case UpdateRule::kIntermediateRepresentation:
    case UpdateRule::kPlaneRecovery:
      return sigma;
  }
  return sigma;
}

void adopt_update(const LocalContacts& existing, const ReportedContacts& reported,
                  const ToolModel& ve_tool, const ToolModel& proxy, double age,
                  const UpdatePolicy& policy, LocalContacts& updated) noexcept {
  const ReportsByIdentity reports = sorted_reports(reported, proxy, policy.rule);
  updated.clear();
  std::size_t room = policy.rule == UpdateRule::kRetain ? updated.capacity() - reports.size() : 0;
  const auto pass_unreported = [&](const LocalContact& contact) {
    const double s = separation(contact, proxy);
    if (room == 0 || s >= 0) return;
    --room;
    updated.push_back(released(contact, s, policy));
  };

  auto old = existing.begin();
  for (const ReportedContact* report : reports) {
    while (old != existing.end() && old->identity < report->identity) pass_unreported(*old++);
    const bool known = old != existing.end() && old->identity == report->identity;
    set_local_contact(updated.emplace_back(), *report, known ? &*old++ : nullptr, ve_tool, proxy,
                      age, policy);
  }
  while (old != existing.end()) pass_unreported(*old++);
}

void advance_contacts(LocalContacts& contacts, const ToolModel& proxy, double dt) noexcept {
  for (LocalContact& contact : contacts) {
    contact.c_W += contact.v_constr * dt * contact.n_W;
    if (contact.deferred == 0) continue;
    // Once the contact is open, giving back the rest changes no force.
    const bool open = contact.deferred > 0 && separation(contact, proxy) >= 0;
    const double given =
        open ? contact.deferred
             : std::clamp(contact.deferred, -contact.deferred_step, contact.deferred_step);
    contact.p_L += proxy.X_WL(contact.link()).R.conjugate() * (given * contact.n_W);
    contact.deferred -= given;
  }
  erase_if(contacts, [&](const LocalContact& contact) {
    return contact.orphaned && (contact.deferred <= 0 || separation(contact, proxy) >= 0);
  });
}

}  // namespace hlm::server
