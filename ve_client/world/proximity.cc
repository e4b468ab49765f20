#include "ve_client/world/proximity.h"

namespace hlm::ve {
namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

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

}  // namespace

Proximity::Proximity(World& world, const ToolAssembly& assembly)
    : world_(world), tool_bodies_(assembly.bodies) {
  for (int link = 0; link < static_cast<int>(tool_bodies_.size()); ++link) {
    const int body = tool_bodies_[at(link)];
    const auto count = world_.description().bodies[at(body)].collisions.size();
    for (int shape = 0; shape < static_cast<int>(count); ++shape) {
      tool_shapes_.push_back({link, {body, shape}});
    }
  }
  for (const ToolShape& a : tool_shapes_) {
    for (const ToolShape& b : tool_shapes_) {
      if (b.link >= a.link) break;
      if (!are_joined(assembly.description, a.link, b.link)) tool_pairs_.push_back({a, b});
    }
  }
}

std::span<const FoundContact> Proximity::query(const VirtualTool& tool, double epsilon) {
  contacts_.clear();
  sides_before_ = std::exchange(sides_, {});
  for (const auto& [link, id] : tool_shapes_) {
    const Pose X_WG = tool.X_WB(link) * world_.collision(id).X_BG;
    query_shape(side_of_link(link), id, X_WG, epsilon);
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
  for (const ManifoldPoint& point :
       find_contacts(shape_a, X_WA, shape_b, X_WB, epsilon, statistics_)) {
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
}

std::span<const FoundContact> Proximity::query(int body, double epsilon) {
  contacts_.clear();
  const auto count = world_.description().bodies[at(body)].collisions.size();
  for (int shape = 0; shape < static_cast<int>(count); ++shape) {
    const CollisionId id{body, shape};
    query_shape({SideKind::kMovableBody, static_cast<std::uint32_t>(body)}, id, world_.X_WG(id),
                epsilon);
  }
  merge();
  return contacts_;
}

void Proximity::query_shape(const ContactSide& side, const CollisionId& id, const Pose& X_WG,
                            double epsilon) {
  world_.find_near(inflated(world_.convex(id).bounds(X_WG), epsilon), near_);
  for (const CollisionId& other : near_) {
    // The tool's own shapes are never found; it touches all others.
    const bool touches = side.kind == SideKind::kToolLink || world_.can_touch(id.body, other.body);
    if (touches) query_pair(side, id, X_WG, other, epsilon);
  }
}

void Proximity::query_pair(const ContactSide& side, const CollisionId& id, const Pose& X_WG,
                           const CollisionId& other, double epsilon) {
  const ContactSide other_side{SideKind::kWorld, static_cast<std::uint32_t>(other.body)};
  const auto friction = friction_between(world_.collision(id), world_.collision(other));
  const Pose X_WO = world_.X_WG(other);
  const bool has_side = side.kind == SideKind::kToolLink && world_.is_movable(other.body);
  std::optional<Vector3> before;
  if (has_side) {
    const auto known = sides_before_.find({id, other});
    if (known != sides_before_.end()) before = known->second;
  }
  const Manifold manifold = find_contacts(world_.convex(id), X_WG, world_.convex(other), X_WO,
                                          epsilon, statistics_, before);
  if (has_side && !manifold.empty()) {
    sides_[{id, other}] = X_WO.R.conjugate() * manifold.front().n_W;
  }
  const std::size_t first = contacts_.size();
  for (const ManifoldPoint& point : manifold) {
    FoundContact& contact =
        contacts_.emplace_back(found_contact(point, side, id, other_side, other));
    contact.v_WC = world_.velocity_at(other.body, point.p_WC);
    contact.friction = friction.value_or(contact.friction);
  }
  resolve({world_.pieces().of(id), X_WG}, {world_.pieces().of(other), X_WO}, first);
}

std::span<const ToolContact> Proximity::within_reach(
    const VirtualTool& tool, double reach, const std::function<bool(int body)>& stops_tool) {
  within_reach_.clear();
  for (const FoundContact& found : query(tool, reach)) {
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
