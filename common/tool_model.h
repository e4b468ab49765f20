// Kinematics and dynamics of a virtual tool: D(q), c(q, q̇), G(q) and Jacobians (docs/method.md 1,
// Eq. 7).
#pragma once

#include <array>

#include "hlm/common/spatial.h"
#include "hlm/common/tool_description.h"

namespace hlm {

/// Configuration q; length ToolDescription::configuration_size().
using Configuration = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxConfiguration, 1>;
/// Generalised velocity q̇, length d.
using Velocity = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxDof, 1>;
/// Generalised force τ, length d.
using GeneralisedForce = Velocity;
/// d×d.
using MassMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxDof, kMaxDof>;
/// 6×d: twist (world axes) of a frame's origin from q̇.
using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, kMaxDof>;
/// 3×d: velocity (world axes) of a point from q̇.
using PointJacobian = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxDof>;

/// A tool at one configuration: where its links are, how they move and what moves them. No function
/// allocates.
class ToolModel {
 public:
  /// `tool` must be valid (find_error). Starts at neutral().
  explicit ToolModel(const ToolDescription& tool) noexcept;

  const ToolDescription& description() const noexcept { return tool_; }
  int dof() const noexcept { return dof_; }
  int configuration_size() const noexcept { return configuration_size_; }
  int links() const noexcept { return static_cast<int>(tool_.links.size()); }

  /// All coordinates zero, quaternions identity.
  Configuration neutral() const noexcept;
  /// Moves the tool to q and evaluates its kinematics.
  void set_configuration(const Configuration& q) noexcept;
  const Configuration& configuration() const noexcept { return q_; }
  /// q moved by q̇ for dt seconds (exact for constant q̇); quaternions stay unit.
  Configuration integrate(const Configuration& q, const Velocity& v, double dt) const noexcept;

  /// Where in q and in q̇ a link's joint begins; of one that follows, its leader's.
  int coordinate_index(int link) const noexcept {
    return joints_[static_cast<std::size_t>(link)].coordinate;
  }
  int velocity_index(int link) const noexcept {
    return coordinate_of(joints_[static_cast<std::size_t>(link)].first);
  }

  /// Pose of a link in the world.
  const Pose& X_WL(int link) const noexcept { return X_WL_[static_cast<std::size_t>(link)]; }
  /// Pose of the hand's frame in the world.
  Pose X_WH() const noexcept { return X_WL(tool_.hand_link) * tool_.X_LH; }

  /// Jacobian of the point of `link` that is now at p_W (m, world), 6×d.
  Jacobian jacobian(int link, const Vector3& p_W) const noexcept;
  /// J_i, 3×d: velocity of the point of `link` that is now at p_W.
  PointJacobian point_jacobian(int link, const Vector3& p_W) const noexcept;
  /// J_h, 6×d: twist of the hand's frame, world axes.
  Jacobian hand_jacobian() const noexcept { return jacobian(tool_.hand_link, X_WH().p); }

  /// D(q), d×d, symmetric positive definite.
  MassMatrix mass_matrix() const noexcept;
  /// G(q), N or N·m: the generalised force of weight stands on the left of Eq. 7, D q̈ + c + G = ….
  GeneralisedForce gravity() const noexcept;
  /// c(q, q̇), N or N·m: Coriolis, centripetal and gyroscopic terms, on the left of Eq. 7 too. What
  /// D q̈ would have to be balanced by if no coordinate accelerated; quadratic in q̇. By recursive
  /// Newton-Euler (Featherstone, Rigid Body Dynamics Algorithms, 2008, 5.3).
  GeneralisedForce bias_force(const Velocity& v) const noexcept;

 private:
  /// A link's joint: its first motion, and how many it has; its first coordinate; its curve.
  struct Joint {
    int first = 0;
    int count = 0;
    int coordinate = 0;
    int curve = -1;
  };
  static constexpr int kMaxMotions = kMaxDof + static_cast<int>(kMaxLinks);

  void number_joints() noexcept;
  CurvePoint curve_point(const Joint& joint) const noexcept;
  /// How the axis of a link that has a curve changes as its coordinate moves at that speed: the
  /// acceleration of the point at the root link's origin, world axes.
  Vector6 bend_of(int link, double speed) const noexcept;
  Pose joint_transform(const Link& link, const Joint& joint) const noexcept;
  void write_motion_axes(const Link& link, const Pose& X_WJ, const Pose& X_WL,
                         const Joint& joint) noexcept;
  bool moves(int motion, int link) const noexcept {
    return (moving_[static_cast<std::size_t>(link)] >> motion) & 1u;
  }
  int coordinate_of(int motion) const noexcept {
    return coordinates_[static_cast<std::size_t>(motion)];
  }

  ToolDescription tool_;
  int dof_ = 0;
  int configuration_size_ = 0;
  Configuration q_;
  std::array<Pose, kMaxLinks> X_WL_{};
  std::array<Joint, kMaxLinks> joints_{};
  /// Of each motion, one of a joint's, its velocity coordinate, which links that follow share.
  std::array<int, kMaxMotions> coordinates_{};
  /// Twist at the root link's origin per unit of each motion's coordinate, world axes.
  Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, kMaxMotions> axes_;
  /// Bit j: motion j moves the link.
  std::array<std::uint32_t, kMaxLinks> moving_{};
};

/// The least share of a coordinate's inertia that is its own, not one that other coordinates move
/// too: below, rounding of D would be more than 1e-6 of what is left.
inline constexpr double kSmallestShare = 1e-10;

/// Why D(q) cannot be inverted at the tool's configuration, naming the joint's link; empty if it
/// can.
std::optional<Sentence> find_singular_error(const ToolModel& tool) noexcept;

}  // namespace hlm
