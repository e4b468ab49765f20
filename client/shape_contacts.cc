#include "hlm/client/shape_contacts.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>

#include "hlm/geometry/select_pairs.h"

namespace hlm {
namespace {

using namespace geometry;

/// A pose that is off by no more, m per m from the origin and rad, is the same: single precision.
constexpr double kSamePlace = 1e-5;
constexpr double kSamePlaceFar = 1e-6;
constexpr double kSameTurn = 1e-5;
/// Links of a tool.
constexpr std::uint32_t kMostLinks = 1000;

/// How far shapes may be from the origin, m, and the least length of a quaternion.
constexpr double kFarthest = 1e7;
constexpr double kSmallest = 1e-6;

bool is_usable(const Pose& X) {
  const double length = X.R.coeffs().norm();
  return X.p.norm() <= kFarthest && std::isfinite(length) && length > kSmallest;
}

Pose normalised(const Pose& X) { return {X.p, X.R.normalized()}; }

bool are_same(const Pose& a, const Pose& b) {
  return (a.p - b.p).norm() <= kSamePlace + kSamePlaceFar * a.p.norm() &&
         a.R.angularDistance(b.R) <= kSameTurn;
}

}  // namespace

ShapeContacts::ShapeContacts(std::vector<BodyShape> shapes, MayTouch may_touch)
    : may_touch_(std::move(may_touch)) {
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    try {
      add(i, std::move(shapes[i]));
    } catch (const std::exception& error) {
      throw std::invalid_argument("shape " + std::to_string(i) + ": " + error.what());
    }
  }
}

void ShapeContacts::add(std::size_t place, BodyShape given) {
  const std::uint32_t first =
      shapes_.empty()
          ? 0
          : shapes_.back().first + static_cast<std::uint32_t>(shapes_.back().parts.pieces.size());
  Entry& entry = shapes_.emplace_back();
  entry.side = given.side;
  entry.first = first;
  const bool of_tool = given.side.kind == SideKind::kToolLink;
  if (of_tool && given.side.index >= kMostLinks) {
    throw std::invalid_argument("link " + std::to_string(given.side.index) + " must be less than " +
                                std::to_string(kMostLinks));
  }
  const auto* shape = std::get_if<Shape>(&given.shape);
  if (shape && std::holds_alternative<HalfSpace>(*shape) && given.side.kind != SideKind::kWorld) {
    throw std::invalid_argument("a half-space must be the world's");
  }
  entry.parts = parts_of(std::move(given.shape), std::to_string(place));
  if (of_tool && entry.parts.is_skin()) {
    throw std::invalid_argument("a mesh of the tool must be convex: divide it into hulls");
  }
}

/// Finds which shapes move as one, by their sides and by where they are.
void ShapeContacts::arrange(std::span<const Pose> X_WS) {
  bodies_.clear();
  shape_of_.clear();
  std::map<std::pair<ContactSide, bool>, int> known;
  for (std::size_t i = 0; i < shapes_.size(); ++i) {
    Entry& entry = shapes_[i];
    entry.is_loose = entry.is_loose || !is_usable(X_WS[i]);
    entry.body = static_cast<int>(bodies_.size());
    if (!entry.is_loose) {
      entry.body = known.try_emplace({entry.side, entry.has_moved}, entry.body).first->second;
    }
    const auto body = static_cast<std::size_t>(entry.body);
    if (body == bodies_.size()) {
      const bool is_fixed =
          entry.side.kind == SideKind::kWorld && !entry.is_loose && !entry.has_moved;
      bodies_.push_back({.side = entry.side, .shape = i, .is_fixed = is_fixed});
      shape_of_.emplace_back();
    }
    const Pose X_WF = bodies_[body].is_fixed ? Pose{} : normalised(X_WS[bodies_[body].shape]);
    entry.X_FS = entry.is_loose ? Pose{} : X_WF.inverse() * normalised(X_WS[i]);
    entry.first_of_body = static_cast<int>(shape_of_[body].size());
    shape_of_[body].insert(shape_of_[body].end(), entry.parts.pieces.size(), i);
  }
  make_finder();
}

