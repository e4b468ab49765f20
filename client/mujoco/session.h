// A MuJoCo world in the hand.
//
//   hlm::mujoco::Session touch(socket, model, data, "tool", options);
//   while (running) {
//     const int steps = touch.drive();                        // proxy pose onto the tool
//     for (int i = 0; i < steps; ++i) mj_step(&model, &data);
//     touch.send();                                           // where bodies are
//   }
//
// Header only, over hlm::client and the user's MuJoCo; examples/mujoco_cpp is a whole program.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <mujoco/mujoco.h>

#include "hlm/client/contact_check.h"
#include "hlm/client/haptic_client.h"
#include "hlm/client/mujoco/bodies.h"
#include "hlm/client/mujoco/dynamics.h"
#include "hlm/client/mujoco/shapes.h"
#include "hlm/common/steady_seconds.h"

namespace hlm::mujoco {

struct Options {
  protocol::Endpoint server;
  double period = 1.0 / 60;                        ///< Roughly that of the frames, s.
  std::function<double()> clock = steady_seconds;  ///< s, any steady origin.
};

/// The body of that name, if it can be a tool. Throws std::invalid_argument if there is none, it
/// has no free joint, or other bodies are welded to it.
inline int find_tool(const mjModel& model, const std::string& name) {
  const int tool = mj_name2id(&model, mjOBJ_BODY, name.c_str());
  if (tool < 0) throw std::invalid_argument("the model has no body '" + name + "'");
  const int joint = model.body_jntadr[tool];
  if (joint < 0 || model.jnt_type[joint] != mjJNT_FREE) {
    throw std::invalid_argument("body '" + name +
                                "' must have a free joint, as the tool moves freely in the hand");
  }
  if (std::count(model.body_weldid, model.body_weldid + model.nbody, tool) > 1) {
    throw std::invalid_argument(
        "body '" + name + "' has bodies without joints welded to it; put their geoms into it");
  }
  return tool;
}

/// What a hand holds when it holds this body.
inline ToolDescription tool_of(const mjModel& model, int body) {
  const Matrix3 R = rotation_of(model.body_iquat + 4 * body).toRotationMatrix();
  Link link;
  link.mass = model.body_mass[body];
  link.p_LCom = row3(model.body_ipos, body);
  link.I_LCom = R * row3(model.body_inertia, body).asDiagonal() * R.transpose();
  ToolDescription tool;
  tool.links.push_back(link);
  tool.gravity_W = row3(model.opt.gravity, 0);
  double size = 0.01;  // m
  for (int geom = 0; geom < model.ngeom; ++geom) {
    if (model.geom_bodyid[geom] != body) continue;
    size = std::max(size, row3(model.geom_size, geom).cwiseAbs().maxCoeff());
  }
  tool.length = 2 * size;
  return tool;
}

/// A client for one model, which it changes: the tool resists nothing between two calls of drive().
/// The server has the geoms and finds their contacts; a flex is not felt. While the server answers,
/// the tool's geoms make no force of their own: the tool is where the proxy is, and bodies are
/// pushed by the impulses that the hand felt. Any body with degrees of freedom can be pushed. From
/// drive() to send() these pushes are part of xfrc_applied; a force of your own there stays if you
/// set it before drive(). The hand also feels what else pushes the tool: external_wrench().
class Session {
 public:
  /// All must outlive this. Throws std::invalid_argument if the tool, a geom or the options cannot
  /// be used.
  Session(protocol::DatagramLink& link, mjModel& model, mjData& data, const std::string& tool,
          const Options& options)
      : model_(model),
        data_(data),
        clock_(options.clock),
        tool_(find_tool(model, tool)),
        q_at_(model.jnt_qposadr[model.body_jntadr[tool_]]),
        v_at_(model.jnt_dofadr[model.body_jntadr[tool_]]),
        virtual_tool_(tool_of(model, tool_)),
        q_(Eigen::Map<const Configuration>(data.qpos + q_at_, 7)),
        client_(link, client_options(options)),
        shapes_(model, tool_),
        bodies_(model, tool_, changes_) {
    of_tool_ = listings(model, [this](int body) { return body == tool_; });
    mj_forward(&model, &data);
    protocol::SceneOffer offer = shapes_.offer(data);
    bodies_.add_dynamics(data, offer);
    bodies_.keep(tool_);
    client_.offer_scene(std::move(offer));
  }

  /// Before a frame: puts the tool where the proxy is, and applies its impulses on bodies as
  /// wrenches during all of the frame's steps. Returns how many steps to take: they bring MuJoCo's
  /// time up to the hand's, so frames may be late. 0 if less than a step has passed.
  int drive() {
    pushes_.take_back(data_);  // Of a frame that was not sent.
    const protocol::ProxyState* proxy = client_.poll(clock_()).state;
    if (proxy != nullptr) {
      q_ = proxy->q;
      v_ = proxy->v;
      contacts_ = proxy->active_contacts;
    }
    const int steps = client_.take_steps(model_.opt.timestep);
    frame_ = steps * model_.opt.timestep;
    was_reset_ = was_reset_ || data_.time < time_;
    time_ = data_.time;
    bodies_.place(data_, tool_, {q_.head<3>(), {q_[3], q_[4], q_[5], q_[6]}}, v_);
    place_held();
    for (const Listing& listing : of_tool_) listing.set_force(client_.tool_pushes(), changes_);
    for (const protocol::BodyImpulse& due : client_.take_impulses(frame_)) {
      // Whatever a server says, it can push no body that was not reported to it.
      if (!reported_.contains(due.body)) continue;
      pushes_.add(data_, static_cast<int>(due.body), due.P_W / frame_);
    }
    return steps;
  }

