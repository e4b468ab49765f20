#include "hlm/common/tool_description.h"

#include <cmath>

#include <Eigen/Eigenvalues>

#include "hlm/common/range.h"

namespace hlm {
namespace {

/// Allowed asymmetry and negative eigenvalue of an inertia, relative to its largest entry.
constexpr double kInertiaTolerance = 1e-9;

bool is_finite(const Pose& X) { return X.p.allFinite() && X.R.coeffs().allFinite(); }

bool is_unit(double length) { return std::abs(length - 1) <= kUnitTolerance; }

// Bounds far beyond any tool: what exceeds them is a mistake, and would carry the proxy to nowhere.
constexpr double kLargestLength = 1e4;   ///< m.
constexpr double kLargestMass = 1e3;     ///< kg.
constexpr double kLargestInertia = 1e6;  ///< kg·m².
constexpr double kLargestGravity = 100;  ///< m/s²: 9810 are millimetres.

/// m: what is divided by the square of less is no longer finite.
constexpr double kSmallestToolLength = 1e-6;

/// Least range of a guided coordinate, rad or m, and least length of a curve's quaternion.
constexpr double kSmallestRange = 1e-6;
constexpr double kLargestArmature = 1e6;  ///< kg or kg·m².
constexpr double kShortestQuaternion = 0.1;
/// Most that it changes by x, as a multiple of its length: it does not vanish between two places.
constexpr double kQuickestTurn = 16;

// What a joint moves and turns at least: with less, divisions by it are no longer finite.
constexpr double kSmallestMass = 1e-6;      ///< kg.
constexpr double kSmallestInertia = 1e-12;  ///< kg·m².

/// Why a vector is not finite and within ±bound; empty if it is.
template <class Values>
std::optional<Sentence> find_error(const char* name, const Values& values, double bound,
                                   const char* unit) {
  if (values.allFinite() && values.cwiseAbs().maxCoeff() <= bound) return std::nullopt;
  return Sentence(name) + " must be finite and within ±" + brief_text(bound) + " " + unit;
}

std::optional<Sentence> find_inertia_error(const Link& link) {
  if (auto error = find_brief_error("mass", link.mass, Range{0, kLargestMass, "kg"})) return error;
  if (auto error = find_error("centre of mass", link.p_LCom, kLargestLength, "m")) return error;
  if (auto error = find_error("inertia", link.I_LCom, kLargestInertia, "kg·m²")) return error;
  const double tolerance = kInertiaTolerance * link.I_LCom.cwiseAbs().maxCoeff();
  if ((link.I_LCom - link.I_LCom.transpose()).cwiseAbs().maxCoeff() > tolerance) {
    return "inertia must be symmetric";
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3> principal(link.I_LCom, Eigen::EigenvaluesOnly);
  if (principal.eigenvalues().minCoeff() < -tolerance) return "inertia must not be negative";
  return std::nullopt;
}

/// The same of a joint's one coordinate.
std::optional<Sentence> find_coordinate_error(const Link& link) {
  if (has_axis(link.joint) && !is_unit(link.axis.norm())) return "axis must have length 1";
  const double most = link.joint == JointType::kGuided ? kLargestLength : kNoLimit;
  if (auto error = find_brief_error("lower limit", link.lower, Range{-most, most})) return error;
  const double least_range = link.joint == JointType::kGuided ? kSmallestRange : 0;
  return find_brief_error("upper limit", link.upper, Range{link.lower + least_range, most});
}

std::optional<Sentence> find_joint_error(const Link& link, int index) {
  if (static_cast<unsigned>(link.joint) > static_cast<unsigned>(JointType::kFollowing)) {
    return Sentence("joint type ") + static_cast<unsigned>(link.joint) + " must be 0 to 6";
  }
  if (index == 0 && link.parent != -1) return "the root's parent must be the world (-1)";
  if (index > 0 && (link.parent < 0 || link.parent >= index)) {
    return Sentence("parent ") + link.parent + " must be 0 to " + (index - 1);
  }
  if (index > 0 && link.joint == JointType::kFree) return "only the root may have a free joint";
  if (!is_finite(link.X_PJ)) return "joint frame must be finite";
  if (auto error = find_error("joint frame", link.X_PJ.p, kLargestLength, "m")) return error;
  if (!is_unit(link.X_PJ.R.norm())) return "joint frame's quaternion must have length 1";
  if (!link.axis.allFinite()) return "axis must be finite";
  return has_one_coordinate(link.joint) ? find_coordinate_error(link) : std::nullopt;
}

/// Why a curve cannot be used.
std::optional<Sentence> find_curve_error(const ToolDescription& tool, const JointCurve& curve) {
  const std::size_t count = tool.links.size();
  if (curve.link >= count || !has_curve(tool.links[curve.link].joint)) {
    return Sentence("link ") + unsigned{curve.link} +
           " of a curve must be one that is guided or "
           "follows";
  }
  const Sentence name = Sentence("curve of link ") + unsigned{curve.link} + ": ";
  const bool leads = tool.links[curve.link].joint == JointType::kGuided;
  if (leads && curve.leader != curve.link) return name + "a guided link must be its own leader";
  if (curve.leader > curve.link || tool.links[curve.leader].joint != JointType::kGuided) {
    return name + "leader " + unsigned{curve.leader} + " must be a guided link before it";
  }
  if (auto error = find_error("terms", curve.terms, kLargestLength, "m or 1")) return name + *error;
  if (auto error = find_brief_error("armature", curve.armature, Range{0, kLargestArmature}))
    return name + *error;
  const auto [least, largest, change] = lengths_of(curve);
  if (!(change <= kQuickestTurn)) {
    return name + "the change of its quaternion, " + brief_text(change) +
           " of its length, must be at most " + brief_text(kQuickestTurn);
  }
  if (!(least >= kShortestQuaternion && largest <= 1 / kShortestQuaternion)) {
    return name + "the length of its quaternion, " + brief_text(least) + " to " +
           brief_text(largest) + ", must be " + brief_text(kShortestQuaternion) + " to " +
           brief_text(1 / kShortestQuaternion);
  }
  return std::nullopt;
}

/// One for each link that has one.
std::optional<Sentence> find_curves_error(const ToolDescription& tool) {
  std::uint32_t found = 0;
  for (const JointCurve& curve : tool.curves) {
    if (auto error = find_curve_error(tool, curve)) return error;
    if ((found >> curve.link) & 1u) {
      return Sentence("link ") + unsigned{curve.link} + " must have one curve, not two";
    }
    found |= 1u << curve.link;
  }
  for (std::size_t i = 0; i < tool.links.size(); ++i) {
    if (has_curve(tool.links[i].joint) && ((found >> i) & 1u) == 0) {
      return Sentence("link ") + i + " must have a curve, as it is guided or follows";
    }
  }
  return std::nullopt;
}

/// A rigid body in the axes of a link: the link and what is fixed to it.
struct Composite {
  double mass = 0;
  Vector3 moment = Vector3::Zero();   ///< Mass times centre of mass, from the link's origin, kg·m.
  Matrix3 inertia = Matrix3::Zero();  ///< About the link's origin, kg·m².

  void add(const Link& link, const Pose& X) {
    const Vector3 p = X * link.p_LCom;
    const Matrix3 R = X.R.normalized().toRotationMatrix();
    mass += link.mass;
    moment += link.mass * p;
    inertia += R * link.I_LCom * R.transpose() + link.mass * about(p);
  }
  /// The inertia about the centre of mass.
  Matrix3 central() const {
    return mass > 0 ? Matrix3(inertia - mass * about(moment / mass)) : inertia;
  }
  /// Of 1 kg at p about the origin.
  static Matrix3 about(const Vector3& p) {
    return p.squaredNorm() * Matrix3::Identity() - p * p.transpose();
  }
};

/// The least inertia that the joint turns with the body: about the axis of a revolute joint; about
/// the centre of mass where the joint moves that, too.
double turned_inertia(const Link& link, const Composite& body) {
  switch (link.joint) {
    case JointType::kRevolute:
      return link.axis.dot(body.inertia * link.axis);
    case JointType::kPlanar:
      return body.central()(2, 2);
    case JointType::kFree:
      return Eigen::SelfAdjointEigenSolver<Matrix3>(body.central(), Eigen::EigenvaluesOnly)
          .eigenvalues()
          .minCoeff();
    case JointType::kFixed:
    case JointType::kPrismatic:
    case JointType::kGuided:
    case JointType::kFollowing:
      break;
  }
  return 0;
}

/// Whether what a guided link leads has mass, or a motor.
std::optional<Sentence> find_weightless_error(const ToolDescription& tool, int leader) {
  double mass = 0;
  for (const JointCurve& curve : tool.curves) {
    if (curve.leader == leader) mass += tool.links[curve.link].mass + curve.armature;
  }
  if (tool.links[static_cast<std::size_t>(leader)].joint != JointType::kGuided ||
      mass >= kSmallestMass) {
    return std::nullopt;
  }
  return Sentence("link ") + leader + ": what it leads must have a mass, or armature, of " +
         brief_text(kSmallestMass) + " at least, not " + brief_text(mass);
}

/// Whether D(q) can be inverted: every velocity coordinate must move some mass or inertia.
std::optional<Sentence> find_massless_error(const ToolDescription& tool) {
  const int count = static_cast<int>(tool.links.size());
  const auto link = [&](int i) -> const Link& { return tool.links[static_cast<std::size_t>(i)]; };
  for (int i = 0; i < count; ++i) {
    if (link(i).joint == JointType::kFixed) continue;
    if (has_curve(link(i).joint)) {
      if (const auto error = find_weightless_error(tool, i)) return error;
      continue;
    }
    Composite body;
    double mass = 0;
    double beyond = 0;  // What turns on joints of its own counts in whatever pose, kg·m².
    for (int j = i; j < count; ++j) {
      Pose X;  // Of link j in link i, as far as joints are fixed.
      bool fixed = true;
      int ancestor = j;
      for (; ancestor > i; ancestor = link(ancestor).parent) {
        X = link(ancestor).X_PJ * X;
        fixed = fixed && link(ancestor).joint == JointType::kFixed;
      }
      if (ancestor != i) continue;
      mass += link(j).mass;
      if (fixed) {
        body.add(link(j), X);
      } else {
        beyond += link(j).I_LCom.trace() + link(j).mass * link(j).p_LCom.squaredNorm();
      }
    }
    if (!(mass >= kSmallestMass)) {
      return Sentence("link ") + i + ": its joint moves too little: mass " + brief_text(mass) +
             " kg must be at least " + brief_text(kSmallestMass) + " kg";
    }
    const double inertia = turned_inertia(link(i), body) + beyond;
    if (link(i).joint != JointType::kPrismatic && !(inertia >= kSmallestInertia)) {
      return Sentence("link ") + i + ": its joint turns too little: inertia " +
             brief_text(inertia) + " kg·m² must be at least " + brief_text(kSmallestInertia) +
             " kg·m²";
    }
  }
  return std::nullopt;
}

/// The link nearest to the root that moves with this one.
int rigid_root(const ToolDescription& tool, int link) noexcept {
  const auto of = [&](int index) -> const Link& {
    return tool.links[static_cast<std::size_t>(index)];
  };
  while (of(link).joint == JointType::kFixed && of(link).parent >= 0) link = of(link).parent;
  return link;
}

}  // namespace

int joint_dof(JointType joint) noexcept {
  switch (joint) {
    case JointType::kFixed:
    case JointType::kFollowing:
      return 0;
    case JointType::kRevolute:
    case JointType::kPrismatic:
    case JointType::kGuided:
      return 1;
    case JointType::kPlanar:
      return 3;
    case JointType::kFree:
      return 6;
  }
  return 0;
}

int joint_configuration_size(JointType joint) noexcept {
  return joint == JointType::kFree ? 7 : joint_dof(joint);
}

int ToolDescription::dof() const noexcept {
  int sum = 0;
  for (const Link& link : links) sum += joint_dof(link.joint);
  return sum;
}

int ToolDescription::configuration_size() const noexcept {
  int sum = 0;
  for (const Link& link : links) sum += joint_configuration_size(link.joint);
  return sum;
}

std::optional<Sentence> find_error(const ToolDescription& tool) {
  if (tool.links.empty()) return "a tool must have at least one link";
  for (std::size_t i = 0; i < tool.links.size(); ++i) {
    const Link& link = tool.links[i];
    std::optional<Sentence> error = find_joint_error(link, static_cast<int>(i));
    if (!error) error = find_inertia_error(link);
    if (error) return Sentence("link ") + i + ": " + *error;
  }
  if (auto error = find_curves_error(tool)) return error;
  const int dof = tool.dof();
  if (dof < 1 || dof > kMaxDof) {
    return Sentence("degrees of freedom ") + dof + " must be 1 to " + kMaxDof;
  }
  if (tool.hand_link < 0 || tool.hand_link >= static_cast<int>(tool.links.size())) {
    return Sentence("hand link ") + tool.hand_link + " must be 0 to " + (tool.links.size() - 1);
  }
  if (!is_finite(tool.X_LH)) return "hand frame must be finite";
  if (auto error = find_error("hand frame", tool.X_LH.p, kLargestLength, "m")) return error;
  if (!is_unit(tool.X_LH.R.norm())) return "hand frame's quaternion must have length 1";
  if (auto error = find_error("gravity", tool.gravity_W, kLargestGravity, "m/s²")) return error;
  if (auto error = find_brief_error("length", tool.length,
                                    Range{kSmallestToolLength, kLargestLength, "m"})) {
    return error;
  }
  return find_massless_error(tool);
}

bool are_joined(const ToolDescription& tool, int first, int second) noexcept {
  const int a = rigid_root(tool, first);
  const int b = rigid_root(tool, second);
  const auto carries = [&](int carrier, int carried) {
    const int parent = tool.links[static_cast<std::size_t>(carried)].parent;
    return parent >= 0 && rigid_root(tool, parent) == carrier;
  };
  return a == b || carries(a, b) || carries(b, a);
}

}  // namespace hlm
