#include "hlm/ve_client/world/proximity.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "hlm/geometry/index.h"

namespace hlm::ve {
namespace {

/// Less of the thickness of both than one half, at which things are half through each other.
constexpr double kNotThrough = 0.2;

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

/// The bodies as the finder knows them: those of this tool are its links.
std::vector<ContactFinder::Body> finder_bodies(const World& world, std::span<const int> links) {
  std::vector<ContactFinder::Body> bodies(world.description().bodies.size());
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    bodies[i].movable = world.is_movable(static_cast<int>(i));
  }
  for (std::size_t link = 0; link < links.size(); ++link) {
    bodies[at(links[link])].link = static_cast<int>(link);
  }
  return bodies;
}

/// The tool touches all bodies but those of other tools, and its own links those nearer to the root
/// that no joint connects with them.
ContactFinder::MayTouch touching(const World& world, const ToolAssembly& assembly,
                                 const std::vector<ContactFinder::Body>& bodies) {
  return [&world, bodies, tool = assembly.description](const CollisionId& a, const CollisionId& b) {
    const int link_a = bodies[at(a.body)].link;
    const int link_b = bodies[at(b.body)].link;
    if (link_b >= 0) return link_b < link_a && !are_joined(tool, link_a, link_b);
    if (world.is_tool(b.body)) return false;
    return link_a >= 0 || world.can_touch(a.body, b.body);
  };
}

}  // namespace

Proximity::Proximity(World& world, const ToolAssembly& assembly)
    : world_(world),
      tool_bodies_(assembly.bodies),
      finder_(world.pieces(), finder_bodies(world, assembly.bodies),
              touching(world, assembly, finder_bodies(world, assembly.bodies)),
              assembly.planar_normal_W) {
  for (const int body : tool_bodies_) {
    for (const Piece& piece : world.pieces().of(body)) {
      thinnest_ = std::min(thinnest_, thickness(*piece.convex));
    }
  }
}

/// The world's bodies where they are now.
void Proximity::place_world() {
  if (placed_at_ == world_.changes()) return;
  placed_at_ = world_.changes();
  for (int body = 0; body < static_cast<int>(world_.description().bodies.size()); ++body) {
    if (world_.is_movable(body)) finder_.place(body, world_.X_WB(body));
  }
}

std::span<const FoundContact> Proximity::find(const VirtualTool& tool,
                                              const ContactFinder::Search& search) {
  place_world();
  for (std::size_t link = 0; link < tool_bodies_.size(); ++link) {
    finder_.place(tool_bodies_[link], tool.X_WB(static_cast<int>(link)));
  }
  const auto found = finder_.find(tool_bodies_, search);
  contacts_.assign(found.begin(), found.end());
  for (FoundContact& contact : contacts_) {
    if (contact.key.b.kind == SideKind::kToolLink) continue;
    contact.v_WC = world_.velocity_at(static_cast<int>(contact.key.b.index), contact.p_WC);
  }
  return contacts_;
}

std::span<const FoundContact> Proximity::query(const VirtualTool& tool, double epsilon) {
  return find(tool, {.epsilon = epsilon, .of_tool = true});
}

std::span<const FoundContact> Proximity::query(int body, double epsilon) {
  place_world();
  const auto found = finder_.find({&body, 1}, {.epsilon = epsilon});
  contacts_.assign(found.begin(), found.end());
  for (FoundContact& contact : contacts_) {
    contact.v_WC = world_.velocity_at(static_cast<int>(contact.key.b.index), contact.p_WC);
  }
  return contacts_;
}

double Proximity::thickness_of(const CollisionId& id) {
  const auto known = thickness_.find(id);
  if (known != thickness_.end()) return known->second;
  const bool is_skin = world_.collision(id).mesh != nullptr;
  return thickness_[id] = is_skin ? 0 : thickness(world_.convex(id));
}

Overlap Proximity::overlap(const VirtualTool& tool,
                           const std::function<bool(int body)>& stops_tool) {
  Overlap overlap;
  for (const FoundContact& contact : find(tool, {.of_tool = true, .remembers = false})) {
    const int body = static_cast<int>(contact.key.b.index);
    if (contact.key.b.kind == SideKind::kToolLink || !stops_tool(body)) continue;
    const double of_tool = thickness_of(contact.own);
    const double both = of_tool + thickness_of(contact.other);
    overlap.depth = std::max(overlap.depth, -contact.separation);
    overlap.is_through |= -contact.separation > std::min(kNotThrough * both, of_tool / 2);
  }
  overlap.is_through |= finder_.lost();
  return overlap;
}

std::span<const ToolContact> Proximity::within_reach(
    const VirtualTool& tool, double reach, const std::function<bool(int body)>& stops_tool) {
  within_reach_.clear();
  find(tool, {.epsilon = reach, .all_axes = true, .of_tool = true});
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
