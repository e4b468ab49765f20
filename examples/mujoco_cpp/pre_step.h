// A hand in a MuJoCo world whose loop is somebody else's, as that of a simulator for ros2_control
// or of MuJoCo's own viewer: it calls pre_step() before each mj_step(), in real time.
#pragma once

#include <string>

#include <hlm/client/mujoco/session.h>
#include <mujoco/mujoco.h>

class Touch {
 public:
  Touch(hlm::protocol::DatagramLink& link, mjModel& model, mjData& data, const std::string& tool,
        const hlm::mujoco::Options& options)
      : session_(link, model, data, tool, options) {}

  /// At the end of a frame's steps the next frame begins.
  void pre_step(mjData*) {
    if (--left_ > 0) return;
    if (begun_) session_.send();
    left_ = session_.drive();
    begun_ = true;
  }

  hlm::mujoco::Session& session() { return session_; }

 private:
  hlm::mujoco::Session session_;
  int left_ = 0;  ///< Steps of the present frame.
  bool begun_ = false;
};
