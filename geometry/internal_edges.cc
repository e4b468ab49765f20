#include "hlm/geometry/internal_edges.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

#include "hlm/geometry/surface_normal.h"
#include "hlm/geometry/work.h"

namespace hlm::geometry {
namespace {

/// Normals of one contact set that differ by less are equal (unit vectors): rounding.
constexpr double kSameNormal = 1e-9;
/// A normal this near to those of a surface is one of them, rad: 0.06°.
constexpr double kIsNormal = 1e-3;
/// A contact whose normal is within this angle of a face's, rad, is one with that face.
constexpr double kOfFace = 0.1;
/// How much smaller, m, the gap of an axis may be than the best one's, which is no surface's, to
/// stand in for it: a tool at an internal edge may be pressed in deeper than it reaches beyond.
/// More would throw out a tool that is pressed into the walls of a hole.
constexpr double kStandsIn = 1e-3;
/// How far out of a piece, m, its nearest point is outermost in that direction.
constexpr double kOutwards = 0.01;

/// A contact as one of its pieces sees it, in the frame of that piece's assembly.
struct Meeting {
  FoundContact contact;
  Vector3 n = Vector3::UnitZ();        ///< Out of the piece, unit.
  Vector3 at = Vector3::Zero();        ///< Point on the piece, m.
  Vector3 opposite = Vector3::Zero();  ///< Point on the other shape, m.
  bool moved = false;                  ///< Whether it is not as it was found.
};

/// What the border of a face is at a contact.
struct Border {
  bool goes_on = false;                  ///< The face does so beyond it, in another piece's.
  bool within = false;                   ///< And the overlap of the two shapes has no corner there.
  std::optional<std::size_t> open_face;  ///< The piece's face at which the surface ends.
};

/// Those of the contacts of a pair, from one on, that are on its axis.
std::span<Meeting> axis_from(std::span<Meeting> meetings, std::size_t begin) {
  const auto first = meetings.begin() + static_cast<std::ptrdiff_t>(begin);
  return {first, std::find_if(first, meetings.end(), [n = first->n](const Meeting& meeting) {
            return (meeting.n - n).norm() > kSameNormal;
          })};
}

double gap_of(std::span<const Meeting> set) {
  return std::ranges::min_element(set, {},
                                  [](const Meeting& meeting) { return meeting.contact.separation; })
      ->contact.separation;
}

/// Resolves the contacts of a pair for one of its pieces.
class Resolver {
 public:
  Resolver(const Pieces& pieces, const PairSide& own, const PairSide& other, bool own_is_b)
      : pieces_(pieces),
        own_(own.piece),
        other_(other.piece),
        own_is_b_(own_is_b),
        X_WF_(own.X_WG * own.piece.X_FG.inverse()),
        X_FO_(X_WF_.inverse() * other.X_WG) {}

  /// Returns whether other pairs may have the same contacts.
  bool resolve(std::vector<FoundContact>& contacts, std::size_t first);

 private:
  Feature& own_feature(FoundContact& contact) const {
    return own_is_b_ ? contact.key.b_feature : contact.key.a_feature;
  }
  Feature& other_feature(FoundContact& contact) const {
    return own_is_b_ ? contact.key.a_feature : contact.key.b_feature;
  }
  Meeting seen(const FoundContact& contact) const;
  FoundContact reported(Meeting meeting);

  bool is_on_surface(const Vector3& n, const Vector3& p_F) const;
  bool is_on_surface(std::span<const Meeting> set) const;
  bool put_on_surface(Meeting& meeting) const;
  Vector3 keep_best(std::span<Meeting> set, bool real, std::vector<FoundContact>& contacts);
  bool goes_on_along(std::span<const Meeting> axis) const;
  bool is_beside(const Meeting& meeting) const;
  bool is_behind_skin(const Meeting& meeting) const;
  bool is_off_skin(const FoundContact& contact) const;
  bool is_felt_here(const Meeting& meeting, const PiecesAtPoint& pieces) const;
  bool settle(Meeting& meeting);
  std::optional<std::size_t> face_at(const Meeting& meeting) const;
  Border border_at(const Meeting& meeting, const Vector3& n, const PiecesAtPoint& pieces) const;
  bool put_on_corner(Meeting& meeting) const;
  bool put_on_edge(Meeting& meeting) const;
  void name(FoundContact& contact, const CollisionId& id, FeatureKind kind, std::uint16_t index);
  void name_surface(FoundContact& contact, std::size_t face);
  void name_border(FoundContact& contact, std::size_t face, std::size_t other_face);

