#include "hlm/geometry/contact_finder.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "hlm/geometry/mesh_normals.h"
#include "hlm/geometry/mesh_pieces.h"
#include "hlm/geometry/union.h"
#include "hlm/geometry/work.h"

namespace hlm::geometry {
namespace {

/// Overlap at an internal edge from which on a narrow tool may be past the adjoining sides, m.
constexpr double kDeepInEdge = 0.0015;

/// libccd's last word on pairs that overlap by metres is not worth an allocation.
constexpr bool kMayAllocate = false;

/// Work of a box that is looked at, of a piece of the bodies searched for, and of a pair.
constexpr std::uint64_t kBoxWork = 4;
constexpr std::uint64_t kPieceWork = 100;
constexpr std::uint64_t kPairWork = 60;
/// Work of a contact, besides that of finding the surface that it is on.
constexpr std::uint64_t kContactWork = 100;

/// Of a search's work what it takes to find out which pieces are near, and to look at all pairs.
constexpr std::uint64_t kToGather = 2;  // One part in so many.
constexpr std::uint64_t kToPair = 10;
/// From such a part of its work on, a search is crowded.
constexpr std::uint64_t kCrowded = 2;

/// Pairs with solids of which something is known. Of more each search finds out anew.
constexpr std::size_t kKnownSolids = 1024;

/// Contacts of one feature of the tool with several solids that are nearer than this, m, with
/// normals within 0.15 rad (cosine), are one.
constexpr double kOnePlace = 1e-3;
constexpr double kOneSurface = 0.989;

/// Cosine to a triangle's normal from which on a tool is pressed onto it and not onto a rim.
constexpr double kOnFace = 0.7;

Eigen::AlignedBox3d inflated(Eigen::AlignedBox3d box, double by) {
  box.min().array() -= by;
  box.max().array() += by;
  return box;
}

/// Whether a contact is with an edge or a corner of a solid that the whole has not: a face there
/// goes on in another piece, to where the normal leans from it.
bool goes_on_beyond(const Assembly& around, const Piece& piece, const SolidContact& contact) {
  if (contact.solid_kind == FeatureKind::kFace) return false;
  const Pose& X_FS = piece.X_FG;
  const Vector3 p_F = X_FS * contact.p_S;
  const Vector3 n_F = X_FS.R * contact.n_S;
  const MeshSolid& solid = *piece.solid;
  if (!solid.is_closed()) {
    if (contact.beyond_S.isZero(0)) return false;
    const std::uint32_t feature = contact.solid_feature;
    const bool on_rim = contact.solid_kind == FeatureKind::kVertex
                            ? solid.is_on_rim(feature)
                            : solid.triangles()[feature / 3].across[feature % 3] < 0;
    return goes_on(around, piece, p_F, X_FS.R * contact.face_S, X_FS.R * contact.beyond_S, on_rim);
  }
  const auto leans_over = [&](const Vector3& face_S) {
    constexpr double kLeans = 0.03;    // Sine: as much as a step in a seam's gap may rise.
    constexpr double kUpright = 1e-5;  // Sine: rounding.
    const double along = face_S.dot(contact.n_S);
    const Vector3 beyond = contact.n_S - along * face_S;
    const double leans = beyond.norm();
    if (along <= 0 || leans < kUpright) return false;
    const Vector3 beyond_F = X_FS.R * (beyond / leans);
    if (leans < kLeans) return rises_to(around, piece, p_F, n_F, beyond_F);
    return goes_on(around, piece, p_F, X_FS.R * face_S, beyond_F);
  };
  bool found = false;
  const auto look = [&](const MeshSolid::Triangle& t) { found = found || leans_over(t.n); };
  if (contact.solid_kind == FeatureKind::kVertex) {
    solid.for_each_at(contact.solid_feature, look);
  } else {
    const MeshSolid::Triangle& t = solid.triangles()[contact.solid_feature / 3];
    look(t);
    const std::int32_t across_edge = t.across[contact.solid_feature % 3];
    if (across_edge >= 0) look(solid.triangles()[static_cast<std::size_t>(across_edge)]);
  }
  return found;
}

/// A solid's surface where no other piece of its assembly covers it or goes on.
class Uncovered final : public OpenSurface {
 public:
  Uncovered(const Assembly& around, const Piece& piece) : around_(around), piece_(piece) {}

