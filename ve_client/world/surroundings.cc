#include "hlm/ve_client/world/surroundings.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "hlm/geometry/index.h"
#include "hlm/ve_client/world/joint_limits.h"
#include "hlm/ve_client/world/mobility.h"

namespace hlm::ve {
namespace {

/// A contact with a smaller separation carries what its pair of bodies carries, m. Resting bodies
/// overlap by some 0.03 mm; larger lets a raised edge carry, smaller drops contacts of a body that
/// trembles.
constexpr double kTouching = 1e-4;
/// A body with less mobility than this part of its own is held by its joints.
constexpr double kHeld = 1e-6;

int body_of(const ContactSide& side) { return static_cast<int>(side.index); }

bool contains(const std::vector<int>& bodies, int body) {
  return std::ranges::find(bodies, body) != bodies.end();
}

bool by_key(const FoundContact& a, const FoundContact& b) { return a.key < b.key; }

}  // namespace

Surroundings::Surroundings(World& world, Proximity& proximity)
    : world_(world), proximity_(proximity) {
  for (int body = 0; body < static_cast<int>(world.description().bodies.size()); ++body) {
    const double own = 1 / world.description().bodies[at(body)].mass;
    pushable_.push_back(world.is_movable(body) && world.mobility_of(body).W.norm() > kHeld * own);
    round_.push_back(roundness_of(world.description(), body));
  }
}

bool Surroundings::is_reported(int body) const { return contains(reported_, body); }

bool Surroundings::reports(const ContactSide& side) const {
  return side.kind != SideKind::kToolLink && is_reported(static_cast<int>(side.index));
}

bool Surroundings::is_obstacle(int body) const {
  return !pushable_[at(body)] || contains(left_out_, body);
}

ContactSide Surroundings::side_of(int body) const {
  return {is_reported(body) ? SideKind::kMovableBody : SideKind::kWorld,
          static_cast<std::uint32_t>(body)};
}

void Surroundings::find(std::span<FoundContact> tool_contacts, double epsilon, bool shapes,
                        std::function<bool(int body)> left_to) {
  left_to_ = std::move(left_to);
  reported_.clear();
  left_out_.clear();
  passed_.clear();
  bodies_.clear();
  contacts_.clear();
  if (left_to_ && leaves_all()) tool_contacts = {};
  std::vector<FoundContact*> with_bodies;  // The others are of the tool's links with each other.
  for (FoundContact& contact : tool_contacts) {
    if (contact.key.b.kind != SideKind::kToolLink) with_bodies.push_back(&contact);
  }
  std::ranges::stable_sort(with_bodies, {}, &FoundContact::separation);
  for (const FoundContact* contact : with_bodies) {
    if (contact->axis == 0) report(body_of(contact->key.b));  // The others say no distance.
  }
  for (FoundContact* contact : with_bodies) contact->key.b = side_of(body_of(contact->key.b));

  // What lies on a body that somebody else moves is met, too.
  for (std::size_t i = 0, k = 0; i < reported_.size() || k < passed_.size();) {
    add_contacts_of(i < reported_.size() ? reported_[i++] : passed_[k++], epsilon);
  }
  std::erase_if(contacts_, [&](const FoundContact& contact) {
    return contains(passed_, body_of(contact.key.a));
  });
  // Only now it is known which of them are reported.
  for (FoundContact& contact : contacts_) contact.key.b = side_of(body_of(contact.key.b));
  std::erase_if(contacts_, [](const FoundContact& contact) {  // Both bodies have found it.
    return contact.key.b.kind == SideKind::kMovableBody &&
           contact.key.b.index < contact.key.a.index;
  });
  if (shapes) contacts_.clear();
  share_loads();
  for (int i = 0; i < static_cast<int>(world_.description().joints.size()); ++i) {
    add_limits(i, epsilon);
  }
  keep_most_telling(kMaxContacts - (shapes ? 0 : tool_contacts.size()));
  left_to_ = {};

  for (const int body : reported_) {
    MovableBody& movable = bodies_.emplace_back();
    movable.id = static_cast<std::uint32_t>(body);
    movable.p_WCom = world_.X_WB(body).p;
    movable.V_W = world_.V_WB(body);
    const Mobility mobility = world_.mobility_of(body);
    movable.W = mobility.W;
    movable.A_W = mobility.A_W;
    movable.roundness = round_[at(body)].kind;
    movable.axis_W = world_.X_WB(body).R * round_[at(body)].axis_B;
  }
}

bool Surroundings::leaves_all() const {
  for (int body = 0; body < static_cast<int>(pushable_.size()); ++body) {
    if (pushable_[at(body)] && !left_to_(body)) return false;
  }
  return true;
}

/// Takes a body in if it can be pushed and there is room.
void Surroundings::report(int body) {
  if (!pushable_[at(body)] || is_reported(body) || contains(passed_, body)) return;
  if (left_to_ && left_to_(body)) return passed_.push_back(body);
  if (reported_.size() < kMaxBodiesAhead) {
    reported_.push_back(body);
  } else if (!contains(left_out_, body)) {
    left_out_.push_back(body);
  }
}

void Surroundings::add_contacts_of(int body, double epsilon) {
  for (const FoundContact& found : proximity_.query(body, epsilon)) {
    FoundContact& contact = contacts_.emplace_back(found);
    if (contact.friction < 0) contact.friction = kDefaultFriction;
    report(body_of(contact.key.b));
  }
}

/// The force of two bodies on each other goes to those of their contacts that touch, each by its
/// own part of it in the engine.
void Surroundings::share_loads() {
  const auto same_pair = [](const FoundContact& a, const FoundContact& b) {
    return a.key.a.index == b.key.a.index && a.key.b.index == b.key.b.index;
  };
  for (auto first = contacts_.begin(); first != contacts_.end();) {
    // The contacts of two bodies follow each other: one query found them. Of several shapes, the
    // contacts with another body may stand between.
    const auto pair = std::stable_partition(
        first, contacts_.end(), [&, key = *first](const auto& c) { return same_pair(c, key); });
    const double total = world_.loads().load(body_of(first->key.a), body_of(first->key.b));
    double own = 0;
    int touching = 0;
    for (auto contact = first; contact != pair; ++contact) {
      if (contact->separation > kTouching) continue;
      ++touching;
      contact->load = std::max(0.0, world_.loads().load(contact->key));
      own += contact->load;
    }
    for (auto contact = first; contact != pair; ++contact) {
      if (contact->separation > kTouching) continue;
      contact->load = std::max(0.0, own > 0 ? contact->load * total / own : total / touching);
    }
    first = pair;
  }
}

void Surroundings::add_limits(int joint, double epsilon) {
  const JointDescription& description = world_.description().joints[at(joint)];
  const bool child = is_reported(description.child);
  const bool parent = description.parent >= 0 && is_reported(description.parent);
  if (!child && !parent) return;
  const std::size_t before = contacts_.size();
  find_limits(world_, joint, epsilon, contacts_);
  for (std::size_t i = before; i < contacts_.size(); ++i) {
    if (!child) contacts_[i] = reversed(contacts_[i], world_);
    if (child && parent) contacts_[i].key.b.kind = SideKind::kMovableBody;
  }
}

void Surroundings::keep_most_telling(std::size_t count) {
  if (contacts_.size() > count) {
    std::ranges::sort(contacts_, by_key);
    std::ranges::stable_sort(contacts_, [](const FoundContact& a, const FoundContact& b) {
      if ((a.load > 0) != (b.load > 0)) return a.load > 0;
      return a.separation < b.separation;
    });
    contacts_.resize(count);
  }
  std::ranges::sort(contacts_, by_key);
}

}  // namespace hlm::ve