  const Pieces& pieces_;
  const Piece& own_;
  const Piece& other_;
  bool own_is_b_;
  Pose X_WF_;
  Pose X_FO_;  ///< Pose of the other shape.
  bool shared_ = false;
  /// Where the contacts on the best axis are.
  StaticVector<Vector3, AxesManifold::static_capacity> best_at_;
};

Meeting Resolver::seen(const FoundContact& contact) const {
  const Pose X_FW = X_WF_.inverse();
  const Vector3 on_b = X_FW * contact.p_WC;
  const Vector3 on_a = X_FW * (contact.p_WC + contact.separation * contact.n_W);
  const Vector3 n = X_FW.R * contact.n_W;
  return own_is_b_ ? Meeting{contact, n, on_b, on_a} : Meeting{contact, -n, on_a, on_b};
}

FoundContact Resolver::reported(Meeting meeting) {
  FoundContact& contact = meeting.contact;
  const Feature& feature = own_feature(contact);
  if (feature.kind == FeatureKind::kVertex && feature.index < own_.corners.size() &&
      feature.shape == static_cast<std::uint32_t>(own_.id.shape)) {
    const Piece::Surface& corner = own_.corners[feature.index];
    if (corner.shared) name(contact, corner.id, FeatureKind::kVertex, corner.face);
  }
  contact.plane = plane_of(contact.key.a_feature, contact.key.b_feature);  // Some are renamed.
  if (!meeting.moved) return contact;
  contact.n_W = X_WF_.R * (own_is_b_ ? meeting.n : Vector3(-meeting.n));
  contact.p_WC = X_WF_ * (own_is_b_ ? meeting.at : meeting.opposite);
  contact.separation = meeting.n.dot(meeting.opposite - meeting.at);
  return contact;
}

/// Whether n is a normal of the surface where the piece is nearest to a point.
bool Resolver::is_on_surface(const Vector3& n, const Vector3& p_F) const {
  const Vector3 nearest = within(own_, p_F);
  return (surface_normal(n, nearest, pieces_at(own_, nearest)) - n).norm() < kIsNormal;
}

/// Whether the normal of a set of contacts is one of the surface at any of them or in their middle.
/// One such place is enough: a floor goes on under the walls that stand on its border.
bool Resolver::is_on_surface(std::span<const Meeting> set) const {
  const Vector3& n = set.front().n;
  // The points on another axis than the best may be next to the piece, far over it.
  const Vector3 outwards = set.front().contact.axis > 0 ? Vector3(kOutwards * n) : Vector3::Zero();
  const auto is_on = [&](const Vector3& at) { return is_on_surface(n, at + outwards); };
  Vector3 middle = Vector3::Zero();
  for (const Meeting& meeting : set) {
    if (is_on(meeting.at) || Work::is_spent()) return true;
    middle += meeting.at / static_cast<double>(set.size());
  }
  return set.size() > 1 && is_on(middle);
}

/// Gives a contact the normal of the surface, if it is over its point then: no more than a gap
/// next to it.
bool Resolver::put_on_surface(Meeting& meeting) const {
  // Outermost points may be far beside the piece, where it does not know what goes on.
  if (!contains(own_, meeting.at, kEdgeGap)) return false;
  const Vector3 n = surface_normal(meeting.n, meeting.at, pieces_at(own_, meeting.at));
  if (n.isZero(0)) return false;
  meeting.opposite += other_.convex->margin() * (meeting.n - n);
  const Vector3 from = meeting.opposite - meeting.at;
  if (across(from, n).norm() > kEdgeGap) return false;
  meeting.n = n;
  meeting.at = meeting.opposite - from.dot(n) * n;
  meeting.moved = true;
  return true;
}

/// The face of the piece that a contact is with.
std::optional<std::size_t> Resolver::face_at(const Meeting& meeting) const {
  static const double cosine = std::cos(kOfFace);
  for (std::size_t i = 0; i < own_.planes.size(); ++i) {
    if (!is_surface(own_, {.face = i})) continue;
    const auto& [n, offset] = own_.planes[i];
    if (n.dot(meeting.n) < cosine) continue;
    if (std::abs(n.dot(meeting.at) - offset) <= kEdgeStep) return i;
  }
  return {};
}

/// The border of the face with normal n at a contact.
Border Resolver::border_at(const Meeting& meeting, const Vector3& n,
                           const PiecesAtPoint& pieces) const {
  const auto on_surface = [&](const Vector3& p_F, const Piece* except) {
    return std::ranges::any_of(pieces, [&](const Piece* piece) {
      return piece != except && contains(*piece, p_F, kEdgeStep);
    });
  };
  const auto under_other = [&](const Vector3& p_F) {
    const Vector3 p_O = other_.X_FG * (X_FO_.inverse() * p_F);
    return std::ranges::any_of(pieces_at(other_, p_O), [&](const Piece* piece) {
      return contains(*piece, p_O, kEdgeStep);
    });
  };
  Border border;
  for (const PieceSide& side : sides_at(own_, meeting.at, kEdgeGap)) {
    const Vector3 out = across(side.n_F, n);
    const bool is_face_itself = out.squaredNorm() < kOfFace * kOfFace;
    if (is_face_itself || side.height < -kEdgeStep || Work::is_spent()) continue;
    const Vector3 step = kEdgeGap * out.normalized();
    const Vector3 ahead = meeting.at + step;
    if (on_surface(ahead, &own_) && !is_covered(ahead + kEdgeGap * n, own_, pieces) &&
        on_surface(meeting.at - step, nullptr)) {
      border.goes_on = true;
      border.within = border.within || (under_other(meeting.opposite + step) &&
                                        under_other(meeting.opposite - step));
    } else {
      border.open_face = side.face;
    }
  }
  // Where the surface goes on all around, only the other shape has corners.
  border.within = border.within || !border.open_face;
  return border;
}

/// A contact at a border inside of a surface stands for the corner of the other shape that is over
/// the gap there, if one is.
bool Resolver::put_on_corner(Meeting& meeting) const {
  const Patch patch = other_.convex->facing(X_FO_.R.conjugate() * -meeting.n);
  for (const Patch::Corner& corner : patch.corners) {
    const Vector3 p_F = X_FO_ * corner.p - other_.convex->margin() * meeting.n;
    const Vector3 from = p_F - meeting.at;
    if (across(from, meeting.n).norm() > kEdgeGap) continue;
    meeting.opposite = p_F;
    meeting.at = p_F - from.dot(meeting.n) * meeting.n;
    meeting.moved = true;
    Feature& feature = other_feature(meeting.contact);
    feature = {corner.vertex.kind, feature.shape, corner.vertex.index};
    return true;
  }
  return false;
}

/// Puts a contact on the edge of the other shape that ends over the gap, or crosses it there.
bool Resolver::put_on_edge(Meeting& meeting) const {
  const Patch patch = other_.convex->facing(X_FO_.R.conjugate() * -meeting.n);
  for (std::size_t i = 0; i < patch.corners.size() && patch.corners.size() > 1; ++i) {
    const Vector3 from = X_FO_ * patch.corners[i].p;
    const Vector3 along = X_FO_ * patch.corners[(i + 1) % patch.corners.size()].p - from;
    const double part = std::clamp(along.dot(meeting.at - from) / along.squaredNorm(), 0.0, 1.0);
    if (across(meeting.at - from - part * along, meeting.n).norm() > kEdgeGap) continue;
    Feature& feature = other_feature(meeting.contact);
    feature = {patch.corners[i].side.kind, feature.shape, patch.corners[i].side.index};
    return true;
  }
  return false;
}

void Resolver::name(FoundContact& contact, const CollisionId& id, FeatureKind kind,
                    std::uint16_t index) {
  if (id.body != own_.id.body) {  // Both fixed, so on side b.
    contact.key.b.index = static_cast<std::uint32_t>(id.body);
  }
  own_feature(contact) = {kind, static_cast<std::uint32_t>(id.shape), index};
  shared_ = true;
}

void Resolver::name_surface(FoundContact& contact, std::size_t face) {
  const bool joined = !own_.surfaces.empty();
  const auto surface =
      joined ? own_.surfaces[face] : Piece::Surface{own_.id, static_cast<std::uint16_t>(face)};
  name(contact, surface.id, FeatureKind::kFace, surface.face);
  contact.key.face &= kBeside;
}

void Resolver::name_border(FoundContact& contact, std::size_t face, std::size_t other_face) {
  const auto number = pieces_.border_of(own_, face, other_face);
  if (!number) return;
  const Piece::Surface& surface = own_.surfaces[face];
  name(contact, std::min(surface, own_.surfaces[other_face]).id, FeatureKind::kEdge, *number);
  contact.key.face = (contact.key.face & kBeside) | (2 * std::uint32_t{surface.face} + 1);
}

/// Whether a point of the tool is over none of the pieces there, and does not touch their plane.
bool Resolver::is_beside(const Meeting& meeting) const {
  return meeting.contact.separation > 0 && own_.mesh == nullptr &&
         std::ranges::none_of(pieces_at(own_, meeting.at), [&](const Piece* piece) {
           return contains(*piece, meeting.at, kEdgeGap);
         });
}

/// Whether a point is on a side of a piece of a skin that is inside of the mesh.
bool Resolver::is_behind_skin(const Meeting& meeting) const {
  if (own_.mesh == nullptr) return false;
  const Piece::Plane& front = own_.planes[own_.front];
  return front.n_F.dot(meeting.at) - front.offset < -kEdgeGap;
}

/// Whether a side of this piece is felt at a contact, and not only those of others, on a flat
/// surface that this one ends below.
bool Resolver::is_felt_here(const Meeting& meeting, const PiecesAtPoint& pieces) const {
  const bool has_side =
      std::ranges::any_of(sides_at(own_, meeting.at, kEdgeGap), [&](const PieceSide& side) {
        return is_surface(own_, side) && (side.n_F - meeting.n).norm() < kOfFace;
      });
  return has_side || !is_flat(meeting.n, meeting.at, pieces);
}

/// Gives a contact its place on a surface of several pieces. False if it has none: it is at a
/// border inside of that.
bool Resolver::settle(Meeting& meeting) {
  const Feature& feature = own_feature(meeting.contact);
  if (feature.kind == FeatureKind::kFace) {
    if (feature.index >= own_.planes.size()) return true;
    if (is_beside(meeting)) {
      meeting.contact.key.face |= kBeside;
      shared_ = true;
    } else {
      name_surface(meeting.contact, feature.index);
    }
    return true;
  }
  const PiecesAtPoint pieces = pieces_at(own_, meeting.at);
  const auto face = face_at(meeting);
  if (!face) return is_felt_here(meeting, pieces);
  const Vector3& n_face = own_.planes[*face].n_F;
  const bool is_bent = own_.mesh != nullptr && !is_flat(n_face, meeting.at, pieces);
  // Nothing is named after its border, whatever that is.
  if (is_bent && (feature.kind != FeatureKind::kEdge || own_.surfaces.empty())) return true;
  const Border border = border_at(meeting, n_face, pieces);
  if (border.goes_on && is_bent) return true;
  if (border.goes_on) {
    shared_ = true;
    if (put_on_corner(meeting)) {
      name_surface(meeting.contact, *face);
      return true;
    }
    if (border.within) return false;
    if (!put_on_edge(meeting)) return true;
  } else if (feature.kind != FeatureKind::kEdge) {
    return true;
  }
  if (border.open_face) name_border(meeting.contact, *face, *border.open_face);
  return true;
}

/// Adds what is on the surface, or can be put there, of the contacts on an axis as the best one.
/// Returns their normal; zero if the surface has none like it.
Vector3 Resolver::keep_best(std::span<Meeting> set, bool real,
                            std::vector<FoundContact>& contacts) {
  Vector3 n = Vector3::Zero();
  for (Meeting& meeting : set) {
    if (Work::is_spent() || (!real && !put_on_surface(meeting))) continue;
    if (is_behind_skin(meeting)) continue;
    // Outermost points tell of a gap, not of where the tool stands.
    if (meeting.contact.axis > 0 && !contains(own_, meeting.at, kEdgeGap)) continue;
    n = meeting.n;
    meeting.contact.axis = 0;
    if (meeting.contact.key.face >= kTellsApart) meeting.contact.key.face = 0;
    if (!settle(meeting)) continue;
    best_at_.push_back(meeting.at);
    contacts.push_back(reported(meeting));
  }
  return n;
}

/// Whether another piece goes on where this one ends along an axis, before any of its best
/// contacts: a tool that moves there leaves this piece, but not the surface.
bool Resolver::goes_on_along(std::span<const Meeting> axis) const {
  const Vector3& n = axis.front().n;
  const double end = n.dot(axis.front().at) + kOutwards;
  return std::ranges::any_of(
      best_at_, [&](const Vector3& at) { return !is_on_surface(n, at + (end - n.dot(at)) * n); });
}

/// Whether a piece of a skin and those around it have no normal near that of its contacts, which is
/// one, as no other axes are looked for there.
bool Resolver::is_off_skin(const FoundContact& contact) const {
  const Vector3 n = X_WF_.R.conjugate() * (own_is_b_ ? contact.n_W : Vector3(-contact.n_W));
  return own_.middle_normal_F.dot(n) < own_.least_along;
}

bool Resolver::resolve(std::vector<FoundContact>& contacts, std::size_t first) {
  static const double cosine = std::cos(kOneAxis);
  if (is_off_skin(contacts[first])) {
    contacts.resize(first);
    return true;
  }
  StaticVector<Meeting, AxesManifold::static_capacity> seen_here;
  for (std::size_t i = first; i < contacts.size(); ++i) seen_here.push_back(seen(contacts[i]));
  const std::span<Meeting> meetings(seen_here.data(), seen_here.size());
  contacts.resize(first);
  shared_ = own_.mesh != nullptr;
  const double least = gap_of(axis_from(meetings, 0)) - kStandsIn;
  Vector3 best = Vector3::Zero();
  for (std::size_t begin = 0; begin < meetings.size();) {
    const std::span<Meeting> set = axis_from(meetings, begin);
    begin += set.size();
    const Vector3& n = set.front().n;
    const bool real = is_on_surface(set);
    const bool stands_in = contacts.size() == first && gap_of(set) >= least &&
                           (best.isZero(0) || n.dot(best) > cosine);
    if (set.front().contact.axis == 0 || stands_in) {
      best = keep_best(set, real, contacts);
    } else if (contacts.size() > first && real && (n - best).norm() >= kIsNormal &&
               !goes_on_along(set)) {
      for (const Meeting& meeting : set) contacts.push_back(reported(meeting));
    }
  }
  return shared_;
}

bool has_neighbours(const Piece& piece) {
  return !piece.adjoining.empty() || !piece.surfaces.empty();
}

}  // namespace

FoundContact found_contact(const ManifoldPoint& point, const ContactSide& a,
                           const CollisionId& shape_a, const ContactSide& b,
                           const CollisionId& shape_b) {
  FoundContact contact;
  contact.key = {a, point.tool_feature, b, point.body_feature, point.face};
  contact.key.a_feature.shape = static_cast<std::uint32_t>(shape_a.shape);
  contact.key.b_feature.shape = static_cast<std::uint32_t>(shape_b.shape);
  contact.pair = pair_of(contact.key);
  contact.own = shape_a;
  contact.other = shape_b;
  contact.axis = point.axis;
  contact.plane = plane_of(point.tool_feature, point.body_feature);
  contact.p_WC = point.p_WC;
  contact.n_W = point.n_W;
  contact.separation = point.separation;
  return contact;
}

bool remove_internal_edges(const Pieces& pieces, const PairSide& a, const PairSide& b,
                           std::vector<FoundContact>& contacts, std::size_t first) {
  bool shared = false;
  if (contacts.size() > first && has_neighbours(b.piece)) {
    shared |= Resolver(pieces, b, a, true).resolve(contacts, first);
  }
  if (contacts.size() > first && has_neighbours(a.piece)) {
    shared |= Resolver(pieces, a, b, false).resolve(contacts, first);
  }
  return shared;
}

}  // namespace hlm::geometry