void ShapeContacts::make_finder() {
  std::vector<PieceSource> sources;
  for (const Entry& entry : shapes_) {
    for (std::size_t i = 0; i < entry.parts.pieces.size(); ++i) {
      sources.push_back({.id = {entry.body, entry.first_of_body + static_cast<int>(i)},
                         .convex = &entry.parts.pieces[i],
                         .X_FG = entry.X_FS,
                         .fixed = bodies_[static_cast<std::size_t>(entry.body)].is_fixed,
                         .mesh = entry.parts.is_skin() ? entry.parts.skins[i] : nullptr,
                         .triangle = entry.parts.is_skin() ? entry.parts.triangles[i] : 0});
    }
  }
  std::ranges::sort(sources, {}, &PieceSource::id);
  pieces_ = std::make_unique<Pieces>(sources);
  std::vector<ContactFinder::Body> of_finder;
  for (const Body& body : bodies_) {
    const bool of_tool = body.side.kind == SideKind::kToolLink;
    of_finder.push_back({.link = of_tool ? static_cast<int>(body.side.index) : -1,
                         .movable = body.side.kind == SideKind::kMovableBody});
  }
  finder_ = std::make_unique<ContactFinder>(
      *pieces_, std::move(of_finder),
      [this](const CollisionId& a, const CollisionId& b) { return may_touch(a, b); });
}

/// Moves the bodies. False if a shape has moved against its body, which is arranged anew then.
bool ShapeContacts::place(std::span<const Pose> X_WS) {
  bool fits = true;
  X_WB_.assign(bodies_.size(), Pose{});
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    Body& body = bodies_[i];
    body.is_placed = body.is_fixed || is_usable(X_WS[body.shape]);
    if (body.is_fixed || !body.is_placed) continue;
    X_WB_[i] = normalised(X_WS[body.shape]);
    finder_->place(static_cast<int>(i), X_WB_[i]);
  }
  for (std::size_t i = 0; i < shapes_.size(); ++i) {
    Entry& entry = shapes_[i];
    const auto body = static_cast<std::size_t>(entry.body);
    if (entry.is_loose) continue;
    const bool stays =
        is_usable(X_WS[i]) && are_same(X_WB_[body] * entry.X_FS, normalised(X_WS[i]));
    if (stays) continue;
    fits = false;
    if (bodies_[body].is_fixed && is_usable(X_WS[i])) {
      entry.has_moved = true;
    } else {
      entry.is_loose = true;
    }
  }
  return fits;
}

std::size_t ShapeContacts::shape_of(const CollisionId& piece) const {
  return shape_of_[static_cast<std::size_t>(piece.body)][static_cast<std::size_t>(piece.shape)];
}

std::uint32_t ShapeContacts::number_of(const CollisionId& piece) const {
  const Entry& entry = shapes_[shape_of(piece)];
  return entry.first + static_cast<std::uint32_t>(piece.shape - entry.first_of_body);
}

/// The contact with names that outlive an arrangement: pieces by their numbers among all.
FoundContact ShapeContacts::named(FoundContact contact) const {
  const auto name = [&](ContactSide& side, Feature& feature, const CollisionId& found) {
    // Of the fixed bodies it may be another one than where it was found.
    const bool of_fixed = pieces_->is_fixed(found.body);
    const int body = of_fixed ? static_cast<int>(side.index) : found.body;
    const CollisionId piece{body, static_cast<int>(feature.shape)};
    side.index = shapes_[shape_of(piece)].side.index;
    feature.shape = number_of(piece);
  };
  name(contact.key.a, contact.key.a_feature, contact.own);
  name(contact.key.b, contact.key.b_feature, contact.other);
  ContactKey of_pair = contact.key;
  of_pair.a_feature.shape = number_of(contact.own);
  of_pair.b_feature.shape = number_of(contact.other);
  of_pair.b.index = shapes_[shape_of(contact.other)].side.index;
  contact.pair = pair_of(of_pair);
  return contact;
}

