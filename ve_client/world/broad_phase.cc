#include "hlm/ve_client/world/broad_phase.h"

#include <algorithm>
#include <variant>

#include "hlm/ve_client/world/engine_geometry.h"

namespace hlm::ve {
namespace {

const CollisionId* id_of(dGeomID geometry) {
  return static_cast<const CollisionId*>(dGeomGetData(geometry));
}

dGeomID as_geometry(const dxSpace* space) {
  return reinterpret_cast<dGeomID>(const_cast<dxSpace*>(space));
}

/// A quadtree, seen along z, around all shapes in their initial poses. What leaves it, and
/// half-spaces, are in its root.
dSpaceID create_still_space(const WorldDescription& world,
                            const std::vector<std::vector<Convex>>& shapes) {
  Eigen::AlignedBox3d box(Vector3::Zero());
  for (std::size_t body = 0; body < world.bodies.size(); ++body) {
    const auto& collisions = world.bodies[body].collisions;
    for (std::size_t i = 0; i < collisions.size(); ++i) {
      if (std::holds_alternative<HalfSpace>(collisions[i].shape)) continue;
      box.extend(shapes[body][i].bounds(world.bodies[body].X_WB * collisions[i].X_BG));
    }
  }
  constexpr int kDepth = 6;  // 4096 cells.
  const Vector3 c = box.center();
  const Vector3 half = box.sizes() / 2;
  const dVector3 center = {c.x(), c.y(), c.z()};
  const dVector3 half_extents = {half.x(), half.y(), half.z()};
  return dQuadTreeSpaceCreate(nullptr, center, half_extents, kDepth);
}

void call(void* meet, dGeomID first, dGeomID second) {
  (*static_cast<const BroadPhase::Meet*>(meet))(*id_of(first), *id_of(second));
}

}  // namespace

BroadPhase::BroadPhase(const WorldDescription& description, std::span<const dBodyID> bodies,
                       const std::vector<std::vector<Convex>>& shapes,
                       const std::vector<bool>& is_tool)
    : moving_(dSweepAndPruneSpaceCreate(nullptr, dSAP_AXES_XYZ)),
      still_(create_still_space(description, shapes)),
      geometries_(bodies.size()) {
  std::size_t count = 0;
  for (const BodyDescription& body : description.bodies) count += body.collisions.size();
  ids_.reserve(count);  // Geometries keep pointers into it.
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    if (is_tool[i]) continue;
    const BodyDescription& body = description.bodies[i];
    for (const CollisionDescription& collision : body.collisions) {
      const dGeomID geometry =
          create_geometry(bodies[i] == nullptr ? still_.get() : moving_.get(), collision.shape,
                          body.X_WB * collision.X_BG, bodies[i], collision.X_BG);
      const int shape = static_cast<int>(&collision - body.collisions.data());
      ids_.push_back({static_cast<int>(i), shape});
      dGeomSetData(geometry, &ids_.back());
      if (bodies[i] != nullptr) geometries_[i].push_back(geometry);
    }
  }
}

void BroadPhase::set_still(int body, bool still) {
  const dSpaceID from = still ? moving_.get() : still_.get();
  const dSpaceID to = still ? still_.get() : moving_.get();
  for (const dGeomID geometry : geometries_[static_cast<std::size_t>(body)]) {
    if (dGeomGetSpace(geometry) != from) continue;
    dSpaceRemove(from, geometry);
    dSpaceAdd(to, geometry);
  }
}

void BroadPhase::for_moving_pairs(const Meet& meet) const {
  dSpaceCollide(moving_.get(), const_cast<Meet*>(&meet), call);
}

void BroadPhase::for_still_near(int body, const Meet& meet) const {
  for (const dGeomID geometry : geometries_[static_cast<std::size_t>(body)]) {
    const std::function<void(const CollisionId&, const CollisionId&)> ordered =
        [&](const CollisionId& first, const CollisionId& second) {
          first.body == body ? meet(first, second) : meet(second, first);
        };
    dSpaceCollide2(geometry, as_geometry(still_.get()), const_cast<Meet*>(&ordered), call);
  }
}

}  // namespace hlm::ve
