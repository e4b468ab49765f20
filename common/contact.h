// A contact between the virtual tool and the virtual environment, as the environment reports it.
#pragma once

#include <algorithm>
#include <compare>
#include <cstddef>
#include <cstdint>

#include "hlm/common/spatial.h"
#include "hlm/common/static_vector.h"
#include "hlm/common/tool_description.h"
#include "hlm/common/vocabulary.h"

namespace hlm {

/// Largest number of contacts in one update: some 64 of the tool and those of the bodies near it.
inline constexpr std::size_t kMaxContacts = 192;
/// Largest number of movable bodies in one update, and of those that our server moves. Each adds up
/// to six unknowns to a step of its local model; bodies beyond are moving constraints to it.
inline constexpr std::size_t kMaxBodies = 16;
inline constexpr std::size_t kMaxMovedBodies = 16;
/// Of these, those that it moves ahead of reports, each of which repeats steps.
inline constexpr std::size_t kMaxBodiesAhead = 8;
/// Largest number of bodies whose poses are in one update.
inline constexpr std::size_t kMaxPoses = 64;

/// Axes of a pair that are less apart than this, rad, are one to its forces, those of the first.
/// Larger values make forces along a normal that is off by this much, smaller ones split the
/// contacts of two faces that lie on each other with a tilt.
inline constexpr double kOneAxis = 0.1;

/// Largest age of contacts when they come, s: their computation and half a round trip. More renders
/// force from a world that has moved on, less shuts out far networks.
inline constexpr double kOldestContacts = 0.5;
/// The same where the server has the shapes: what stands still is right however old the update is.
inline constexpr double kOldestPoses = 2;

/// What a side of a contact belongs to.
enum class SideKind : std::uint8_t {
  kWorld = 0,
  kToolLink = 1,
  kMovableBody = 2,
};
template <>
inline constexpr std::array<Word<SideKind>, 3> kWords<SideKind>{{
    {SideKind::kWorld, "world", "what does not move, or moves regardless of the tool"},
    {SideKind::kToolLink, "tool_link", "a link of the virtual tool"},
    {SideKind::kMovableBody, "movable_body", "a body that the tool can push"},
}};

/// One of the two sides of a contact.
struct ContactSide {
  SideKind kind = SideKind::kWorld;
  std::uint32_t index = 0;  ///< Index of the link, or the environment's own number for the body.

  auto operator<=>(const ContactSide&) const = default;
};

/// What two coefficients of friction make of a contact: of two rules the later one counts, as in
/// PhysX and Rapier.
enum class FrictionRule : std::uint8_t {
  kAverage = 0,
  kMinimum = 1,
  kProduct = 2,
  kMaximum = 3,
};
template <>
inline constexpr std::array<Word<FrictionRule>, 4> kWords<FrictionRule>{{
    {FrictionRule::kAverage, "average", "their mean, as Rapier and PhysX"},
    {FrictionRule::kMinimum, "minimum", "the smaller one, as ve_client"},
    {FrictionRule::kProduct, "product", "their product, as Bullet"},
    {FrictionRule::kMaximum, "maximum", "the larger one, as MuJoCo"},
}};

/// A coefficient of friction, and how it is combined.
struct Friction {
  double coefficient = -1;  ///< Negative: it does not say.
  FrictionRule rule = FrictionRule::kMinimum;
  std::uint8_t priority = 0;  ///< Of two the higher one's coefficient counts alone, as in MuJoCo.

