// What a virtual tool is made of: a tree of links joined to each other and to the world.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "hlm/common/joint_curve.h"
#include "hlm/common/sentence.h"
#include "hlm/common/spatial.h"
#include "hlm/common/static_vector.h"

namespace hlm {

/// Largest number of degrees of freedom d of a virtual tool.
inline constexpr int kMaxDof = 16;
/// Largest length of a configuration q: a free joint has six velocities but seven coordinates.
inline constexpr int kMaxConfiguration = kMaxDof + 1;
inline constexpr std::size_t kMaxLinks = 16;

/// How a link moves against its parent. J is the joint's frame, fixed in the parent.
enum class JointType : std::uint8_t {
  kFixed = 0,      ///< Not at all.
  kRevolute = 1,   ///< Rotation about `axis`; q: angle, rad.
  kPrismatic = 2,  ///< Translation along `axis`; q: distance, m.
  kPlanar = 3,     ///< x, y, then rotation about z of J; q: x (m), y (m), θ (rad).
  kFree = 4,       ///< Root link only. q: p_JL (m), R_JL (w, x, y, z); velocity: of the link's
                   ///< origin (m/s), then angular (rad/s), both in J's axes.
  kGuided = 5,     ///< Along its JointCurve; q: a mechanism's coordinate, between its limits.
  kFollowing = 6,  ///< Along its JointCurve, by the q of a guided link before it.
};

/// Degrees of freedom of a joint.
int joint_dof(JointType joint) noexcept;
/// Number of coordinates of a joint.
int joint_configuration_size(JointType joint) noexcept;
/// Whether it moves along or about an axis.
constexpr bool has_axis(JointType joint) noexcept {
  return joint == JointType::kRevolute || joint == JointType::kPrismatic;
}
/// Whether it moves along a JointCurve.
constexpr bool has_curve(JointType joint) noexcept {
  return joint == JointType::kGuided || joint == JointType::kFollowing;
}
/// Whether it has one coordinate, which may have limits, and a drive.
constexpr bool has_one_coordinate(JointType joint) noexcept {
  return has_axis(joint) || joint == JointType::kGuided;
}

/// A limit this far away is none, rad or m.
inline constexpr double kNoLimit = 1e9;

struct Link {
  int parent = -1;  ///< Index of the parent, smaller than the link's own; -1 is the world.
  JointType joint = JointType::kFree;
  Pose X_PJ;                             ///< Joint frame in the parent's link frame.
  Vector3 axis = Vector3::UnitZ();       ///< Unit axis in J (revolute, prismatic).
  double mass = 1;                       ///< kg, >= 0.
  Vector3 p_LCom = Vector3::Zero();      ///< Centre of mass in the link frame, m.
  Matrix3 I_LCom = Matrix3::Identity();  ///< Inertia about the centre of mass, link axes, kg·m².
  double lower = -kNoLimit;              ///< Least q of a joint with one coordinate, rad or m.
  double upper = kNoLimit;               ///< Largest q, >= lower.
};

/// A virtual tool: rigid object or linkage.
struct ToolDescription {
  StaticVector<Link, kMaxLinks> links;  ///< Parents before children; link 0 is the only root.
  StaticVector<JointCurve, kMaxLinks> curves;  ///< One for each link that has one.
  int hand_link = 0;                           ///< The link that the user holds.
  Pose X_LH;                                   ///< Hand frame in that link's frame.
  Vector3 gravity_W = Vector3::Zero();         ///< Acceleration of gravity, world, m/s².
  double length = 0.1;  ///< Characteristic length, m: weighs rotation against translation where
                        ///< fewer than six degrees of freedom make the hand's wrench ambiguous.

  int dof() const noexcept;
  int configuration_size() const noexcept;
};

/// Why a description cannot be used, naming the link, the value and what is allowed; empty if
/// valid. Checks the tree's order, joint types and their place, curves, finite values, unit axes
/// and quaternions, limits in order, non-negative masses, symmetric non-negative inertias, d within
/// [1, kMaxDof]. Allocates nothing.
std::optional<Sentence> find_error(const ToolDescription& tool);

/// Whether two links of a valid tool are one rigid object, or a joint connects them.
bool are_joined(const ToolDescription& tool, int first, int second) noexcept;

}  // namespace hlm
