#include "hlm/haptic_server/device/workspace.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <sstream>
#include <utility>
#include <vector>

namespace hlm::server {
namespace {

constexpr Range kScales{1e-3, 1e3};
constexpr Range kClutches{0, 32};
constexpr Range kForces{0.01, Range::kInfinite, "N"};
constexpr Range kTorques{1e-4, Range::kInfinite, "N·m"};
constexpr double kLargestAngle = 360;  // Degrees.

/// "x", "-y" and the like.
std::optional<Vector3> axis(const std::string& word) {
  const bool is_negative = word.starts_with('-');
  const std::string letter = word.substr(is_negative || word.starts_with('+') ? 1 : 0);
  if (letter != "x" && letter != "y" && letter != "z") return std::nullopt;
  return (is_negative ? -1 : 1) * Vector3::Unit(letter[0] - 'x');
}

/// An angle given in degrees, as radians.
std::optional<double> angle(const std::string& word) {
  std::istringstream text(word);
  double degrees = 0;
  if (!(text >> degrees) || !text.eof() || !(std::abs(degrees) <= kLargestAngle)) {
    return std::nullopt;
  }
  return degrees * std::numbers::pi / 180;
}

/// The three columns or angles; empty unless every word is one.
template <class Part>
std::vector<Part> parts(const std::vector<std::string>& words,
                        std::optional<Part> (*read)(const std::string&)) {
  std::vector<Part> all;
  for (const std::string& word : words) {
    if (const auto part = read(word)) all.push_back(*part);
  }
  return all.size() == 3 && words.size() == 3 ? all : std::vector<Part>{};
}

/// R_WB, or a matrix that is no rotation; empty if the text is neither axes nor angles.
std::optional<Matrix3> matrix_of(const std::string& frame) {
  std::istringstream text(frame);
  const std::vector<std::string> words{std::istream_iterator<std::string>(text), {}};
  Matrix3 R;
  if (const auto axes = parts(words, axis); !axes.empty()) {
    R << axes[0], axes[1], axes[2];
    return R;
  }
  if (const auto angles = parts(words, angle); !angles.empty()) {
    R = Eigen::AngleAxisd(angles[2], Vector3::UnitZ()) *
        Eigen::AngleAxisd(angles[1], Vector3::UnitY()) *
        Eigen::AngleAxisd(angles[0], Vector3::UnitX());
    return R;
  }
  return std::nullopt;
}

/// The world's directions that are made of the device's free ones alone.
Freedoms freedoms_in_world(Freedoms device, const Matrix3& R_WB) noexcept {
  constexpr double kNothing = 1e-9;
  Freedoms world = 0;
  for (int i = 0; i < 6; ++i) {
    bool moves = true;
    for (int j = 0; j < 3; ++j) {
      const bool is_free = (device >> (i / 3 * 3 + j) & 1) != 0;
      if (!is_free && std::abs(R_WB(i % 3, j)) > kNothing) moves = false;
    }
    if (moves) world = static_cast<Freedoms>(world | 1 << i);
  }
  return world;
}

}  // namespace

void add_keys(settings::Table& table, Workspace& workspace) {
  table.group("Workspace");
  table.text("frame", workspace.frame, "AXES",
             "Where the device's x, y and z point in the world, as '-z x y', or its roll, pitch "
             "and yaw there, degrees, as '0 0 90'");
  table.number("scale", workspace.scale, kScales, "Metres in the world for each of the handle");
  table.number("rotation-scale", workspace.rotation_scale, kScales,
               "Radians in the world for each of the handle");
  table.whole("clutch", workspace.clutch, kClutches,
              "Button that frees the handle while it is held, from 1; 0 is none");
  table.number("own-force-limit", workspace.max_force, kForces,
               "Largest force at this handle, below its rating");
  table.number("own-torque-limit", workspace.max_torque, kTorques,
               "Largest torque at this handle, below its rating");
}

std::optional<std::string> find_error(const Workspace& workspace) {
  const std::optional<Matrix3> R_WB = matrix_of(workspace.frame);
  const std::string name = "frame '" + workspace.frame + "' ";
  if (!R_WB) return name + "must be three axes, as 'x y z' or '-z x y', or three angles in degrees";
  const double volume = R_WB->determinant();
  if (std::abs(volume) < 0.5) return name + "must have each axis once";
  if (volume < 0) return name + "must be right-handed: this one mirrors; turn one sign round";
  return std::nullopt;
}

Matrix3 rotation_of(const Workspace& workspace) { return *matrix_of(workspace.frame); }

DeviceRatings ratings_in_world(const DeviceRatings& handle, const Workspace& workspace) noexcept {
  const double s = workspace.scale;
  const double r = workspace.rotation_scale;
  DeviceRatings world = handle;
  world.max_force = std::min(handle.max_force, workspace.max_force);
  world.continuous_force = std::min(handle.continuous_force, workspace.max_force);
  world.max_torque = std::min(handle.max_torque, workspace.max_torque) * (s / r);
  world.max_torque_rate *= s / r;
  world.max_stiffness /= s;
  world.max_angular_stiffness *= s / (r * r);
  world.mass /= s;
  world.inertia *= s / (r * r);
  world.damping /= s;
  world.position_step *= s;
  world.speed_step *= s;
  world.turn_step *= r;
  world.freedoms = freedoms_in_world(handle.freedoms, rotation_of(workspace));
  world.scale = s;
  world.rotation_scale = r;
  return world;
}

WorkspaceDevice::WorkspaceDevice(std::unique_ptr<Device> raw, const Workspace& workspace)
    : raw_(std::move(raw)),
      R_WB_(rotation_of(workspace)),
      scale_(workspace.scale),
      rotation_scale_(workspace.rotation_scale),
      clutch_(workspace.clutch > 0 ? 1u << (workspace.clutch - 1) : 0),
      ratings_(ratings_in_world(raw_->ratings(), workspace)) {}

GuidedHand* WorkspaceDevice::guided_hand() noexcept {
  return raw_->guided_hand() != nullptr ? this : nullptr;
}

Vector6 WorkspaceDevice::to_world(const Vector6& v, double linear, double angular) const noexcept {
  Vector6 v_W;
  v_W << linear * (R_WB_ * v.head<3>()), angular * (R_WB_ * v.tail<3>());
  return v_W;
}

Vector6 WorkspaceDevice::to_device(const Vector6& v_W, double linear,
                                   double angular) const noexcept {
  Vector6 v;
  v << linear * (R_WB_.transpose() * v_W.head<3>()), angular * (R_WB_.transpose() * v_W.tail<3>());
  return v;
}

void WorkspaceDevice::align(const Pose& X_WH) noexcept {
  // A simulated handle goes there; a real one stays where it is.
  const Quaternion R_BW(Matrix3(R_WB_.transpose()));
  raw_->align({R_BW * X_WH.p / scale_, (R_BW * X_WH.R).normalized()});
  X_WD_ = X_WH;
  aligns_ = true;
  has_force_ = false;
}

/// The handle has moved from where it was read last to X_BD.
void WorkspaceDevice::follow(const Pose& X_BD) noexcept {
  const Vector6 moves = to_world(displacement(X_BD_, X_BD), scale_, rotation_scale_);
  X_WD_.p += moves.head<3>();
  X_WD_.R = (rotation_from_vector(moves.tail<3>()) * X_WD_.R).normalized();
}

std::optional<DeviceState> WorkspaceDevice::read() noexcept {
  std::optional<DeviceState> state = raw_->read();
  if (!state) return state;
  state->clutched = (state->buttons & clutch_) != 0;
  const bool stays = state->clutched && !has_force_;
  if (!aligns_ && !stays) follow(state->X_WD);
  aligns_ = false;
  X_BD_ = state->X_WD;
  state->X_WD = X_WD_;
  state->V_WD = stays ? Twist(Twist::Zero()) : to_world(state->V_WD, scale_, rotation_scale_);
  if (!state->F_hand) return state;
  state->F_hand =
      stays ? Wrench(Wrench::Zero()) : to_world(*state->F_hand, 1, scale_ / rotation_scale_);
  return state;
}

bool WorkspaceDevice::write(const Wrench& F) noexcept {
  has_force_ = !F.isZero(0);
  return raw_->write(to_device(F, 1, rotation_scale_ / scale_));
}

void WorkspaceDevice::hold(const Pose& X_WTarget) noexcept {
  const Vector6 way = to_device(displacement(X_WD_, X_WTarget), 1 / scale_, 1 / rotation_scale_);
  raw_->guided_hand()->hold(
      {X_BD_.p + way.head<3>(), rotation_from_vector(way.tail<3>()) * X_BD_.R});
}

}  // namespace hlm::server
