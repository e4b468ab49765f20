// The cores of a tool shape and a body shape, both seen in the body's frame B.
#pragma once

#include "hlm/geometry/convex.h"
#include "hlm/geometry/tolerances.h"
#include "hlm/geometry/work.h"

namespace hlm::geometry {

/// Frames: T the tool shape, B the body shape. Normals point from the body to the tool.
struct CorePair {
  const Convex& tool;
  const Convex& body;
  Matrix3 R_BT = Matrix3::Identity();
  Vector3 p_BT = Vector3::Zero();  ///< m.
  /// Whether libccd, which allocates, has the last word where our own polytope stops: at
  /// extremely long shapes in each other by 0.3 m and more. Without it these are refused.
  bool may_allocate = true;

  CorePair(const Convex& tool_shape, const Pose& X_WT, const Convex& body_shape, const Pose& X_WB)
      : tool(tool_shape), body(body_shape) {
    const Pose X_BT = X_WB.inverse() * X_WT;
    R_BT = X_BT.R.toRotationMatrix();
    p_BT = X_BT.p;
  }

  /// Point of the tool's core farthest along `direction`, in B, m.
  Vector3 tool_support(const Vector3& direction) const noexcept {
    return p_BT + R_BT * tool.support(R_BT.transpose() * direction);
  }
  /// Point of the body's core farthest along `direction`, in B, m.
  Vector3 body_support(const Vector3& direction) const noexcept { return body.support(direction); }

  /// Gap between the cores as seen along the unit normal n_B, m, negative if they overlap there.
  /// No normal has one larger than the cores' signed distance; one normal has one equal to that.
  double gap(const Vector3& n_B) const noexcept {
    constexpr std::uint64_t kGapWork = 15;
    Work::add(kGapWork);
    return n_B.dot(tool_support(-n_B) - body_support(n_B));
  }
};

/// Calls use(n_B) with all unit cross products of listed edges, both ways. Hulls list none: they
/// have too many (Convex::is_hull()).
template <class Use>
void for_each_edge_axis(const CorePair& pair, const Use& use) {
  for (const Vector3& e_T : pair.tool.edge_directions()) {
    const Vector3 e = pair.R_BT * e_T;
    for (const Vector3& f : pair.body.edge_directions()) {
      const Vector3 n = e.cross(f);
      const double sine = n.norm();
      if (!(sine > narrow::kDirection)) continue;
      use(Vector3(n / sine));
      use(Vector3(-n / sine));
    }
  }
}

/// Uses these and all unit normals of faces. Among them is every face normal of the
/// Minkowski difference of two polytopes that are no hulls, and no gap is larger than the signed
/// distance; which pairs of edges make a face need not be known.
template <class Use>
void for_each_axis(const CorePair& pair, const Use& use) {
  for (const Vector3& n : pair.body.face_normals()) use(n);
  for (const Vector3& n_T : pair.tool.face_normals()) use(Vector3(-(pair.R_BT * n_T)));
  for_each_edge_axis(pair, use);
}

}  // namespace hlm::geometry