  /// After a frame: sends where bodies are, at the poses to which the steps led. Throws
  /// std::invalid_argument if MuJoCo's state is not finite, or something in it is out of a server's
  /// range.
  void send() {
    const double passed = std::clamp(double{data_.time} - time_, 0.0, frame_);
    was_reset_ = was_reset_ || data_.time < time_;
    time_ = data_.time;
    for (const int body : bodies_.leave(data_, passed)) {
      taken_.insert(static_cast<std::uint32_t>(body));
    }
    if (frame_ == 0) return;
    const double sampled_at = clock_();
    mj_forward(&model_, &data_);
    protocol::ContactUpdate update;
    update.q_VE = Eigen::Map<const Configuration>(data_.qpos + q_at_, 7);
    update.v_VE = Eigen::Map<const Velocity>(data_.qvel + v_at_, 6);
    update.v_VE.tail<3>() = rotation_of(data_.qpos + q_at_ + 3) * Vector3(update.v_VE.tail<3>());
    virtual_tool_.set_configuration(update.q_VE);
    const std::vector<WorldShapes::Moving> moving = shapes_.moving(data_);
    update.poses = shapes_.poses_of(data_, moving, frame_);
    for (BodyPose& pose : update.poses) pose.kept = was_reset_ || taken_.contains(pose.body);
    was_reset_ = false;
    std::vector<int> near;
    for (const auto& [body, gap] : moving) {
      if (gap <= reach() && !shapes_.is_mocap(body)) near.push_back(body);
    }
    shapes_.add_touching(data_, near);
    // What touches one that the server cannot hold goes with it.
    std::erase_if(near, [&](int body) { return client_.holds(static_cast<std::uint32_t>(body)); });
    shapes_.add_touching(data_, near);
    for (const int body : near) {
      if (update.bodies.size() == kMaxBodies) break;
      const auto number = static_cast<std::uint32_t>(body);
      if (std::ranges::find(update.poses, number, &BodyPose::body) == update.poses.end()) continue;
      update.bodies.push_back(describe(model_, data_, body, pushes_.on(data_, body)));
      reported_.insert(number);
    }
    pushes_.take_back(data_);
    if (const auto error = find_error(update, virtual_tool_)) throw std::invalid_argument(*error);
    client_.sample(sampled_at, update.q_VE, update.v_VE, frame_);
    client_.follow_accelerations(update.bodies);
    client_.add_external(0, external_wrench(model_, data_, tool_));
    client_.send(clock_(), {}, update.bodies, update.poses);
  }

  /// Ends the session. The model is as it was before, and so is xfrc_applied.
  void close() {
    client_.close(clock_());
    pushes_.take_back(data_);
    changes_.give_all_back();
  }

  HapticClient& client() { return client_; }
  /// Where the proxy is, and how many contacts it has.
  const Configuration& q() const { return q_; }
  std::size_t contacts() const { return contacts_; }

 private:
  /// Bodies within this distance are sent, plus how far the tool travels until the third update
  /// from now has come, up to the farthest, m: a body that was not sent is a wall.
  double reach() const {
    constexpr double kNear = 0.02;
    constexpr double kFarthest = 0.3;
    constexpr double kUsualSpeed = 0.3;  // m/s: of a hand that was at rest.
    const double delay = client_.round_trip() + 2 * frame_;
    return std::min(kNear + 4.5 * delay * std::max(v_.head<3>().norm(), kUsualSpeed), kFarthest);
  }

  /// Puts the bodies that the hand holds where the server has them. What was reset or put elsewhere
  /// is let go of.
  void place_held() {
    for (const HeldPlace& held : client_.take_held()) {
      const auto body = static_cast<int>(held.body);
      // Whatever a server says, it can move no body that is not there.
      if (body <= 0 || body >= model_.nbody || body == tool_) continue;
      if (model_.body_jntnum[body] != 1) continue;
      if (was_reset_ || bodies_.was_moved(data_, body)) taken_.insert(held.body);
      const bool taken = taken_.contains(held.body);
      if (!taken) bodies_.place(data_, body, held.X_WB, held.V_W, held.joint);
      is_held(held.number) && !taken ? bodies_.keep(body) : bodies_.let_go(body);
      if (!is_held(held.number)) taken_.erase(held.body);
    }
  }

  HapticClientOptions client_options(const Options& options) const {
    HapticClientOptions client;
    client.server = options.server;
    client.tool = virtual_tool_.description();
    client.q = q_;
    client.ve_rate = 1 / options.period;
    return client;
  }

  mjModel& model_;
  mjData& data_;
  std::function<double()> clock_;
  int tool_;          ///< Body.
  int q_at_;          ///< Place in qpos,
  int v_at_;          ///< and in qvel.
  double frame_ = 0;  ///< Length of the present frame's steps, s.
  ToolModel virtual_tool_;
  Configuration q_;
  Velocity v_ = Velocity::Zero(6);
  HapticClient client_;
  WorldShapes shapes_;
  Changes changes_;
  Bodies bodies_;
  std::vector<Listing> of_tool_;
  Pushes pushes_;
  double time_ = 0;                   ///< MuJoCo's, when we saw it last, s.
  bool was_reset_ = false;            ///< Since then it went back.
  std::set<std::uint32_t> taken_;     ///< Bodies that were held, and were put elsewhere.
  std::set<std::uint32_t> reported_;  ///< Bodies.
  std::size_t contacts_ = 0;          ///< Of the tool, at the server.
};

}  // namespace hlm::mujoco
