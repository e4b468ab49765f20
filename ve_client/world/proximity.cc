#include "hlm/world/proximity.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "hlm/geometry/index.h"
#include "hlm/geometry/merge.h"
#include "hlm/geometry/mesh_normals.h"
#include "hlm/geometry/mesh_pieces.h"

namespace hlm::ve {
namespace {

/// Overlap at an internal edge from which on a narrow tool may be past the adjoining sides, m.
constexpr double kDeepInSeam = 0.0015;
/// Less of the thickness of both than one half, at which things are half through each other.
constexpr double kNotThrough = 0.2;

ContactSide side_of_link(int link) {
  return {SideKind::kToolLink, static_cast<std::uint32_t>(link)};
}

/// The link nearest to the root that moves with this one.
int rigid_root(const ToolDescription& tool, int link) {
  while (tool.links[at(link)].joint == JointType::kFixed && tool.links[at(link)].parent >= 0) {
    link = tool.links[at(link)].parent;
  }
  return link;
}

/// Whether two links are one rigid object, or a joint connects them.
bool are_joined(const ToolDescription& tool, int first, int second) {
  const int a = rigid_root(tool, first);
  const int b = rigid_root(tool, second);
  const auto carries = [&](int carrier, int carried) {
    const int parent = tool.links[at(carried)].parent;
    return parent >= 0 && rigid_root(tool, parent) == carrier;
  };
  return a == b || carries(a, b) || carries(b, a);
}

Eigen::AlignedBox3d inflated(Eigen::AlignedBox3d box, double epsilon) {
  box.min().array() -= epsilon;
  box.max().array() += epsilon;
  return box;
}

/// Whether a planar tool stays apart from a shape, however it moves.
bool passes_beside(const AxesManifold& manifold, const Vector3& planar_normal_W) {
  constexpr double kAlong = 1e-6;  // Sine: rounding.
  std::map<int, double> gaps;
  for (const ManifoldPoint& point : manifold) {
    if (point.n_W.cross(planar_normal_W).norm() > kAlong) continue;
    const auto gap = gaps.try_emplace(point.axis, point.separation).first;
    gap->second = std::min(gap->second, point.separation);
  }
  return std::ranges::any_of(gaps, [](const auto& gap) { return gap.second > 0; });
}

/// The least extent of a shape, along its own axes and the normals of its faces, m; 0 of what has
/// no other side.
double thickness(const Convex& shape) {
  if (shape.is_half_space()) return 0;
  double least = shape.bounds(Pose{}).sizes().minCoeff();
  if (!shape.is_polytope() || shape.margin() > 0) return least;
  for (const Vector3& n : shape.face_normals()) {
    least = std::min(least, n.dot(shape.support(n) - shape.support(-n)));
  }
  return least;
}

/// Leaves of each pair the contacts of one axis: the best one, unless the pair is apart along
/// another one now and where the tool is drawn to.
void keep_axes_in_the_way(const VirtualTool& tool, std::vector<FoundContact>& contacts) {
  constexpr double kApart = -1e-4;  // m: what the engine leaves of overlap where the tool rests.
  constexpr double kUntouched = std::numeric_limits<double>::infinity();
  struct Gap {
    double now = kUntouched;
    double there = kUntouched;
  };
  std::vector<FoundContact> kept;
  std::ranges::stable_sort(contacts, {}, &FoundContact::pair);
  for (auto first = contacts.begin(); first != contacts.end();) {
    const auto last = std::find_if(first, contacts.end(), [&](const FoundContact& contact) {
      return contact.pair != first->pair;
    });
    const int link = static_cast<int>(first->key.a.index);
    const Pose X_WT = tool.X_WB_target(link) * tool.X_WB(link).inverse();
    std::vector<Gap> gaps;
    for (auto contact = first; contact != last; ++contact) {
      gaps.resize(std::max<std::size_t>(gaps.size(), contact->axis + 1));
      const Vector3 p_W = contact->p_WC + contact->separation * contact->n_W;
      Gap& gap = gaps[contact->axis];
      gap.now = std::min(gap.now, contact->separation);
      gap.there = std::min(gap.there, contact->n_W.dot(X_WT * p_W - contact->p_WC));
    }
    std::size_t best = 0;
    for (std::size_t i = 1; i < gaps.size(); ++i) {
      const bool is_found = std::isfinite(gaps[i].now);  // Else it is on no surface (8.5).
      const bool apart = is_found && gaps[i].now > kApart && gaps[i].there > 0;
      if (apart && gaps[i].there > gaps[best].there) best = i;
    }
    std::copy_if(first, last, std::back_inserter(kept),
                 [&](const FoundContact& contact) { return contact.axis == best; });
    first = last;
  }
  contacts = std::move(kept);
}

/// For a tool next to a triangle of a skin, over one that rises from it: the contact with the
/// triangle's plane, which it will meet next. Else what was found.
AxesManifold with_plane(const AxesManifold& found, const CollisionDescription& piece,
                        const Convex& tool, const Pose& X_WT, const Convex& convex,
                        const Pose& X_WG, double epsilon) {
  if (found.empty()) return found;
  const Pose X_GW = X_WG.inverse();
  const ManifoldPoint& nearest = *std::ranges::min_element(found, {}, &ManifoldPoint::separation);
  const Vector3 p_G = X_GW * nearest.p_WC;
  if (is_normal(*piece.mesh, piece.triangle, p_G, X_GW.R * nearest.n_W).value_or(true)) {
    return found;
  }
  const Vector3 n_G = piece.mesh->area(piece.triangle).normalized();
  const Vector3 n_W = X_WG.R * n_G;
  const Vector3 n_T = X_WT.R.conjugate() * n_W;
  const Vector3 p_T = tool.support(-n_T);
  const Vector3 p_W = X_WT * Vector3(p_T - tool.margin() * n_T);
  if (!is_concave(*piece.mesh, piece.triangle, p_G, X_GW * p_W)) return found;
  const double height = n_W.dot(p_W - X_WG * piece.mesh->corner(piece.triangle, 0));
  if (height > epsilon) return {};
  return {{.tool_feature = tool.feature_at(p_T),
           .body_feature = convex.facing(n_G).feature,
           .p_WC = p_W - height * n_W,
           .n_W = n_W,
           .separation = height}};
}

}  // namespace

Proximity::Proximity(World& world, const ToolAssembly& assembly)
    : world_(world), planar_normal_W_(assembly.planar_normal_W), tool_bodies_(assembly.bodies) {
  for (int link = 0; link < static_cast<int>(tool_bodies_.size()); ++link) {
    const int body = tool_bodies_[at(link)];
    const auto count = world_.description().bodies[at(body)].collisions.size();
    for (int shape = 0; shape < static_cast<int>(count); ++shape) {
      tool_shapes_.push_back({link, {body, shape}});
    }
  }
  for (const ToolShape& a : tool_shapes_) {
    thinnest_ = std::min(thinnest_, thickness(world.convex(a.id)));
    for (const ToolShape& b : tool_shapes_) {
      if (b.link >= a.link) break;
      if (!are_joined(assembly.description, a.link, b.link)) tool_pairs_.push_back({a, b});
    }
  }
}

AxesManifold Proximity::find(const CollisionId& id_a, const Pose& X_WA, const CollisionId& id_b,
                             const Pose& X_WB, double epsilon,
                             const std::optional<Vector3>& before_B, const Vector3& travel_W) {
  const Convex& a = world_.convex(id_a);
  const Convex& b = world_.convex(id_b);
  // The axes of one piece of a skin do not tell whether the tool is apart from the mesh.
  const bool skin = world_.collision(id_b).mesh != nullptr;
  if (all_axes_ && !skin) {
    return find_axes(a, X_WA, b, X_WB, epsilon, statistics_, before_B, travel_W);
  }
  const Manifold best = find_contacts(a, X_WA, b, X_WB, epsilon, statistics_, before_B);
  return {best.begin(), best.end()};
}

std::span<const FoundContact> Proximity::query(const VirtualTool& tool, double epsilon,
                                               bool all_axes, double ahead) {
  all_axes_ = all_axes;
  ahead_ = ahead;
  contacts_.clear();
  sides_before_ = std::exchange(sides_, {});
  for (const auto& [link, id] : tool_shapes_) {
    const Pose X_WG = tool.X_WB(link) * world_.collision(id).X_BG;
    query_shape(side_of_link(link), id, X_WG, tool.target_velocity_at(link, X_WG.p), epsilon);
  }
  for (const ToolPair& pair : tool_pairs_) query_tool_pair(tool, pair, epsilon);
  merge();
  return contacts_;
}

void Proximity::query_tool_pair(const VirtualTool& tool, const ToolPair& pair, double epsilon) {
  const auto& [a, b] = pair;
  const Pose X_WA = tool.X_WB(a.link) * world_.collision(a.id).X_BG;
  const Pose X_WB = tool.X_WB(b.link) * world_.collision(b.id).X_BG;
  const Convex& shape_a = world_.convex(a.id);
  const Convex& shape_b = world_.convex(b.id);
  if (!inflated(shape_a.bounds(X_WA), epsilon).intersects(shape_b.bounds(X_WB))) return;
  const auto friction = friction_between(world_.collision(a.id), world_.collision(b.id));
  const std::size_t first = contacts_.size();
  for (const ManifoldPoint& point : find(a.id, X_WA, b.id, X_WB, epsilon)) {
    FoundContact& contact = contacts_.emplace_back(
        found_contact(point, side_of_link(a.link), a.id, side_of_link(b.link), b.id));
    contact.friction = friction.value_or(contact.friction);
  }
  resolve({world_.pieces().of(a.id), X_WA}, {world_.pieces().of(b.id), X_WB}, first);
}

void Proximity::resolve(const PairSide& a, const PairSide& b, std::size_t first) {
  shared_ |= resolve_seams(world_.pieces(), a, b, contacts_, first);
}

void Proximity::merge() {
  if (std::exchange(shared_, false)) merge_same(contacts_, world_.pieces());
  if (all_axes_) keep_whole_pairs(contacts_);
}

std::span<const FoundContact> Proximity::query(int body, double epsilon) {
  all_axes_ = false;
  ahead_ = 0;
  contacts_.clear();
  const auto count = world_.description().bodies[at(body)].collisions.size();
  for (int shape = 0; shape < static_cast<int>(count); ++shape) {
    const CollisionId id{body, shape};
    query_shape({SideKind::kMovableBody, static_cast<std::uint32_t>(body)}, id, world_.X_WG(id),
                Vector3::Zero(), epsilon);
  }
  merge();
  return contacts_;
}

void Proximity::query_shape(const ContactSide& side, const CollisionId& id, const Pose& X_WG,
                            const Vector3& v_W, double epsilon) {
  world_.find_near(inflated(world_.convex(id).bounds(X_WG), epsilon), near_);
  for (const CollisionId& other : near_) {
    // The tool's own shapes are never found; it touches all others.
    const bool touches = side.kind == SideKind::kToolLink || world_.can_touch(id.body, other.body);
    if (touches) query_pair(side, id, X_WG, v_W, other, epsilon);
  }
}

void Proximity::query_pair(const ContactSide& side, const CollisionId& id, const Pose& X_WG,
                           const Vector3& v_W, const CollisionId& other, double epsilon) {
  const bool of_tool = side.kind == SideKind::kToolLink;
  Pair pair{.side = side, .id = id, .other = other, .X_WG = X_WG, .X_WO = world_.X_WG(other)};
  pair.keeps_side = of_tool && world_.is_movable(other.body);
  pair.passes_beside = of_tool && side.index == 0 && planar_normal_W_ &&
                       world_.description().bodies[at(other.body)].fixed;
  // Edges of adjoining pieces are no edges; it is not known where a movable body goes.
  const bool looks_ahead = of_tool && !pair.keeps_side &&
                           world_.pieces().of(id).adjoining.empty() &&
                           world_.pieces().of(other).adjoining.empty();
  if (looks_ahead) pair.travel_W = possible_travel(v_W.norm(), ahead_) * v_W.normalized();
  std::optional<Vector3> before;
  if (pair.keeps_side) {
    const auto known = sides_before_.find({id, other});
    if (known != sides_before_.end()) before = known->second;
  }
  const std::size_t first = contacts_.size();
  const double overlap = add_contacts(pair, epsilon, before);
  if (contacts_.size() > first) return;
  // Deep in a skin the nearest way out of a piece may lead through the mesh.
  const CollisionDescription& piece = world_.collision(other);
  if (piece.mesh && overlap > 0) {
    add_contacts(pair, epsilon, piece.mesh->area(piece.triangle).normalized());
  } else {
    lost_ = lost_ || overlap > kDeepInSeam;
  }
}

/// Adds the contacts of a pair on its surfaces; with near_O near this normal (frame of the other
/// shape). Returns how deep the two convex shapes overlap, m.
double Proximity::add_contacts(const Pair& pair, double epsilon,
                               const std::optional<Vector3>& near_O) {
  const auto& [side, id, other, X_WG, X_WO, travel_W, keeps_side, beside] = pair;
  const CollisionDescription& piece = world_.collision(other);
  AxesManifold manifold = find(id, X_WG, other, X_WO, epsilon, near_O, travel_W);
  if (piece.mesh) {
    manifold =
        with_plane(manifold, piece, world_.convex(id), X_WG, world_.convex(other), X_WO, epsilon);
  }
  const auto deepest = std::ranges::min_element(manifold, {}, &ManifoldPoint::separation);
  const double overlap = deepest == manifold.end() ? 0 : std::max(0.0, -deepest->separation);
  // Along its triangle's normal it is on another side of the mesh.
  if (piece.mesh && near_O && overlap > kSkinDepth) return overlap;
  if (beside && passes_beside(manifold, *planar_normal_W_)) return 0;
  if (keeps_side && !manifold.empty()) {
    sides_[{id, other}] = X_WO.R.conjugate() * manifold.front().n_W;
  }
  const ContactSide other_side{SideKind::kWorld, static_cast<std::uint32_t>(other.body)};
  const auto friction = friction_between(world_.collision(id), world_.collision(other));
  const std::size_t first = contacts_.size();
  for (const ManifoldPoint& point : manifold) {
    FoundContact& contact =
        contacts_.emplace_back(found_contact(point, side, id, other_side, other));
    contact.v_WC = world_.velocity_at(other.body, point.p_WC);
    contact.friction = friction.value_or(contact.friction);
  }
  resolve({world_.pieces().of(id), X_WG}, {world_.pieces().of(other), X_WO}, first);
  return overlap;
}

double Proximity::thickness_of(const CollisionId& id) {
  const auto known = thickness_.find(id);
  if (known != thickness_.end()) return known->second;
  const bool is_skin = world_.collision(id).mesh != nullptr;
  return thickness_[id] = is_skin ? 0 : thickness(world_.convex(id));
}

Overlap Proximity::overlap(const VirtualTool& tool,
                           const std::function<bool(int body)>& stops_tool) {
  const auto sides = sides_;
  Overlap overlap;
  lost_ = false;
  for (const FoundContact& contact : query(tool, 0, false)) {
    const int body = static_cast<int>(contact.key.b.index);
    if (contact.key.b.kind == SideKind::kToolLink || !stops_tool(body)) continue;
    const CollisionId a{tool_bodies_[contact.key.a.index],
                        static_cast<int>(contact.key.a_feature.shape)};
    const CollisionId b{body, static_cast<int>(contact.key.b_feature.shape)};
    const double both = thickness_of(a) + thickness_of(b);
    overlap.depth = std::max(overlap.depth, -contact.separation);
    overlap.is_through |= -contact.separation > std::min(kNotThrough * both, thickness_of(a) / 2);
  }
  sides_ = sides;
  overlap.is_through |= lost_;
  return overlap;
}

std::span<const ToolContact> Proximity::within_reach(
    const VirtualTool& tool, double reach, const std::function<bool(int body)>& stops_tool) {
  within_reach_.clear();
  query(tool, reach, true);
  keep_axes_in_the_way(tool, contacts_);
  for (const FoundContact& found : contacts_) {
    // What the links do to each other is the proxy's business: the world's tool follows it.
    if (found.key.b.kind == SideKind::kToolLink) continue;
    if (!stops_tool(static_cast<int>(found.key.b.index))) continue;
    ToolContact& contact = within_reach_.emplace_back();
    contact.tool_body = tool_bodies_[found.key.a.index];
    contact.body = static_cast<int>(found.key.b.index);
    contact.p_W = found.p_WC;
    contact.n_W = found.n_W;
    contact.separation = found.separation;
    contact.friction = found.friction < 0 ? kDefaultFriction : found.friction;
  }
  return within_reach_;
}

}  // namespace hlm::ve