std::vector<FoundContact> ShapeContacts::contacts_of(std::span<const int> bodies,
                                                     const ContactFinder::Search& search) {
  std::vector<FoundContact> contacts;
  for (const FoundContact& contact : finder_->find(bodies, search)) {
    contacts.push_back(named(contact));
  }
  return contacts;
}

bool ShapeContacts::may_touch(const CollisionId& a, const CollisionId& b) const {
  const Body& body_a = bodies_[static_cast<std::size_t>(a.body)];
  const Body& body_b = bodies_[static_cast<std::size_t>(b.body)];
  if (!body_a.is_placed || !body_b.is_placed) return false;
  if (body_b.side.kind == SideKind::kToolLink || body_a.side == body_b.side) return false;
  return !may_touch_ || may_touch_(shape_of(a), shape_of(b));
}

std::span<const ShapeContacts::Found> ShapeContacts::find(std::span<const Pose> X_WS,
                                                          double epsilon) {
  if (!finder_) arrange(X_WS);
  while (!place(X_WS)) arrange(X_WS);  // Each time more shapes are on their own.
  found_.clear();
  find_of_tool(epsilon);
  find_of_bodies(epsilon);
  return found_;
}

void ShapeContacts::find_of_tool(double epsilon) {
  std::vector<int> links;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const bool of_tool = bodies_[i].side.kind == SideKind::kToolLink && bodies_[i].is_placed;
    if (of_tool) links.push_back(static_cast<int>(i));
  }
  std::vector<FoundContact> contacts =
      contacts_of(links, {.epsilon = epsilon, .all_axes = true, .of_tool = true});
  const auto X_WL = [&](int link) {
    const auto of_link = std::ranges::find_if(links, [&](int body) {
      return static_cast<int>(bodies_[static_cast<std::size_t>(body)].side.index) == link;
    });
    return X_WB_[static_cast<std::size_t>(*of_link)];
  };
  skin_contacts_.name(*pieces_, X_WL, contacts);
  const auto all = [](const ContactSide&) { return true; };
  for (const FoundContact& contact :
       select_pairs(selection_, std::move(contacts), epsilon, {}, all)) {
    report(contact);
  }
}

void ShapeContacts::find_of_bodies(double epsilon) {
  std::vector<int> near;  // In the order in which they were met.
  const auto meet = [&](const CollisionId& other) {
    const bool movable =
        bodies_[static_cast<std::size_t>(other.body)].side.kind == SideKind::kMovableBody;
    const bool is_new = std::ranges::find(near, other.body) == near.end();
    if (movable && is_new && near.size() < kMaxBodies) near.push_back(other.body);
  };
  std::vector<Found> of_tool = found_;
  std::ranges::stable_sort(of_tool, {}, [](const Found& one) { return one.contact.separation; });
  for (const Found& found : of_tool) {
    if (found.contact.axis == 0) meet({shapes_[found.shape_b].body, 0});
  }
  std::vector<FoundContact> contacts;
  std::size_t done = 0;
  for (int hop = 0; hop < 2; ++hop) {
    for (const std::size_t end = near.size(); done < end; ++done) {
      for (const FoundContact& contact : contacts_of({&near[done], 1}, {.epsilon = epsilon})) {
        const auto known = near.begin() + static_cast<std::ptrdiff_t>(done);
        if (std::find(near.begin(), known, contact.other.body) != known) continue;
        contacts.push_back(contact);
      }
      for (const FoundContact& contact : contacts) meet(contact.other);
    }
  }
  const std::size_t room = kMaxContacts - found_.size();
  if (contacts.size() > room) {
    const auto selected = selection_of_bodies_.select(contacts, {});
    contacts = std::vector<FoundContact>(selected.begin(), selected.end());
  }
  for (const FoundContact& contact : contacts) report(contact);
}

void ShapeContacts::report(const FoundContact& contact) {
  Found& found = found_.emplace_back();
  found.contact = reports_of({&contact, 1})[0];
  found.shape_a = shape_of(contact.own);
  found.shape_b = shape_of(contact.other);
  found.contact.a = shapes_[found.shape_a].side;
  found.contact.b = shapes_[found.shape_b].side;
}

}  // namespace hlm