  bool operator==(const Friction&) const = default;
};

/// That of a contact of two; negative if neither says.
constexpr double combine(const Friction& a, const Friction& b) noexcept {
  if (a.coefficient < 0) return b.coefficient;
  if (b.coefficient < 0) return a.coefficient;
  if (a.priority != b.priority) return a.priority > b.priority ? a.coefficient : b.coefficient;
  switch (std::max(a.rule, b.rule)) {
    case FrictionRule::kAverage:
      return (a.coefficient + b.coefficient) / 2;
    case FrictionRule::kMinimum:
      return std::min(a.coefficient, b.coefficient);
    case FrictionRule::kProduct:
      return a.coefficient * b.coefficient;
    case FrictionRule::kMaximum:
      return std::max(a.coefficient, b.coefficient);
  }
  return -1;
}

/// The side that owns a contact's plane, with which the contact turns.
enum class PlaneOwner : std::uint8_t {
  kB = 0,
  kA = 1,
};
template <>
inline constexpr std::array<Word<PlaneOwner>, 2> kWords<PlaneOwner>{{
    {PlaneOwner::kB, "b", "a face of b, or of neither, as where two edges cross"},
    {PlaneOwner::kA, "a", "a face of a, on a corner or an edge of b"},
}};

/// One active (separation <= 0) or ε-active (0 < separation <= ε) contact between two sides.
struct ReportedContact {
  /// The same from update to update while the contact lasts, different for any two contacts of one
  /// update. Whoever makes contacts chooses it: feature pairs, or a tracker's own numbers.
  std::uint64_t identity = 0;
  std::uint32_t pair = 0;  ///< Which two convex pieces; 0 if the environment does not say.
  /// 0, without meaning: clients before 0.5 number separating axes of the pair.
  std::uint16_t axis = 0;
  ContactSide a{SideKind::kToolLink,
                0};  ///< The side that the normal points to: the tool, if it takes part.
  ContactSide b;
  Vector3 p_WC = Vector3::Zero();  ///< Point on the surface of b (the local constraint), world, m.
  Vector3 n_W = Vector3::UnitZ();  ///< Unit normal from b to a, world.
  double separation = 0;  ///< True separation σ, m; negative when the true shapes overlap.
  Vector3 v_WC = Vector3::Zero();  ///< Velocity of b's point, world, m/s.
  /// Coefficient of friction of the two materials; negative: the server's own coefficients.
  double friction = -1;
  double load = 0;  ///< Present normal force of a contact without the tool, N, >= 0.
  PlaneOwner plane = PlaneOwner::kB;
};

using ReportedContacts = StaticVector<ReportedContact, kMaxContacts>;

/// What turning leaves a body's shape as it is. Its contacts do not go round with it.
enum class Roundness : std::uint8_t {
  kNone = 0,
  kAxis = 1,
  kSphere = 2,
};
template <>
inline constexpr std::array<Word<Roundness>, 3> kWords<Roundness>{{
    {Roundness::kNone, "none", "every turn changes where its surface is"},
    {Roundness::kAxis, "axis", "a surface of revolution about an axis through the centre of mass"},
    {Roundness::kSphere, "sphere", "a sphere about the centre of mass"},
}};

/// A body that the tool can push, at the environment's latest step. World axes, about its centre of
/// mass.
struct MovableBody {
  std::uint32_t id = 0;              ///< ContactSide::index of its contacts.
  Vector3 p_WCom = Vector3::Zero();  ///< Centre of mass, world, m.
  Vector6 V_W = Vector6::Zero();     ///< Twist, m/s and rad/s.
  /// Inverse inertia that its joints leave it, 1/kg and 1/(kg·m²): symmetric, no negative
  /// eigenvalue.
  Matrix6 W = Matrix6::Zero();
  Vector6 A_W = Vector6::Zero();  ///< Acceleration by all forces except contacts, m/s², rad/s².
  /// Total impulse of the tool that this state contains, of those that the server has reported
  /// since the session began: N·s and N·m·s.
  Vector6 P_W = Vector6::Zero();
  Roundness roundness = Roundness::kNone;
  Vector3 axis_W = Vector3::Zero();  ///< Unit axis of revolution, with Roundness::kAxis.
};

using MovableBodies = StaticVector<MovableBody, kMaxBodies>;

/// How fast the acceleration of a body changes by all forces except contacts, 1/s of it: that of
/// one on a spring, or that an engine drives to and fro.
struct AccelerationRate {
  std::uint32_t body = 0;  ///< Its id.
  Vector6 A_rate_W = Vector6::Zero();
};

using AccelerationRates = StaticVector<AccelerationRate, kMaxBodies>;

/// What else than contacts and the weight of the tool pushes one of its links: a weld, a tendon, a
/// payload, drag, or a robot's force sensor.
struct ExternalWrench {
  std::uint8_t link = 0;        ///< Index of the link.
  Wrench F_W = Wrench::Zero();  ///< About the origin of its frame, world axes, N and N·m.
};

using ExternalWrenches = StaticVector<ExternalWrench, kMaxLinks>;

/// Where a body is whose shapes the server has, and how it moves, at the environment's latest step.
struct BodyPose {
  std::uint32_t body = 0;     ///< The environment's own number, as in ContactSide::index.
  Pose X_WB;                  ///< The body's frame in the world.
  Twist V_W = Twist::Zero();  ///< Twist at that frame's origin, world axes, m/s and rad/s.
  bool kept = false;          ///< As in Ownership, which says it to the server.
};

using BodyPoses = StaticVector<BodyPose, kMaxPoses>;

/// Who moves a body, as a number that only rises: odd, the server, because it bears upon the tool;
/// even, the environment. Late and lost datagrams undo nothing.
struct Ownership {
  std::uint32_t body = 0;
  std::uint32_t number = 0;
  bool kept = false;  ///< The environment lets nobody else move it.
  /// How much slower its time goes than the hand's, in 1/255: 0 not, 255 it stands still. Its twist
  /// is that in the hand's time.
  std::uint8_t slowed = 0;

  /// Of its time in the hand's, 0 to 1.
  constexpr double pace() const noexcept { return 1 - slowed / 255.0; }
};
constexpr bool is_held(std::uint32_t number) noexcept { return number % 2 == 1; }

using Ownerships = StaticVector<Ownership, kMaxPoses>;

/// What the server must know of a body to move it, in the frame of its shapes.
struct BodyInertia {
  std::uint32_t body = 0;
  double mass = 1;                       ///< kg, > 0.
  Vector3 p_BCom = Vector3::Zero();      ///< Centre of mass, m.
  Matrix3 I_BCom = Matrix3::Identity();  ///< About that, kg·m², positive definite.
  Vector3 gravity_W = Vector3::Zero();   ///< What its weight accelerates it by, world, m/s².
  double damping = 0;                    ///< Of its velocity, 1/s,
  double angular_damping = 0;            ///< and of its angular velocity, 1/s.

  bool operator==(const BodyInertia&) const = default;
};

}  // namespace hlm