  bool has(const SolidContact& contact) const noexcept override {
    const MeshSolid& solid = *piece_.solid;
    // On the border of a face it is looked for on that.
    Vector3 inwards_S = Vector3::Zero();
    if (contact.solid_kind == FeatureKind::kFace) {
      const MeshSolid::Triangle& t = solid.triangles()[contact.solid_feature];
      const Vector3 middle = (solid.corner(t, 0) + solid.corner(t, 1) + solid.corner(t, 2)) / 3;
      inwards_S = kEdgeStep * (contact.p_S - middle).normalized();
    } else if (contact.beyond_S.isZero(0)) {
      inwards_S = kEdgeStep * contact.face_S;
    }
    const Pose& X_FS = piece_.X_FG;
    const Vector3 p_F = X_FS * Vector3(contact.p_S - inwards_S);
    return is_on_union(around_, piece_, p_F, X_FS.R * contact.n_S) &&
           !goes_on_beyond(around_, piece_, contact);
  }

 private:
  const Assembly& around_;
  const Piece& piece_;
};

/// Whether a shape, at X_FG, is farther than `epsilon` before the triangle of a piece of a skin.
bool is_far_before(const Piece& piece, const Convex& shape, const Pose& X_FG, double epsilon) {
  if (piece.mesh == nullptr || shape.is_half_space()) return false;
  const auto& [n_F, offset] = piece.planes[piece.front];
  const Vector3 n_G = X_FG.R.conjugate() * n_F;
  const double lowest = n_G.dot(shape.support(-n_G)) - shape.margin();
  return lowest + n_F.dot(X_FG.p) - offset > epsilon;
}

/// Whether a planar tool stays apart from a shape, however it moves.
bool passes_beside(const AxesManifold& manifold, const Vector3& planar_normal_W) {
  constexpr double kAlong = 1e-6;  // Sine: rounding.
  for (std::size_t i = 0; i < manifold.size();) {
    const ManifoldPoint& first = manifold[i];
    double gap = std::numeric_limits<double>::infinity();
    for (; i < manifold.size() && manifold[i].axis == first.axis; ++i) {
      gap = std::min(gap, manifold[i].separation);
    }
    if (gap > 0 && first.n_W.cross(planar_normal_W).norm() <= kAlong) return true;
  }
  return false;
}

/// The contact of a shape's lowest point with the plane of a piece's triangle.
ManifoldPoint over_plane(const Piece& piece, const Convex& shape, const Pose& X_WS,
                         const Pose& X_WG) {
  const Vector3 n_G = piece.mesh->area(piece.triangle).normalized();
  const Vector3 n_W = X_WG.R * n_G;
  const Vector3 n_S = X_WS.R.conjugate() * n_W;
  const Vector3 p_S = shape.support(-n_S);
  const Vector3 p_W = X_WS * Vector3(p_S - shape.margin() * n_S);
  const double height = n_W.dot(p_W - X_WG * piece.mesh->corner(piece.triangle, 0));
  return {.tool_feature = shape.feature_at(p_S),
          .body_feature = piece.convex->facing(n_G).feature,
          .p_WC = p_W - height * n_W,
          .n_W = n_W,
          .separation = height};
}

/// For a tool next to a triangle of a skin, over one that rises from it: the contact with the
/// triangle's plane, which it will meet next. Else what was found.
AxesManifold with_plane(const AxesManifold& found, const Piece& piece, const Convex& tool,
                        const Pose& X_WT, const Pose& X_WG, double epsilon) {
  if (found.empty()) return found;
  const Pose X_GW = X_WG.inverse();
  const ManifoldPoint& nearest = *std::ranges::min_element(found, {}, &ManifoldPoint::separation);
  const Vector3 p_G = X_GW * nearest.p_WC;
  if (is_normal(*piece.mesh, piece.triangle, p_G, X_GW.R * nearest.n_W).value_or(true)) {
    return found;
  }
  const ManifoldPoint next = over_plane(piece, tool, X_WT, X_WG);
  const Vector3 p_W = next.p_WC + next.separation * next.n_W;
  if (!is_concave(*piece.mesh, piece.triangle, p_G, X_GW * p_W)) return found;
  if (next.separation > epsilon) return {};
  return {next};
}

}  // namespace

ContactFinder::ContactFinder(const Pieces& pieces, std::vector<Body> bodies, MayTouch may_touch,
                             const std::optional<Vector3>& planar_normal_W, const FinderRoom& room)
    : pieces_(pieces),
      bodies_(std::move(bodies)),
      may_touch_(std::move(may_touch)),
      planar_normal_W_(planar_normal_W),
      X_WB_(bodies_.size()) {
  for (const Assembly& assembly : pieces.assemblies()) {
    const Eigen::AlignedBox3d box = assembly.tree.bounds();
    balls_.push_back({assembly.body, box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).norm()});
  }
  std::size_t count = 0;
  for (std::size_t i = 0; i < bodies_.size(); ++i) count += pieces.of(static_cast<int>(i)).size();
  room_.pairs = std::min(room.pairs, count * count);
  room_.contacts = std::min(room.contacts, room_.pairs * AxesManifold::static_capacity);
  near_.reserve(room_.pairs);
  crowded_.resize(bodies_.size(), false);
  contacts_.reserve(room_.contacts);
  merge_space_.reserve(room_.contacts);
  for (Sides* sides : {&sides_, &sides_before_}) sides->reserve(room_.pairs);
  for (Apart* apart : {&apart_, &apart_before_}) apart->reserve(room_.pairs);
  for (Pressed* pressed : {&pressed_, &pressed_before_}) pressed->reserve(room_.pairs);
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    for (const Piece& piece : pieces.of(static_cast<int>(i))) {
      if (piece.solid != nullptr) solids_.push_back(&piece);
    }
  }
  searches_.resize(bodies_.size(), 0);
  known_solids_.reserve(std::min(kKnownSolids, (count - solids_.size()) * solids_.size()));
}

