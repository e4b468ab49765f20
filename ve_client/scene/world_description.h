// What a virtual environment is made of, as plain values: bodies, joints, models.
#pragma once

#include <array>
#include <cmath>
#include <compare>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hlm/common/spatial.h"
#include "hlm/common/tool_count.h"
#include "hlm/common/tool_description.h"
#include "hlm/geometry/mesh.h"
#include "hlm/geometry/shape.h"
#include "hlm/ve_client/scene/diagnostics.h"
#include "hlm/ve_client/scene/geometry.h"

namespace hlm::ve {

/// μ where the file does not say, as SDFormat has it.
inline constexpr double kDefaultFriction = 1;

/// One collision shape of a body. B is the body's frame, G the shape's.
struct CollisionDescription {
  std::string name;
  Shape shape;
  Pose X_BG;
  std::optional<double> friction;    ///< μ, >= 0; none: the file does not say.
  std::shared_ptr<const Mesh> mesh;  ///< What the shape is a piece of the skin of; mostly null.
  std::size_t triangle = 0;          ///< Triangle of the mesh which the piece is behind.
};

/// A rigid body: one SDF link. Its frame B has its origin at the centre of mass and the link's
/// axes.
struct BodyDescription {
  std::string name;                   ///< Scoped, for example "robot::arm".
  bool fixed = false;                 ///< Never moves (a link of a static model).
  bool weightless = false;            ///< Gravity does not act on it.
  double mass = 1;                    ///< kg, > 0.
  Matrix3 I_B = Matrix3::Identity();  ///< Inertia about the centre of mass, axes of B, kg·m².
  Pose X_WB;                          ///< Initial pose.
  Vector3 p_BS = Vector3::Zero();     ///< Origin of the SDF link's frame S (same axes), m.
  std::vector<CollisionDescription> collisions;
};

/// How a joint lets its child move against its parent.
enum class BodyJoint : std::uint8_t {
  kFixed,      ///< Not at all.
  kRevolute,   ///< About its axis.
  kPrismatic,  ///< Along its axis.
  kBall,       ///< About its point, any way. Has no coordinate, limits or spring; not in tools.
};

/// A joint; its coordinate is zero in the initial poses. J is its frame, fixed in the child.
struct JointDescription {
  std::string name;
  BodyJoint type = BodyJoint::kFixed;
  int parent = -1;                                          ///< Body index; -1 is the world.
  int child = 0;                                            ///< Body index.
  Pose X_WJ;                                                ///< Initial pose of J.
  Vector3 axis_J = Vector3::UnitZ();                        ///< Unit.
  double lower = -std::numeric_limits<double>::infinity();  ///< rad or m, <= 0.
  double upper = std::numeric_limits<double>::infinity();   ///< rad or m, >= 0.
  double stiffness = 0;                                     ///< N·m/rad or N/m, >= 0.
  double rest = 0;     ///< Position in which the spring is at rest, rad or m.
  double damping = 0;  ///< N·m·s/rad or N·s/m, >= 0.

  bool sprung() const { return stiffness > 0 || damping > 0; }
  bool limited() const { return std::isfinite(lower) || std::isfinite(upper); }
};

/// Where a model may begin other than where the file places it: <haptic:start>.
struct StartDescription {
  std::string name;
  Pose X_WM;
};

/// <haptic:gripper>: a servo on joints of the tool, one on each.
struct GripperDescription {
  std::vector<std::string> joints;  ///< Scoped, without the model's name.
  double closed = 0;                ///< Positions of the joints, rad or m,
  double open = 0;                  ///< in which it is open.
  double stiffness = 0;             ///< Of each servo, N/m or N·m/rad, >= 0.
  double damping = 0;               ///< N·s/m or N·m·s/rad, >= 0.
  double force = 0;                 ///< Its largest, N or N·m, > 0.
};

/// A top-level model: a range of bodies (with those of its nested models) and what it says of its
/// use as virtual tool.
struct ModelDescription {
  std::string name;
  bool fixed = false;
  Pose X_WM;  ///< Initial pose of the model's frame.
  int first_body = 0;
  int body_count = 0;
  /// <haptic:tool_joint>: how the tool's root moves in the world; empty if not given.
  std::optional<JointType> tool_joint;
  /// <haptic:hand>: link held by the user (scoped, without the model's name) and the hand's frame
  /// in that link's SDF frame; empty if not given.
  std::optional<std::string> hand_link;
  Pose X_SH;
  std::vector<StartDescription> starts;
  std::optional<GripperDescription> gripper;
  Place place;  ///< Place in the file.
};

/// How finely the world is simulated; what is not given the world chooses (World).
struct SolverDescription {
  std::optional<double> largest_step;  ///< Longest step of the solver, s, > 0.
  std::optional<int> sweeps;           ///< Over all constraints in each step, > 0.
};

struct WorldDescription {
  /// <haptic:tool> and <haptic:second_tool>: the models that users hold; empty: not given.
  std::array<std::string, kMostTools> tools;
  std::string description;  ///< <haptic:description>: what is to be felt; empty: not given.
  Vector3 gravity_W = Vector3::Zero();  ///< m/s².
  SolverDescription solver;
  std::vector<BodyDescription> bodies;  ///< In the file's order: the index is a stable identity.
  std::vector<JointDescription> joints;
  std::vector<ModelDescription> models;
};

/// The models of the world for messages, or "none".
std::string model_names(const WorldDescription& world);

/// Throws std::runtime_error with one line that lists the models there are if `name` is none.
const ModelDescription& find_model(const WorldDescription& world, const std::string& name);

/// The world with a model, its bodies and joints, at another initial pose. Throws as find_model().
WorldDescription with_model_at(WorldDescription world, const std::string& model, const Pose& X_WM);

/// The world with a model at its start of that name; empty: as the file places it. Throws as
/// find_model(), and std::runtime_error that lists the model's starts if it has none of that name.
WorldDescription with_start(WorldDescription world, const std::string& model,
                            const std::string& start);

}  // namespace hlm::ve
