// The rigid frames whose points the local contacts join: the world, the links of the tool, and the
// movable bodies near it (docs/method.md 11).
#pragma once

#include <cstdint>

#include "hlm/common/tool_model.h"
#include "hlm/haptic_server/local_model/local_body.h"

namespace hlm::server {

using FrameIndex = std::uint8_t;
inline constexpr FrameIndex kWorldFrame = 0;
inline constexpr FrameIndex kFirstLinkFrame = 1;
inline constexpr std::size_t kMaxFrames = 1 + kMaxLinks + kMaxMovedBodies;

/// Poses in the world by frame: the world, then links, then bodies.
using FramePoses = StaticVector<Placement, kMaxFrames>;
FramePoses poses_of(const ToolModel& tool, const LocalBodies& bodies) noexcept;
inline FrameIndex frame_of_link(std::uint32_t link) noexcept {
  return static_cast<FrameIndex>(kFirstLinkFrame + link);
}
inline FrameIndex frame_of_body(const ToolModel& tool, std::size_t slot) noexcept {
  return static_cast<FrameIndex>(static_cast<std::size_t>(kFirstLinkFrame + tool.links()) + slot);
}

/// Unknowns of a step: q̇⁺ of the tool, then for each body what its velocity changes by, in the
/// coordinates of LocalBody::B.
inline constexpr int kMaxUnknowns = kMaxDof + 6 * static_cast<int>(kMaxMovedBodies);
using Unknowns = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxUnknowns, 1>;
using SystemMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxUnknowns, kMaxUnknowns>;

/// Twists by frame.
using FrameTwists = StaticVector<Twist, kMaxFrames>;

/// How one frame moves. Twists are those of the frame's point at the common reference point O.
struct FrameMotion {
  Placement X_W;
  Twist V = Twist::Zero();       ///< Twist at the start of the step.
  Twist V_bias = Twist::Zero();  ///< Twist at the end of the step if all unknowns were zero.
  int first = 0;                 ///< First of the unknowns that move the frame.
  Jacobian J;                    ///< 6×n: V at the end of the step = V_bias + J x.
};

/// How all frames move in one step.
class FrameMotions {
 public:
  /// v: q̇ of the tool at the start of the step; null: it stays, and adds no unknowns. dt: s.
  FrameMotions(const ToolModel& tool, const Velocity* v, const LocalBodies& bodies,
               double dt) noexcept;

  const FrameMotion& operator[](FrameIndex i) const noexcept { return frames_[i]; }
  /// O, world, m.
  const Vector3& reference_W() const noexcept { return O_W_; }
  int unknowns() const noexcept { return unknowns_; }
  std::size_t count() const noexcept { return frames_.size(); }
  /// Twists about O at the start of the step, and at its end.
  FrameTwists twists() const noexcept;
  FrameTwists twists(const Unknowns& x) const noexcept;

 private:
  Vector3 O_W_;
  int unknowns_ = 0;
  StaticVector<FrameMotion, kMaxFrames> frames_;
};

/// Moves the bodies by a step of dt (s) that ends with the unknowns x. tool: the one of the frames.
void advance_bodies(LocalBodies& bodies, Mechanisms& mechanisms, const ToolModel& tool,
                    const FrameMotions& frames, const Unknowns& x, double dt) noexcept;

}  // namespace hlm::server