Pose ContactFinder::X_WG(const Piece& piece) const {
  if (pieces_.is_fixed(piece.id.body)) return piece.X_FG;
  return X_WB_[static_cast<std::size_t>(piece.id.body)] * piece.X_FG;
}

/// Finds the pieces of other bodies whose bounds are within ε of those of each piece, in the order
/// of the pieces.
void ContactFinder::gather(std::span<const int> bodies, const Search& search) {
  const Work::Allowance allowance(search.work / kToGather);
  near_.clear();
  for (const int body : bodies) {
    for (const Piece& own : pieces_.of(body)) {
      if (Work::is_spent()) {
        ++cut_.pairs;
        return;
      }
      find_near(own, search.epsilon);
    }
  }
}

/// Adds those near one piece.
void ContactFinder::find_near(const Piece& own, double epsilon) {
  Work::add(kPieceWork);
  const Pose X_WG = this->X_WG(own);
  const std::size_t first = near_.size();
  const Eigen::AlignedBox3d box_W = inflated(own.convex->bounds(X_WG), epsilon);
  const double radius = box_W.diagonal().norm() / 2;
  const Vector3 middle = box_W.center();
  const auto assemblies = pieces_.assemblies();
  for (std::size_t i = 0; i < assemblies.size(); ++i) {
    const auto [body, reach] = balls_[i];
    if (body == own.id.body) continue;
    Work::add(kBoxWork);
    Eigen::AlignedBox3d box_F = box_W;
    Pose X_FG = X_WG;
    if (body != Assembly::kFixed) {
      const Pose& X_WF = X_WB_[static_cast<std::size_t>(body)];
      const double farthest = reach + radius;
      if ((X_WF.p - middle).squaredNorm() > farthest * farthest) continue;
      X_FG = X_WF.inverse() * X_WG;
      box_F = inflated(own.convex->bounds(X_FG), epsilon);
    }
    const Assembly& assembly = assemblies[i];
    const auto meets = [&](const BoxTree::Box& box) {
      Work::add(kBoxWork);
      return box_F.intersects(box) && !Work::is_spent();
    };
    assembly.tree.visit(meets, [&](std::size_t place) {
      const Piece& other = *assembly.pieces[place];
      const bool is_near = other.id.body != own.id.body && meets(other.bounds_F) &&
                           !is_far_before(other, *own.convex, X_FG, epsilon);
      if (!is_near || !may_touch_(own.id, other.id)) return;
      Work::add(kPairWork);
      if (near_.size() < room_.pairs) {
        near_.push_back({&own, &other, box_F.intersection(other.bounds_F).sizes().minCoeff()});
      } else {
        ++cut_.pairs;
      }
    });
  }
  const auto begin = near_.begin() + static_cast<std::ptrdiff_t>(first);
  std::ranges::sort(begin, near_.end(), {}, [](const Candidate& near) { return near.other->id; });
}

