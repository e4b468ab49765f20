#include "hlm/local_model/pair_axes.h"

#include <algorithm>
#include <limits>

#include "hlm/local_model/contact_forces.h"

namespace hlm::server {
namespace {

void measure(const LocalContacts& contacts, double dt, PairAxes& axes) noexcept {
  for (const LocalContact& contact : contacts) {
    if (contact.axis == kOnlyAxis || contact.orphaned()) continue;
    PairAxis& axis = axes[contact.axis];
    axis.gap = std::min(axis.gap, contact.now.s);
    axis.next = std::min(axis.next, contact.now.s + dt * contact.now.v_n);
  }
}

/// Whether an axis is to act rather than another one: that it stays open in this step counts most,
/// then whether it may carry load, then its gap.
bool is_better(const PairAxis& axis, const PairAxis& other, double advantage) noexcept {
  const bool stays_open = axis.next > 0;
  if (stays_open != (other.next > 0)) return stays_open;
  if (!stays_open && axis.bears != other.bears) return axis.bears;
  return axis.gap > other.gap + advantage;
}

/// Evaluates the gaps of all axes.
void measure(const ToolContacts& contacts, double dt, PairAxes& axes) noexcept {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  for (PairAxis& axis : axes) axis.gap = axis.next = kNone;
  measure(contacts.acting, dt, axes);
  measure(contacts.waiting, dt, axes);
  for (PairAxis& axis : axes) {  // One without contacts separates nothing.
    if (axis.gap == kNone) axis.gap = axis.next = -kNone;
  }
}

/// The contact as it waits: without load or history, and where the rule has deferred a change of
/// its separation, with that change.
LocalContact at_rest(LocalContact contact, const FrameMotions& frames) noexcept {
  const Matrix3& R_WA = frames[contact.frame_a].X_W.R;
  contact.deformation.p_A += R_WA.transpose() * (contact.deformation.deferred * contact.now.n_W);
  contact.deformation.deferred = 0;
  contact.constraint.v_WC = contact.constraint.v_reported_W;
  contact.now.state = ContactState::kImpending;
  contact.friction.z_W.setZero();
  contact.latest.f_W.setZero();
  contact.latest.taken = 0;
  contact.friction.slipping = contact.latest.loaded = false;
  return contact;
}

/// The contact as it begins to act. known: its own load of before that is still being released, or
/// null.
void start(LocalContact& contact, const LocalContact* known, const FrameMotions& frames,
           const UpdatePolicy& policy) noexcept {
  const double sigma = contact.now.s;
  std::optional<double> s_p;
  if (known != nullptr) s_p = held_separation(*known, known->now.s, policy);
  deform(contact, frames[contact.frame_a].X_W, sigma, s_p, policy);
  if (known != nullptr) inherit(contact, *known);
  if (contact.now.s > 0) {
    contact.now.state = ContactState::kImpending;
  } else if (contact.now.v_n > 0) {
    contact.now.state = ContactState::kSeparating;
  } else if (known == nullptr) {
    contact.now.state = ContactState::kColliding;
  }
}

}  // namespace

bool decide_axes(PairAxes& axes) noexcept {
  bool changed = false;
  for (std::size_t first = 0; first < axes.size();) {
    const auto is_of_pair = [&](std::size_t i) { return i < axes.size() && axes[i].pair == first; };
    std::size_t acting = first;
    while (is_of_pair(acting + 1) && !axes[acting].acts) ++acting;
    std::size_t best = acting;
    std::size_t i = first;
    for (; is_of_pair(i); ++i) {
      if (is_better(axes[i], axes[best], best == acting ? kAxisAdvantage : 0)) best = i;
    }
    changed = changed || best != acting;
    for (std::size_t j = first; j < i; ++j) axes[j].acts = j == best;
    first = i;
  }
  return changed;
}

void choose_axes(ToolContacts& contacts, const FrameMotions& frames, const UpdatePolicy& policy,
                 double dt) noexcept {
  LocalContacts& acting = contacts.acting;
  LocalContacts& waiting = contacts.waiting;
  PairAxes& axes = contacts.axes;
  if (waiting.empty()) return;
  evaluate_contacts(waiting, frames);
  measure(contacts, dt, axes);
  if (!decide_axes(axes)) return;

  const auto acts = [&](const LocalContact& contact) {
    return contact.axis == kOnlyAxis || axes[contact.axis].acts;
  };
  const std::size_t waited = waiting.size();
  for (LocalContact& contact : acting) {
    if (acts(contact)) continue;
    waiting.push_back(at_rest(contact, frames));
    if (!release(contact, policy)) contact.deformation.cap = 0;
    contact.axis = kOnlyAxis;
  }
  erase_if(acting, [](const LocalContact& contact) { return contact.deformation.cap == 0; });
  for (std::size_t i = 0; i < waited; ++i) {
    LocalContact& contact = waiting[i];
    if (!acts(contact)) continue;
    const auto known = std::find_if(acting.begin(), acting.end(), [&](const LocalContact& other) {
      return !other.of_scene && other.identity == contact.identity;
    });
    start(contact, known == acting.end() ? nullptr : &*known, frames, policy);
    if (known != acting.end()) {
      *known = contact;
    } else if (acting.size() < acting.capacity()) {
      acting.push_back(contact);
    }
  }
  erase_if(waiting, acts);
  std::sort(acting.begin(), acting.end(),
            [](const auto& x, const auto& y) { return x.identity < y.identity; });
}

}  // namespace hlm::server
