#include "haptic_server/local_model/contact_update.h"

#include <algorithm>

namespace hlm::server {
namespace {

bool by_key(const LocalContact& a, const LocalContact& b) { return a.key < b.key; }

/// Most updates come sorted, and contacts are large to move.
void sort_by_key(LocalContacts& contacts) noexcept {
  if (!std::is_sorted(contacts.begin(), contacts.end(), by_key)) {
    std::sort(contacts.begin(), contacts.end(), by_key);
  }
}

const LocalContact* find(const LocalContacts& contacts, const ContactKey& key) noexcept {
  const auto at =
      std::lower_bound(contacts.begin(), contacts.end(), key,
                       [](const LocalContact& c, const ContactKey& k) { return c.key < k; });
  return at != contacts.end() && at->key == key ? &*at : nullptr;
}

/// Deforms the proxy: places the local contact point so that Eq. 3 gives s_plus now, over the foot
/// of the tool's true point x_W on the constraint.
void place_contact_point(LocalContact& contact, const Pose& X_WL, const Vector3& x_W,
                         double s_plus) noexcept {
  const Vector3 foot = x_W - contact.n_W.dot(x_W - contact.c_W) * contact.n_W;
  contact.p_L = X_WL.inverse() * (foot + s_plus * contact.n_W);
}

/// The friction anchor and the history of an existing contact survive its update.
void inherit(LocalContact& contact, const LocalContact& existing) noexcept {
  contact.z_W = existing.z_W - contact.n_W.dot(existing.z_W) * contact.n_W;
  contact.slipping = existing.slipping;
  contact.loaded = existing.loaded;
  contact.state = existing.state;
}

void set_local_contact(LocalContact& contact, const ReportedContact& reported,
                       const LocalContact* existing, const ToolModel& ve_tool,
                       const ToolModel& proxy, double age, UpdateRule rule) noexcept {
  const Pose& X_WL = proxy.X_WL(reported.key.link);
  contact.key = reported.key;
  contact.n_W = reported.n_W;
  contact.v_WC = reported.v_WC;
  contact.v_constr = reported.n_W.dot(reported.v_WC);
  contact.c_W = reported.p_WC + contact.v_constr * age * contact.n_W;

  const Vector3 p_true = ve_tool.X_WL(reported.key.link).inverse() *
                         (reported.p_WC + reported.separation * reported.n_W);
  const Vector3 x_W = X_WL * p_true;
  const double sigma = contact.n_W.dot(x_W - contact.c_W);

  std::optional<double> s_p;
  if (existing != nullptr) s_p = separation(*existing, proxy);
  double s_plus = updated_separation(rule, sigma, s_p);
  if (rule == UpdateRule::kRetain && s_p && *s_p < 0 && *s_p < s_plus) {
    contact.release = s_plus - *s_p;
    s_plus = *s_p;
  }
  place_contact_point(contact, X_WL, x_W, s_plus);

  if (existing != nullptr) {
    inherit(contact, *existing);
  } else if (rule == UpdateRule::kIntermediateRepresentation && sigma <= 0) {
    // Without history a contact that arrives penetrating is no collision: it would be one at every
    // update.
    contact.state = ContactState::kPenetrating;
  }
}

/// Contacts that carry load but are no longer reported are released, not dropped. Both are sorted.
void retain_unreported(LocalContacts& updated, const LocalContacts& existing,
                       const ToolModel& proxy) noexcept {
  const std::size_t reported = updated.size();
  std::size_t at = 0;
  for (const LocalContact& contact : existing) {
    if (updated.size() == updated.capacity()) return;
    while (at < reported && updated[at].key < contact.key) ++at;
    if (at < reported && updated[at].key == contact.key) continue;
    const double s = separation(contact, proxy);
    if (s >= 0) continue;
    LocalContact& retained = updated.emplace_back(contact);
    retained.orphaned = true;
    retained.release = -s;
  }
}

}  // namespace

double updated_separation(UpdateRule rule, double sigma, std::optional<double> s_p) noexcept {
  switch (rule) {
    case UpdateRule::kRetain:
    case UpdateRule::kPaper:
      return std::max(sigma, s_p ? std::min(*s_p, 0.0) : 0.0);
    case UpdateRule::kIntermediateRepresentation:
      return sigma;
  }
  return sigma;
}

LocalContacts adopt_update(const LocalContacts& existing, const ReportedContacts& reported,
                           const ToolModel& ve_tool, const ToolModel& proxy, double age,
                           UpdateRule rule) noexcept {
  const bool only_active = rule == UpdateRule::kIntermediateRepresentation;
  LocalContacts updated;
  for (const ReportedContact& contact : reported) {
    if (only_active && contact.separation > 0) continue;
    set_local_contact(updated.emplace_back(), contact, find(existing, contact.key), ve_tool, proxy,
                      age, rule);
  }
  sort_by_key(updated);
  updated.erase(std::unique(updated.begin(), updated.end(),
                            [](const auto& a, const auto& b) { return a.key == b.key; }),
                updated.end());
  if (rule == UpdateRule::kRetain) {
    retain_unreported(updated, existing, proxy);
    sort_by_key(updated);
  }
  return updated;
}

void advance_contacts(LocalContacts& contacts, const ToolModel& proxy, double dt,
                      double release_rate) noexcept {
  for (LocalContact& contact : contacts) {
    contact.c_W += contact.v_constr * dt * contact.n_W;
    if (contact.release <= 0) continue;
    // Once the contact is open, giving back the rest changes no force.
    const bool open = separation(contact, proxy) >= 0;
    const double given = open ? contact.release : std::min(contact.release, release_rate * dt);
    contact.p_L += proxy.X_WL(contact.key.link).R.conjugate() * (given * contact.n_W);
    contact.release -= given;
  }
  erase_if(contacts, [&](const LocalContact& contact) {
    return contact.orphaned && (contact.release <= 0 || separation(contact, proxy) >= 0);
  });
}

}  // namespace hlm::server