void ContactFinder::sort_deepest_first() {
  Work::add(kPairWork * near_.size());
  std::ranges::sort(near_, [](const Candidate& x, const Candidate& y) {
    return std::tuple(-x.overlap, x.own->id, x.other->id) <
           std::tuple(-y.overlap, y.own->id, y.other->id);
  });
}

/// Looks at the pairs in their order, as far as its work allows.
void ContactFinder::add_pairs(const Search& search) {
  const Work::Allowance allowance(search.work - search.work / kToPair);
  const Piece* own = nullptr;
  Pose X_WG;
  for (std::size_t i = 0; i < near_.size(); ++i) {
    if (std::exchange(own, near_[i].own) != near_[i].own) X_WG = this->X_WG(*near_[i].own);
    const std::size_t first = contacts_.size();
    add_pair(*near_[i].own, X_WG, *near_[i].other, search);
    if (!Work::is_spent()) continue;
    contacts_.resize(first);  // The pair's answer is of no use.
    cut_.pairs += near_.size() - i;
    return;
  }
}

/// Merges what several pairs have found.
void ContactFinder::merge() {
  if (!std::exchange(shared_, false)) return;
  cut_.contacts += merge_same(contacts_, pieces_, merge_space_);
}

std::span<const FoundContact> ContactFinder::find(std::span<const int> bodies,
                                                  const Search& search) noexcept {
  const std::uint64_t before = Work::done();
  const Work::Allowance allowance(search.work);
  contacts_.clear();
  lost_ = false;
  cut_ = {};
  if (search.of_tool) {
    if (search.remembers) {
      sides_before_.swap(sides_);
      sides_.clear();
      pressed_before_.swap(pressed_);
      pressed_.clear();
      apart_before_.swap(apart_);
      apart_.clear();
    } else {
      sides_before_.copy(sides_);
      pressed_before_.copy(pressed_);
    }
  }
  if (search.remembers) {
    for (const int body : bodies) ++searches_[static_cast<std::size_t>(body)];
  }
  gather(bodies, search);
  const std::size_t first_body = bodies.empty() ? 0 : static_cast<std::size_t>(bodies.front());
  if (crowded_[first_body]) sort_deepest_first();
  add_pairs(search);
  merge();
  if (search.all_axes) keep_whole_pairs(contacts_, merge_space_);
  // A search that leaves no trace has its own allowance.
  if (search.remembers) crowded_[first_body] = Work::done() - before > search.work / kCrowded;
  return contacts_;
}

