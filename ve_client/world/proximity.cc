#include "ve_client/world/proximity.h"

#include <algorithm>

namespace hlm::ve {
namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

}  // namespace

Proximity::Proximity(World& world, const ToolAssembly& assembly)
    : world_(world), tool_bodies_(assembly.bodies) {
  for (const BodyDescription& body : world_.description().bodies) {
    std::vector<Convex>& shapes = body_shapes_.emplace_back();
    for (const CollisionDescription& collision : body.collisions) {
      shapes.emplace_back(collision.shape);
    }
  }
  for (int link = 0; link < static_cast<int>(tool_bodies_.size()); ++link) {
    const int body = tool_bodies_[at(link)];
    const auto& collisions = world_.description().bodies[at(body)].collisions;
    for (int shape = 0; shape < static_cast<int>(collisions.size()); ++shape) {
      tool_shapes_.push_back(
          {link, shape, collisions[at(shape)].X_BG, Convex(collisions[at(shape)].shape)});
    }
  }
}

const CollisionDescription& Proximity::collision(int body, int shape) const {
  return world_.description().bodies[at(body)].collisions[at(shape)];
}

std::span<const FoundContact> Proximity::query(const VirtualTool& tool, double epsilon) {
  contacts_.clear();
  for (const ToolShape& tool_shape : tool_shapes_) {
    const Pose X_WG = tool.X_WB(tool_shape.link) * tool_shape.X_BG;
    Eigen::AlignedBox3d box = tool_shape.convex.bounds(X_WG);
    box.min().array() -= epsilon;
    box.max().array() += epsilon;
    world_.find_near(box, near_);
    for (const CollisionId& other : near_) query_pair(tool_shape, X_WG, other, epsilon);
  }
  return contacts_;
}

void Proximity::query_pair(const ToolShape& tool_shape, const Pose& X_WG, CollisionId other,
                           double epsilon) {
  const Pose X_WO = world_.X_WB(other.body) * collision(other.body, other.shape).X_BG;
  const Convex& convex = body_shapes_[at(other.body)][at(other.shape)];
  for (const ManifoldPoint& point :
       find_contacts(tool_shape.convex, X_WG, convex, X_WO, epsilon, statistics_)) {
    FoundContact& contact = contacts_.emplace_back();
    contact.key.link = static_cast<std::uint16_t>(tool_shape.link);
    contact.key.tool_feature = point.tool_feature;
    contact.key.tool_feature.shape = static_cast<std::uint8_t>(tool_shape.shape);
    contact.key.body = static_cast<std::uint32_t>(other.body);
    contact.key.body_feature = point.body_feature;
    contact.key.body_feature.shape = static_cast<std::uint8_t>(other.shape);
    contact.p_WC = point.p_WC;
    contact.n_W = point.n_W;
    contact.separation = point.separation;
    contact.v_WC = world_.velocity_at(other.body, point.p_WC);
  }
}

std::span<const ToolContact> Proximity::within_reach(const VirtualTool& tool, double reach) {
  within_reach_.clear();
  for (const FoundContact& found : query(tool, reach)) {
    ToolContact& contact = within_reach_.emplace_back();
    contact.tool_body = tool_bodies_[found.key.link];
    contact.body = static_cast<int>(found.key.body);
    contact.p_W = found.p_WC;
    contact.n_W = found.n_W;
    contact.separation = found.separation;
    contact.friction = std::min(collision(contact.tool_body, found.key.tool_feature.shape).friction,
                                collision(contact.body, found.key.body_feature.shape).friction);
  }
  return within_reach_;
}

}  // namespace hlm::ve
