#include "hlm/ve_client/world/scene_shapes.h"

#include <algorithm>
#include <map>
#include <utility>
#include <variant>

#include "hlm/geometry/index.h"
#include "hlm/protocol/scene_offer.h"
#include "hlm/ve_client/world/scene_dynamics.h"

namespace hlm::ve {
namespace {

using protocol::SceneShape;
using protocol::SceneShapeKind;

SceneShape wire_shape(const Mesh& mesh) {
  SceneShape shape{.kind = SceneShapeKind::kMesh, .vertices = mesh.points};
  for (const auto& [a, b, c] : mesh.triangles) {
    shape.triangles.push_back({static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b),
                               static_cast<std::uint32_t>(c)});
  }
  return shape;
}

SceneShape wire_shape(const Shape& shape) {
  struct Visitor {
    SceneShape operator()(const Sphere& s) const {
      return {.kind = SceneShapeKind::kSphere, .size = {s.radius, 0, 0}};
    }
    SceneShape operator()(const Capsule& s) const {
      return {.kind = SceneShapeKind::kCapsule, .size = {s.radius, s.length, 0}};
    }
    SceneShape operator()(const Cylinder& s) const {
      return {.kind = SceneShapeKind::kCylinder, .size = {s.radius, s.length, 0}};
    }
    SceneShape operator()(const Box& s) const {
      return {.kind = SceneShapeKind::kBox, .size = s.size};
    }
    SceneShape operator()(const Ellipsoid& s) const {
      return {.kind = SceneShapeKind::kEllipsoid, .size = s.radii};
    }
    SceneShape operator()(const Hull& s) const {
      return {.kind = SceneShapeKind::kHull, .vertices = s.vertices};
    }
    SceneShape operator()(const HalfSpace&) const { return {.kind = SceneShapeKind::kHalfSpace}; }
  };
  return std::visit(Visitor{}, shape);
}

/// Gathers the shapes of bodies.
class Offer {
 public:
  Offer(const World& world, bool friction) : world_(world), friction_(friction) {}

  /// X_SB: the body in its link, in itself, or in the world.
  void add(int body, const ContactSide& side, const Pose& X_SB) {
    const Mesh* mesh = nullptr;  // Its skin is one shape.
    for (const CollisionDescription& collision : world_.description().bodies[at(body)].collisions) {
      const Mesh* const of = collision.mesh.get();
      if (of != nullptr && (of == mesh || (mesh != nullptr && of == mesh->sheet))) continue;
      mesh = of;
      offer_.shapes.push_back(
          {.shape = of != nullptr ? wire_shape(*of) : wire_shape(collision.shape),
           .side = side,
           .X_BS = X_SB * collision.X_BG,
           .friction = {friction_ ? collision.friction.value_or(-1) : -1}});
      body_of_.push_back(body);
    }
  }

  /// Bodies that a joint connects never touch.
  void keep_joined_apart() {
    for (std::uint32_t a = 0; a < body_of_.size(); ++a) {
      for (std::uint32_t b = a + 1; b < body_of_.size(); ++b) {
        const bool moves = world_.is_movable(body_of_[a]) || world_.is_movable(body_of_[b]);
        const bool of_tool = world_.is_tool(body_of_[a]) || world_.is_tool(body_of_[b]);
        if (!moves || of_tool || body_of_[a] == body_of_[b]) continue;
        if (!world_.can_touch(body_of_[a], body_of_[b])) offer_.apart.emplace_back(a, b);
      }
    }
  }

  protocol::SceneOffer take() { return std::move(offer_); }

 private:
  const World& world_;
  bool friction_;
  protocol::SceneOffer offer_;
  std::vector<int> body_of_;  ///< By shape.
};

}  // namespace

protocol::SceneOffer scene_of(const World& world, const ToolAssembly& tool, bool friction) {
  Offer offer(world, friction);
  for (int body = 0; body < static_cast<int>(world.description().bodies.size()); ++body) {
    const auto link = std::ranges::find(tool.bodies, body);
    if (link != tool.bodies.end()) {
      const auto index = static_cast<std::size_t>(link - tool.bodies.begin());
      offer.add(body, {SideKind::kToolLink, static_cast<std::uint32_t>(index)}, tool.X_LB[index]);
    } else if (world.is_movable(body)) {
      offer.add(body, {SideKind::kMovableBody, static_cast<std::uint32_t>(body)}, Pose{});
    } else if (!world.is_tool(body)) {
      offer.add(body, {}, world.X_WB(body));
    }
  }
  offer.keep_joined_apart();
  protocol::SceneOffer scene = offer.take();
  add_dynamics(world, scene);
  return scene;
}

BodyPoses body_poses(const World& world, const VirtualTool& tool, bool kept) {
  std::vector<std::pair<double, int>> bodies;
  const Vector3 here = tool.X_WB(0).p;
  for (int body = 0; body < static_cast<int>(world.description().bodies.size()); ++body) {
    if (!world.is_movable(body)) continue;
    double reach = 0;
    for (const Piece& piece : world.pieces().of(body)) {
      const auto& box = piece.bounds_F;
      reach = std::max(reach, box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).norm());
    }
    bodies.emplace_back((world.X_WB(body).p - here).norm() - reach, body);
  }
  if (bodies.size() > kMaxPoses) {
    std::ranges::sort(bodies);
    bodies.resize(kMaxPoses);
  }
  BodyPoses poses;
  for (const auto& [away, body] : bodies) {
    poses.push_back({.body = static_cast<std::uint32_t>(body),
                     .X_WB = world.X_WB(body),
                     .V_W = world.V_WB(body),
                     .kept = kept});
  }
  return poses;
}

}  // namespace hlm::ve