void ContactFinder::add_pair(const Piece& own, const Pose& X_WG, const Piece& other,
                             const Search& search) {
  Work::add(kPairWork);
  if (other.solid != nullptr) return add_of_solid(own, X_WG, other, search);
  Pair pair{.own = own, .other = other, .X_WG = X_WG, .X_WO = this->X_WG(other)};
  if (stays_apart(pair, search)) return;
  const Body& body = body_of(own);
  const bool of_tool = search.of_tool && body_of(other).link < 0;
  const bool of_sheet = other.mesh != nullptr && other.mesh->is_sheet();
  if (of_sheet && !is_before_sheet(pair, search)) return;
  // Of pieces that adjoin the inner sides are none.
  const bool keeps_all = search.keeps_all_sides && own.adjoining.empty() && other.adjoining.empty();
  pair.keeps_side = of_tool && (body_of(other).movable || keeps_all) && !of_sheet;
  pair.may_pass_beside =
      of_tool && body.link == 0 && planar_normal_W_ && pieces_.is_fixed(other.id.body);
  std::optional<Vector3> before;
  if (pair.keeps_side) {
    if (const Vector3* known = sides_before_.find({own.id, other.id})) before = *known;
  }
  const std::size_t first = contacts_.size();
  const double overlap = add_contacts(pair, search, before);
  if (contacts_.size() > first) return;
  const Vector3& apart_O = pair.known.apart_B;
  if (search.of_tool && search.remembers && !apart_O.isZero(0)) {
    apart_.put({&own, &other}, apart_O);
  }
  if (other.mesh && overlap > 0) {
    add_deep_contacts(pair, search);
  } else if (overlap > 0) {
    if (!search.all_axes) add_on_next_axis(pair, search);
    lost_ = lost_ || (contacts_.size() == first && overlap > kDeepInEdge);
  }
}

/// Adds the contacts of a pair whose best axis leads into a piece that goes on there, on the next
/// one that is a surface's: a tool at a seam may be pressed in deeper than it reaches beyond.
void ContactFinder::add_on_next_axis(const Pair& pair, const Search& search) {
  const std::size_t first = contacts_.size();
  add_on_surface(pair, find_axes(*pair.own.convex, pair.X_WG, *pair.other.convex, pair.X_WO,
                                 search.epsilon, statistics_, {}, kMayAllocate));
  const auto begin = contacts_.begin() + static_cast<std::ptrdiff_t>(first);
  const auto tells_apart = [](const FoundContact& contact) { return contact.axis > 0; };
  contacts_.erase(std::remove_if(begin, contacts_.end(), tells_apart), contacts_.end());
}

/// Whether a pair is still apart along the normal along which it was at the search before: 40 ns in
/// place of 400, with the same answer.
bool ContactFinder::stays_apart(const Pair& pair, const Search& search) {
  if (!search.of_tool || !search.remembers) return false;
  const Vector3* n_O = apart_before_.find({&pair.own, &pair.other});
  if (n_O == nullptr) return false;
  const CorePair cores(*pair.own.convex, pair.X_WG, *pair.other.convex, pair.X_WO);
  const double gap = pair.own.convex->is_half_space() || pair.other.convex->is_half_space()
                         ? 0
                         : cores.gap(*n_O) - cores.tool.margin() - cores.body.margin();
  // A search is exact to kAccuracy.
  if (!(gap > search.epsilon + narrow::kAccuracy)) return false;
  apart_.put({&pair.own, &pair.other}, *n_O);
  return true;
}

/// Adds the contacts of a pair that is deep in a skin, where the nearest way out of the piece leads
/// into another one: near the triangle's normal, or the lowest point along it.
void ContactFinder::add_deep_contacts(Pair& pair, const Search& search) {
  const Piece& other = pair.other;
  const std::size_t first = contacts_.size();
  add_contacts(pair, search, other.mesh->area(other.triangle).normalized());
  const auto is_here = [&](const FoundContact& contact) { return is_inside(pair, contact); };
  const auto begin = contacts_.begin() + static_cast<std::ptrdiff_t>(first);
  if (std::any_of(begin, contacts_.end(), is_here)) return;
  contacts_.resize(first);
  const ManifoldPoint lowest = over_plane(other, *pair.own.convex, pair.X_WG, pair.X_WO);
  if (lowest.separation > 0 || lowest.separation < -kSkinDepth) return;
  const Vector3 p_F = other.X_FG * (pair.X_WO.inverse() * lowest.p_WC);
  if ((within(other, p_F) - p_F).norm() <= kEdgeGap) add_on_surface(pair, {lowest});
}

