#include "hlm/haptic_server/local_model/frames.h"

namespace hlm::server {

FramePoses poses_of(const ToolModel& tool, const LocalBodies& bodies) noexcept {
  FramePoses poses(1);
  for (int i = 0; i < tool.links(); ++i) poses.emplace_back(tool.X_WL(i));
  for (const LocalBody& body : bodies) poses.emplace_back(body.X_WB);
  return poses;
}

FrameMotions::FrameMotions(const ToolModel& tool, const Velocity* v, const LocalBodies& bodies,
                           double dt) noexcept
    : O_W_(tool.X_WL(0).p), unknowns_(v != nullptr ? tool.dof() : 0) {
  frames_.emplace_back().J.resize(6, 0);
  for (int i = 0; i < tool.links(); ++i) {
    FrameMotion& frame = frames_.emplace_back();
    frame.X_W = Placement(tool.X_WL(i));
    if (v != nullptr) {
      frame.J = tool.jacobian(i, O_W_);
      frame.V = frame.J.lazyProduct(*v);
    } else {
      frame.J.resize(6, 0);
    }
  }
  for (const LocalBody& body : bodies) {
    const int before = frames_.back().first;
    FrameMotion& frame = frames_.emplace_back();
    frame.X_W = Placement(body.X_WB);
    const bool shares = body.mechanism >= 0 && body.member > 0;
    frame.first = shares ? before : unknowns_;
    if (!shares) unknowns_ += static_cast<int>(body.B.cols());
    const Vector3 arm = O_W_ - body.X_WB.p;
    frame.V = shifted(body.V_W, arm);
    frame.V_bias = shifted(body.free_twist(dt), arm);
    frame.J = body.B;
    frame.J.topRows<3>() += skew(-arm).lazyProduct(body.B.bottomRows<3>());
  }
}

FrameTwists FrameMotions::twists() const noexcept {
  FrameTwists twists;
  for (const FrameMotion& frame : frames_) twists.push_back(frame.V);
  return twists;
}

FrameTwists FrameMotions::twists(const Unknowns& x) const noexcept {
  FrameTwists twists;
  for (const FrameMotion& frame : frames_) {
    Twist& V = twists.emplace_back(frame.V_bias);
    const Eigen::Index count = frame.J.cols();
    if (count > 0) V += frame.J.lazyProduct(x.segment(frame.first, count));
  }
  return twists;
}

void advance_bodies(LocalBodies& bodies, Mechanisms& mechanisms, const ToolModel& tool,
                    const FrameMotions& frames, const Unknowns& x, double dt) noexcept {
  for (std::size_t slot = 0; slot < bodies.size(); ++slot) {
    LocalBody& body = bodies[slot];
    const FrameMotion& frame = frames[frame_of_body(tool, slot)];
    const auto y = x.segment(frame.first, frame.J.cols());
    if (body.mechanism < 0) {
      body.advance(body.free_twist(dt) + body.B.lazyProduct(y), dt);
      continue;
    }
    Mechanism& mechanism = mechanisms[static_cast<std::size_t>(body.mechanism)];
    if (body.member == 0) mechanism.advance(y);
    move_with(body, mechanism);
  }
}

}  // namespace hlm::server
