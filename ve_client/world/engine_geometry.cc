#include "hlm/ve_client/world/engine_geometry.h"

namespace hlm::ve {
namespace {

Eigen::AlignedBox3d bounds_of(const Hull& hull) {
  Eigen::AlignedBox3d box;
  for (const Vector3& p : hull.vertices) box.extend(p);
  return box;
}

/// Creates the geometry; only a plane takes anything from the pose.
dGeomID create(dSpaceID space, const Shape& shape, const Pose& X_WG) {
  struct Creator {
    dGeomID operator()(const Sphere& s) const { return dCreateSphere(space, s.radius); }
    dGeomID operator()(const Capsule& s) const { return dCreateCapsule(space, s.radius, s.length); }
    dGeomID operator()(const Cylinder& s) const {
      return dCreateCylinder(space, s.radius, s.length);
    }
    dGeomID operator()(const Box& s) const { return box(s.size); }
    dGeomID operator()(const Ellipsoid& s) const { return box(2 * s.radii); }
    dGeomID operator()(const Hull& s) const { return box(bounds_of(s).sizes()); }
    dGeomID operator()(const HalfSpace&) const {
      const Vector3 n = X_WG.R * Vector3::UnitZ();
      return dCreatePlane(space, n.x(), n.y(), n.z(), n.dot(X_WG.p));
    }
    dGeomID box(const Vector3& size) const {
      return dCreateBox(space, size.x(), size.y(), size.z());
    }
    dSpaceID space;
    const Pose& X_WG;
  };
  return std::visit(Creator{space, X_WG}, shape);
}

}  // namespace

dGeomID create_geometry(dSpaceID space, const Shape& shape, const Pose& X_WG, dBodyID body,
                        const Pose& X_BG) {
  if (std::holds_alternative<HalfSpace>(shape)) return create(space, shape, X_WG);
  const dGeomID geometry = create(nullptr, shape, X_WG);
  Pose X_GE;  // E: the engine's geometry.
  if (const Hull* hull = std::get_if<Hull>(&shape)) X_GE.p = bounds_of(*hull).center();
  const auto set_pose = [&](auto set_position, auto set_rotation, const Pose& X) {
    const dQuaternion q = {X.R.w(), X.R.x(), X.R.y(), X.R.z()};
    set_position(geometry, X.p.x(), X.p.y(), X.p.z());
    set_rotation(geometry, q);
  };
  if (body == nullptr) {
    set_pose(dGeomSetPosition, dGeomSetQuaternion, X_WG * X_GE);
  } else {
    dGeomSetBody(geometry, body);
    set_pose(dGeomSetOffsetPosition, dGeomSetOffsetQuaternion, X_BG * X_GE);
  }
  // A quadtree takes what it is given for where its bounds were last: many in one cell, to be moved
  // to their own one by one, take time with the square of their number.
  dReal bounds[6];
  dGeomGetAABB(geometry, bounds);
  dSpaceAdd(space, geometry);
  return geometry;
}

}  // namespace hlm::ve