/// Whether a contact is where the tool is, and in what is behind the surface there.
bool ContactFinder::is_inside(const Pair& pair, const FoundContact& contact) const {
  const Vector3 p_W = contact.p_WC + contact.separation * contact.n_W;
  const Vector3 on_own = pair.own.X_FG * (pair.X_WG.inverse() * p_W);
  const bool is_own = pair.own.convex->is_ellipsoid() || contains(pair.own, on_own, kEdgeGap);
  const Vector3 p_F = pair.other.X_FG * (pair.X_WO.inverse() * p_W);
  return is_own && std::ranges::any_of(pieces_at(pair.other, p_F), [&](const Piece* piece) {
           return contains(*piece, p_F, kEdgeGap);
         });
}

/// Whether the tool or a body is before a piece of a sheet; a tool that is pressed onto it, where
/// it was at the search before.
bool ContactFinder::is_before_sheet(const Pair& pair, const Search& search) const {
  const Piece& piece = pair.other;
  std::optional<bool> was;
  if (search.of_tool) {
    const auto* known = pressed_before_.find({pair.own.id, piece.mesh->sheet, piece.triangle});
    if (known != nullptr) was = *known == piece.mesh;
  }
  return is_before(piece, *pair.own.convex, piece.X_FG * (pair.X_WO.inverse() * pair.X_WG), was);
}

AxesManifold ContactFinder::manifold_of(Pair& pair, const Search& search,
                                        const std::optional<Vector3>& near_O) {
  const Convex& own = *pair.own.convex;
  const Convex& other = *pair.other.convex;
  // The axes of one piece of a skin do not tell whether the tool is apart from the mesh.
  if (search.all_axes && !pair.other.mesh) {
    return find_axes(own, pair.X_WG, other, pair.X_WO, search.epsilon, statistics_, near_O,
                     kMayAllocate);
  }
  const Manifold best = find_contacts(own, pair.X_WG, other, pair.X_WO, search.epsilon, statistics_,
                                      near_O, kMayAllocate, &pair.known);
  const AxesManifold manifold(best.begin(), best.end());
  if (!pair.other.mesh) return manifold;
  return with_plane(manifold, pair.other, own, pair.X_WG, pair.X_WO, search.epsilon);
}

/// Adds the contacts of a pair on its surfaces; with near_O near this normal (frame of the other
/// shape). Returns how deep the two convex shapes overlap, m.
double ContactFinder::add_contacts(Pair& pair, const Search& search,
                                   const std::optional<Vector3>& near_O) {
  const Piece& own = pair.own;
  const Piece& other = pair.other;
  const Pose& X_WO = pair.X_WO;
  const AxesManifold manifold = manifold_of(pair, search, near_O);
  if (manifold.empty()) return 0;
  const double overlap =
      std::max(0.0, -std::ranges::min(manifold, {}, &ManifoldPoint::separation).separation);
  // Along its triangle's normal it is on another side of the mesh.
  if (other.mesh && near_O && overlap > kSkinDepth) return overlap;
  if (pair.may_pass_beside && passes_beside(manifold, *planar_normal_W_)) return 0;
  if (pair.keeps_side && search.remembers) {
    sides_.put({own.id, other.id}, X_WO.R.conjugate() * manifold.front().n_W);
  }
  if (other.mesh && other.mesh->is_sheet() && overlap > 0 && search.of_tool && search.remembers) {
    const Vector3 n_O = X_WO.R.conjugate() * manifold.front().n_W;
    const bool on_face = n_O.dot(other.mesh->area(other.triangle).normalized()) > kOnFace;
    if (on_face) pressed_.put({own.id, other.mesh->sheet, other.triangle}, other.mesh);
  }
  add_on_surface(pair, manifold);
  return overlap;
}

/// Adds those contacts of a pair that are on its surfaces.
void ContactFinder::add_on_surface(const Pair& pair, const AxesManifold& manifold) {
  if (!has_room_for(manifold.size())) return;
  const std::size_t first = contacts_.size();
  for (const ManifoldPoint& point : manifold) add_contact(pair.own, pair.other, point);
  shared_ |= remove_internal_edges(pieces_, {pair.own, pair.X_WG}, {pair.other, pair.X_WO},
                                   contacts_, first);
  drop_in_solids(pair, first);
}

