// Virtual tools in MuJoCo, whose dynamics share no code with ours.
#pragma once

#include <cstdio>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>

#include <mujoco/mujoco.h>
#include <stdlib.h>
#include <unistd.h>

#include "tests/support/catch.h"
#include "tests/support/random_tool.h"

namespace hlm::test {

/// The same tool as a MuJoCo model.
class MujocoTool {
 public:
  explicit MujocoTool(const ToolDescription& tool) : tool_(tool) {
    char path[] = "/tmp/haptic_tool_XXXXXX";
    close(mkstemp(path));
    std::ofstream(path) << xml();
    char error[500] = "";
    model_.reset(mj_loadXML(path, nullptr, error, sizeof error));
    std::remove(path);
    INFO(error << xml());
    REQUIRE(model_ != nullptr);
    data_.reset(mj_makeData(model_.get()));
  }

  void set_configuration(const Configuration& q) {
    std::copy(q.begin(), q.end(), data_->qpos);
    mj_forward(model_.get(), data_.get());
  }

  MassMatrix mass_matrix() const {
    const int d = model_->nv;
    Eigen::Matrix<double, -1, -1, Eigen::RowMajor> full(d, d);
    mj_fullM(model_.get(), full.data(), data_->qM);
    const MassMatrix T = to_mujoco();
    return T.transpose() * full * T;
  }

  /// c + G: MuJoCo's bias at q̇. Our quasi-velocities differ from its own by a rotation of ω into
  /// the body's axes, whose rate, -ω×ω, is zero.
  GeneralisedForce bias_force(const Velocity& v) {
    const Velocity v_mujoco = to_mujoco() * v;
    std::copy(v_mujoco.begin(), v_mujoco.end(), data_->qvel);
    mj_forward(model_.get(), data_.get());
    return to_mujoco().transpose() *
           Eigen::Map<const Eigen::VectorXd>(data_->qfrc_bias, model_->nv);
  }
  /// Moves the tool from q at velocity v for `duration` seconds: Runge-Kutta in steps of 0.1 ms.
  Configuration move(const Configuration& q, const Velocity& v, double duration) {
    set_configuration(q);
    const Velocity v_mujoco = to_mujoco() * v;
    std::copy(v_mujoco.begin(), v_mujoco.end(), data_->qvel);
    model_->opt.integrator = mjINT_RK4;
    model_->opt.timestep = 1e-4;
    for (int i = 0; i < duration / model_->opt.timestep; ++i) mj_step(model_.get(), data_.get());
    return Eigen::Map<const Eigen::VectorXd>(data_->qpos, model_->nq);
  }
  GeneralisedForce gravity() { return bias_force(Velocity::Zero(model_->nv)); }

  Jacobian jacobian(int link, const Vector3& p_W) const {
    const int d = model_->nv;
    Eigen::Matrix<double, 6, -1, Eigen::RowMajor> J(6, d);
    mj_jac(model_.get(), data_.get(), J.data(), J.data() + 3 * d, p_W.data(), link + 1);
    return J * to_mujoco();
  }

 private:
  /// MuJoCo gives a free joint's angular velocity in the body's axes, ours is in the joint's.
  MassMatrix to_mujoco() const {
    MassMatrix T = MassMatrix::Identity(model_->nv, model_->nv);
    if (tool_.links[0].joint == JointType::kFree) {
      const double* q = data_->qpos;
      T.block<3, 3>(3, 3) = Quaternion(q[3], q[4], q[5], q[6]).toRotationMatrix().transpose();
    }
    return T;
  }

  std::string xml() const {
    std::ostringstream out;
    out.precision(17);
    out << "<mujoco><compiler angle='radian' inertiafromgeom='false' balanceinertia='false'/>"
        << "<option gravity='" << tool_.gravity_W.transpose() << "'/><worldbody>";
    write_body(out, 0);
    out << "</worldbody></mujoco>";
    return out.str();
  }

  void write_body(std::ostream& out, int index) const {
    const Link& link = tool_.links[static_cast<std::size_t>(index)];
    const Quaternion& R = link.X_PJ.R;
    const Matrix3& I = link.I_LCom;
    out << "<body name='" << index << "' pos='" << link.X_PJ.p.transpose() << "' quat='" << R.w()
        << ' ' << R.vec().transpose() << "'>";
    write_joint(out, link);
    out << "<inertial pos='" << link.p_LCom.transpose() << "' mass='" << link.mass
        << "' fullinertia='" << I(0, 0) << ' ' << I(1, 1) << ' ' << I(2, 2) << ' ' << I(0, 1) << ' '
        << I(0, 2) << ' ' << I(1, 2) << "'/>";
    for (std::size_t i = 0; i < tool_.links.size(); ++i) {
      if (tool_.links[i].parent == index) write_body(out, static_cast<int>(i));
    }
    out << "</body>";
  }

  static void write_joint(std::ostream& out, const Link& link) {
    switch (link.joint) {
      case JointType::kFixed:
      case JointType::kGuided:
      case JointType::kFollowing:
        return;
      case JointType::kFree:
        out << "<freejoint/>";
        return;
      case JointType::kPlanar:
        out << "<joint type='slide' axis='1 0 0'/><joint type='slide' axis='0 1 0'/>"
            << "<joint type='hinge' axis='0 0 1'/>";
        return;
      case JointType::kRevolute:
      case JointType::kPrismatic:
        out << "<joint type='" << (link.joint == JointType::kRevolute ? "hinge" : "slide")
            << "' axis='" << link.axis.transpose() << "'/>";
    }
  }

  ToolDescription tool_;
  std::unique_ptr<mjModel, decltype(&mj_deleteModel)> model_{nullptr, &mj_deleteModel};
  std::unique_ptr<mjData, decltype(&mj_deleteData)> data_{nullptr, &mj_deleteData};
};

/// A tree whose links keep their depth-first order, as MuJoCo numbers its bodies and joints.
inline ToolDescription random_chain(Random& random, int count, JointType root) {
  ToolDescription tool = random_tool(random, count, root);
  for (int i = 1; i < count; ++i) tool.links[static_cast<std::size_t>(i)].parent = i - 1;
  // A branch: the last link hangs on the root.
  if (count > 2) tool.links.back().parent = 0;
  // MuJoCo places a free joint in the world whatever its body's frame.
  if (root == JointType::kFree) tool.links[0].X_PJ = Pose{};
  return tool;
}

}  // namespace hlm::test