/// Adds the contacts of a convex piece with a solid that are on the surface of both their bodies.
void ContactFinder::add_of_solid(const Piece& own, const Pose& X_WG, const Piece& other,
                                 const Search& search) {
  const Pose X_WO = this->X_WG(other);
  const std::pair key{&own, &other};
  const std::uint64_t number = searches_[static_cast<std::size_t>(own.id.body)];
  const KnownSolid* known = known_solids_.find(key);
  const bool is_fresh = known != nullptr && known->search + (search.remembers ? 1 : 0) == number;
  KnownSolid now{.search = number, .memory = {}};
  const Uncovered open(pieces_.assembly_of(other), other);
  const SolidContacts found =
      find_solid_contacts(*own.convex, X_WO.inverse() * X_WG, *other.solid, search.epsilon,
                          is_fresh ? &known->memory : nullptr, now.memory, &open);
  ++statistics_.queries;
  if (search.remembers && (known != nullptr || known_solids_.has_room())) {
    known_solids_.put(key, now);
  }
  if (!has_room_for(found.size())) return;
  const Assembly& around_own = pieces_.assembly_of(own);
  for (const SolidContact& contact : found) {
    const ManifoldPoint point{.tool_feature = contact.tool_feature,
                              .body_feature = {contact.solid_kind, 0, 0},
                              .p_WC = X_WO * contact.p_S,
                              .n_W = X_WO.R * contact.n_S,
                              .separation = contact.separation,
                              .face = contact.solid_feature};
    const Vector3 on_own = point.p_WC + point.separation * point.n_W;
    const Pose X_FW = own.X_FG * X_WG.inverse();
    const Vector3 own_F = X_FW * on_own;
    const Vector3 into_own = kEdgeStep * (own.bounds_F.center() - own_F).normalized();
    if (!is_on_union(around_own, own, own_F + into_own, -(X_FW.R * point.n_W))) continue;
    // A feature of the tool that is over two solids, where one goes on in the other, is over one.
    const auto same = std::ranges::find_if(contacts_, [&](const FoundContact& one) {
      return one.own == own.id && one.other != other.id &&
             one.key.a_feature.kind == point.tool_feature.kind &&
             one.key.a_feature.index == point.tool_feature.index &&
             pieces_.is_fixed(one.other.body) && pieces_.of(one.other).solid != nullptr &&
             one.n_W.dot(point.n_W) > kOneSurface && (one.p_WC - point.p_WC).norm() < kOnePlace;
    });
    if (same == contacts_.end()) {
      add_contact(own, other, point);
    } else if (point.separation < same->separation) {
      contacts_.erase(same);
      add_contact(own, other, point);
    }
  }
}

/// Drops contacts of a pair, from one on, whose point on the other piece lies in a solid of its
/// body.
void ContactFinder::drop_in_solids(const Pair& pair, std::size_t first) {
  if (solids_.empty() || !pieces_.is_fixed(pair.other.id.body)) return;
  const auto is_inside = [&](const FoundContact& contact) {
    return !is_outside(solids_, pair.other, contact.p_WC, contact.n_W);
  };
  contacts_.erase(std::remove_if(contacts_.begin() + static_cast<std::ptrdiff_t>(first),
                                 contacts_.end(), is_inside),
                  contacts_.end());
}

/// Whether there is room for so many more contacts; otherwise they are counted as cut.
bool ContactFinder::has_room_for(std::size_t count) {
  if (contacts_.size() + count > room_.contacts) {
    cut_.contacts += count;
    return false;
  }
  Work::add(kContactWork * count);
  return true;
}

void ContactFinder::add_contact(const Piece& own, const Piece& other, const ManifoldPoint& point) {
  const auto side_of = [&](const Piece& piece, SideKind kind) {
    const int link = body_of(piece).link;
    return link >= 0 ? ContactSide{SideKind::kToolLink, static_cast<std::uint32_t>(link)}
                     : ContactSide{kind, static_cast<std::uint32_t>(piece.id.body)};
  };
  const ContactSide a = side_of(own, SideKind::kMovableBody);
  const ContactSide b = side_of(other, SideKind::kWorld);
  contacts_.push_back(found_contact(point, a, own.id, b, other.id));
  contacts_.back().friction = combine(own.friction, other.friction);
}

}  // namespace hlm::geometry
