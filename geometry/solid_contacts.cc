#include "hlm/geometry/solid_contacts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "hlm/common/contact.h"
#include "hlm/geometry/probe.h"

namespace hlm::geometry {
namespace {

/// A point this near to a border is over the triangle, m: rounding.
constexpr double kOnBorder = 1e-7;
/// Slope, rad, up to which a neighbour does not rise. Larger: more corners of something round are
/// summits, and their contacts come and go. Smaller: rounding decides.
constexpr double kLevel = 1e-3;
/// The same of a plane of the solid on which a flat tool lies, leaning as it is pressed in. Larger:
/// what is beside the tool's lowest corner is felt deeper than that. Smaller: it rocks.
constexpr double kLeaning = 2e-2;
/// Slope, rad, of a flat side that an edge lies along.
constexpr double kAlmostLevel = 1e-2;
/// How far a face goes on behind a hollow edge, m: what is pressed into a corner is over no face.
constexpr double kBehind = 0.01;
/// Contacts of one corner of the tool with normals within this angle, rad, are one: the facets of
/// something hollow and round.
constexpr double kOneSurface = 0.15;
/// Contacts in one place, m, with normals within kSame, rad, are one.
constexpr double kOnePlace = 1e-6;
constexpr double kSame = 0.02;
/// Cosine of 30°: a contact keeps the side on which it was.
constexpr double kSameSide = 0.87;
/// How far what is pressed in may go within a tick, m.
constexpr double kGoesOn = 5e-3;
/// Contacts that are no farther from each other than so many times as deep as both are one
/// overlap's.
constexpr double kAbout = 10;
/// Overlaps that what is pressed into a hollow edge is from a face that goes on behind it.
constexpr double kAround = 1.5;
/// Angle to a face, rad, from which on a normal leans to where the face ends.
constexpr double kUpright = 0.03;
/// Edges shorter than this share of the tool are not searched for a normal that is farther than
/// kUnlikely, rad, from the normals of an edge, where it is well known: kAlmostOne.
constexpr double kShort = 0.2;
constexpr double kUnlikely = 0.2;
constexpr double kAlmostOne = 0.6;
/// Overlap besides that of the search before, m.
constexpr double kDeeper = 2e-3;
/// Work of a triangle, a vertex and an edge.
constexpr std::uint64_t kTriangleWork = 15;
constexpr std::uint64_t kEdgeWork = 20;

using Triangle = MeshSolid::Triangle;
using Bend = MeshSolid::Bend;

struct Candidate {
  SolidContact contact;
  bool was_there = false;  ///< At the search before.
};

class Search {
 public:
  Search(const Convex& tool, const Pose& X_ST, const MeshSolid& solid, double epsilon,
         const SolidMemory* before)
      : probe_(tool, X_ST),
        solid_(solid),
        epsilon_(epsilon),
        before_(before),
        depth_(before != nullptr ? before->depth : 0),
        reach_(before != nullptr ? depth_ + epsilon : std::numeric_limits<double>::infinity()),
        bounds_(tool.bounds(X_ST)) {
    middle_ = bounds_.center();
    extent_ = bounds_.diagonal().norm() / 2;
    bounds_.min().array() -= epsilon + depth_;
    bounds_.max().array() += epsilon + depth_;
  }

  SolidContacts run(SolidMemory& now, const OpenSurface* open);

 private:
  struct Lowest {
    double value = 0;  ///< m.
    double share = 0;  ///< Of the way along the segment.
    Vector3 out = Vector3::Zero();
    bool at_end = false;
  };

  bool find_side();
  bool enters(const MeshSolid::Node& node) const;
  void look_at(std::uint32_t index);
  void add_over(std::uint32_t index, const Triangle& t);
  bool is_over(const Triangle& t, const Vector3& p, double height) const;
  bool was_pressed(const Vector3& p) const;
  void add_vertex(std::uint32_t point);
  Vector3 normal_of(std::uint32_t point, const Vector3& n) const;
  void add_edge(std::uint32_t index, const Triangle& t, std::size_t i);
  bool add_along(const SolidContact& edge, const Triangle& t, std::size_t i);
  Lowest lowest_along(const Vector3& a, const Vector3& b, const Vector3& shift,
                      double beyond) const;
  void add_crossing(SolidContact edge, const Triangle& t, std::size_t i);
  void add_between_normals(SolidContact edge, const Triangle& t, std::size_t i);
  bool is_normal(const Triangle& t, std::size_t i, const Vector3& n, double slope) const;
  void find_lean(SolidContact& contact) const;
  void add_clear(const SolidContact& contact);
  void add(const Candidate& candidate);
  bool is_ended_by(const SolidContact& contact, const Vector3& way) const;
  void keep_open(const OpenSurface& open);
  void keep_shortest_ways();
  void merge();

  const Probe probe_;
  const MeshSolid& solid_;
  double epsilon_;
  const SolidMemory* before_;
  double depth_;  ///< At the search before, m.
  double reach_;
  Eigen::AlignedBox3d bounds_;  ///< Of the tool and all that is near.
  Vector3 middle_;
  double extent_ = 0;
  double side_ = 1;
  Vector3 known_n_ = Vector3::Zero();  ///< For which known_points_ are.
  Probe::Points known_points_;
  StaticVector<Candidate, 2 * kMaxSolidContacts> found_;
};

/// On which side of a sheet the tool is. False if it is far from it.
bool Search::find_side() {
  if (solid_.is_closed()) return true;
  if (before_ != nullptr && before_->side != 0 && !before_->pressed.empty()) {
    side_ = before_->side;
    return true;
  }
  const auto nearest = solid_.nearest(middle_, extent_ + epsilon_);
  if (!nearest) return false;
  side_ = solid_.pseudonormal(*nearest).dot(middle_ - nearest->p) < 0 ? -1 : 1;
  return true;
}

bool Search::enters(const MeshSolid::Node& node) const {
  if (Work::is_spent()) return false;
  const Vector3 low = node.centre - node.half;
  const Vector3 high = node.centre + node.half;
  if ((low.array() > bounds_.max().array()).any() || (high.array() < bounds_.min().array()).any()) {
    return false;
  }
  if (probe_.distance(node.centre).value - node.radius > epsilon_ + depth_) return false;
  if (!std::isfinite(reach_)) return true;
  const bool is_ball = probe_.margin() > 0;
  if (is_ball && reach_ >= probe_.margin()) return true;  // Its middle may be behind the surface.
  const double within = node.radius + (is_ball ? 0 : kAround * reach_);
  return probe_.may_touch(side_ * node.axis, node.angle + kLeaning, node.centre, within);
}

void Search::look_at(std::uint32_t index) {
  if (Work::is_spent()) return;
  Work::add(kTriangleWork);
  const Triangle& t = solid_.triangles()[index];
  add_over(index, t);
  for (std::size_t i = 0; i < 3; ++i) {
    if ((t.vertices >> i & 1) != 0) add_vertex(t.corner[i]);
    if ((t.edges >> i & 1) != 0) add_edge(index, t, i);
  }
}

bool Search::was_pressed(const Vector3& p) const {
  return before_ != nullptr && std::ranges::any_of(before_->pressed, [&](const auto& pressed) {
           return (pressed.p_S - p).norm() < kGoesOn;
         });
}

/// Whether a point is over a triangle, or under its plane where that goes on behind a hollow edge.
bool Search::is_over(const Triangle& t, const Vector3& p, double height) const {
  bool goes_on = false;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vector3& from = solid_.corner(t, i);
    const Vector3 edge = solid_.corner(t, (i + 1) % 3) - from;
    if (t.n.dot(edge.cross(p - from)) >= -kOnBorder * edge.norm()) continue;
    if (height >= 0 || t.across[i] < 0) return false;
    if (t.bend[i] != (side_ > 0 ? Bend::kConcave : Bend::kConvex)) return false;
    const Triangle& other = solid_.triangles()[static_cast<std::size_t>(t.across[i])];
    if (side_ * (other.n.dot(p) - other.offset) > 0) return false;
    goes_on = true;
  }
  if (!goes_on) return true;
  const Vector3 foot = p - height * side_ * t.n;
  const auto nearest = solid_.nearest(foot, kBehind);
  return nearest && side_ * solid_.pseudonormal(*nearest).dot(foot - nearest->p) <= 0;
}

/// The tool's lowest points over a triangle.
void Search::add_over(std::uint32_t index, const Triangle& t) {
  const Vector3 n = side_ * t.n;
  const double offset = side_ * t.offset;
  const double margin = probe_.margin();
  const double lowest = probe_.lowest(n) - offset;
  if (lowest - margin > epsilon_) return;
  const bool is_behind = !solid_.is_closed() && probe_.highest(n) - offset + margin < 0;
  if (is_behind && -lowest > depth_ + epsilon_ + margin) return;
  if (n != known_n_) {
    known_points_ = probe_.lowest_points(n);
    known_n_ = n;
  }
  for (const Probe::Point& point : known_points_) {
    const double height = n.dot(point.p) - offset;
    if (height - margin > epsilon_) continue;
    if (!is_over(t, point.p, height)) continue;
    const Vector3 foot = point.p - height * n;
    if (is_behind && !was_pressed(foot)) continue;
    const bool is_clear =
        height > 0 ? solid_.is_clear(foot, n, height) : solid_.is_clear(point.p, n, -height);
    if (!is_clear) continue;
    add({.contact = {.tool_feature = point.feature,
                     .solid_kind = FeatureKind::kFace,
                     .solid_feature = index,
                     .p_S = foot,
                     .n_S = n,
                     .separation = height - margin}});
  }
}

/// The normal of a contact with a vertex along which no neighbour is nearer: n, or that of a plane
/// on which a flat tool lies, and may lean. Zero if there is none.
Vector3 Search::normal_of(std::uint32_t point, const Vector3& n) const {
  static const double leaning = std::cos(kLeaning);
  const Vector3 normal = side_ * solid_.vertex_normal(point);
  const double least = solid_.is_on_rim(point) ? -0.5 * normal.norm() : 0;
  if (!(normal.dot(n) > least)) return Vector3::Zero();
  if (probe_.is_flat()) {
    const Triangle* plane = solid_.broad_at(point, n, side_, leaning);
    if (plane != nullptr && solid_.is_summit(point, n, kLeaning)) return side_ * plane->n;
  }
  return solid_.is_summit(point, n, kLevel) ? n : Vector3(Vector3::Zero());
}

/// A sharp vertex before the tool, or in it.
void Search::add_vertex(std::uint32_t point) {
  const Vector3& p = solid_.point(point);
  const Probe::Distance distance = probe_.distance(p);
  SolidContact contact{.tool_feature = {},
                       .solid_kind = FeatureKind::kVertex,
                       .solid_feature = point,
                       .p_S = p,
                       .n_S = -distance.out,
                       .separation = distance.value};
  const bool goes_through = distance.value > -kDeeper && was_pressed(p);
  if (distance.value > epsilon_ && !goes_through) return;
  if (distance.value <= epsilon_) {
    contact.n_S = normal_of(point, -distance.out);
    if (!contact.n_S.isZero(0)) return add_clear(contact);
  }
  if (distance.value > 0 && !goes_through) return;
  // The shortest way out on which it is a summit; of what is pressed through a thin tool, back.
  double highest = -std::numeric_limits<double>::infinity();
  probe_.for_each_side(p, [&](double height, const Vector3& out, std::size_t) {
    if (height > 0 || height < -reach_ || height <= highest) return;
    if (distance.value > 0 && -height > depth_ + epsilon_) return;
    const Vector3 n = normal_of(point, -out);
    if (n.isZero(0)) return;
    highest = height;
    contact.n_S = n;
    contact.separation = height;
  });
  if (std::isfinite(highest)) add_clear(contact);
}

/// Whether n is a normal of an edge, as seen from the tool's side.
bool Search::is_normal(const Triangle& t, std::size_t i, const Vector3& n, double slope) const {
  const Vector3 n_t = side_ * t.n;
  const Vector3 along = (solid_.corner(t, (i + 1) % 3) - solid_.corner(t, i)).normalized();
  if (t.across[i] < 0) {
    return n.dot(n_t) >= -slope && n.dot(along.cross(t.n)) >= -slope;
  }
  const Vector3 n_u = side_ * solid_.triangles()[static_cast<std::size_t>(t.across[i])].n;
  const double turn = along.dot(n_t.cross(n_u)) < 0 ? -1 : 1;
  return n.dot(n_t + n_u) > 0 && turn * along.dot(n_t.cross(n)) >= -slope &&
         turn * along.dot(n.cross(n_u)) >= -slope;
}

/// A sharp edge before the tool, or in it.
void Search::add_edge(std::uint32_t index, const Triangle& t, std::size_t i) {
  if (t.across[i] >= 0 && t.bend[i] != (side_ > 0 ? Bend::kConvex : Bend::kConcave)) return;
  Work::add(kEdgeWork);
  const Vector3& a = solid_.corner(t, i);
  const Vector3& b = solid_.corner(t, (i + 1) % 3);
  const double length = (b - a).norm();
  const Vector3 along = (b - a) / length;
  const Probe::Distance at_a = probe_.distance(a);
  const Probe::Distance at_b = probe_.distance(b);
  // The distance is convex along the edge: its tangents bound it.
  const double from_a = at_a.out.dot(along);
  const double from_b = at_b.out.dot(along);
  double least = std::min(at_a.value, at_b.value);
  if (from_a < 0 && from_b > 0) {
    const double x = (at_b.value - from_b * length - at_a.value) / (from_a - from_b);
    least = at_a.value + from_a * std::clamp(x, 0.0, length);
  }
  if (least > epsilon_) return;
  if (length < kShort * extent_ && from_a < 0 && from_b > 0) {
    // Seldom more than two sides of the tool are nearest to a short edge.
    const double share = from_b / (from_b - from_a);
    const Vector3 out = share * at_a.out + (1 - share) * at_b.out;
    const double size = out.norm();
    if (size > kAlmostOne && !is_normal(t, i, -out / size, kUnlikely)) return;
  }
  const SolidContact edge{.tool_feature = {},
                          .solid_kind = FeatureKind::kEdge,
                          .solid_feature = 3 * index + static_cast<std::uint32_t>(i),
                          .p_S = a,
                          .n_S = Vector3::UnitZ(),
                          .separation = 0};
  if (add_along(edge, t, i) && probe_.is_simple()) return;
  if (from_a < 0 && from_b > 0) add_crossing(edge, t, i);  // Else one of its ends is nearest.
}

/// Where an edge that lies along a side of the tool leaves it. Returns whether it does so.
bool Search::add_along(const SolidContact& edge, const Triangle& t, std::size_t i) {
  const Vector3& a = solid_.corner(t, i);
  const Vector3& b = solid_.corner(t, (i + 1) % 3);
  const Vector3 along = (b - a).normalized();
  const Vector3 middle = (a + b) / 2;
  const auto plane_of = [&](const Vector3& n) -> const Triangle* {
    static const double leaning = std::cos(kLeaning);
    const auto is_plane = [&](const Triangle& u) {
      return u.broad && side_ * u.n.dot(n) > leaning;
    };
    if (is_plane(t)) return &t;
    if (t.across[i] < 0) return nullptr;
    const Triangle& other = solid_.triangles()[static_cast<std::size_t>(t.across[i])];
    return is_plane(other) ? &other : nullptr;
  };
  bool lies = false;
  probe_.for_each_side(middle, [&](double height, const Vector3& out, std::size_t side) {
    const double slope = std::abs(out.dot(along));
    if (slope > kLeaning) return;
    if (side == Probe::kRound && !probe_.is_along(along)) return;
    // Two planes on each other may lean; a plane on a mere edge may not.
    const Triangle* plane = probe_.is_flat() ? plane_of(-out) : nullptr;
    const double least = plane != nullptr ? kLeaning : kAlmostLevel;
    if (slope > least || !is_normal(t, i, -out, least)) return;
    const auto range = probe_.over(side, a, b);
    if (!range) return;
    const Vector3 there = a + (range->from + range->to) / 2 * (b - a);
    if (probe_.distance(there).out.dot(out) < kSameSide) return;
    lies = true;
    for (const double share : {range->from, range->to}) {
      if (share <= 0 || share >= 1) continue;
      SolidContact contact = edge;
      contact.p_S = a + share * (b - a);
      contact.n_S = plane != nullptr ? Vector3(side_ * plane->n) : Vector3(-out);
      contact.separation = side == Probe::kRound ? probe_.distance(contact.p_S).value
                                                 : height + out.dot(contact.p_S - middle);
      if (contact.separation <= epsilon_) add_clear(contact);
    }
  });
  return lies;
}

/// Where the segment from a to b, moved by `shift`, is nearest to the tool or deepest in it.
Search::Lowest Search::lowest_along(const Vector3& a, const Vector3& b, const Vector3& shift,
                                    double beyond) const {
  constexpr int kMostSteps = 40;
  constexpr double kSmooth = 1e-7;  // Slope.
  constexpr double kNear = 1e-9;    // m
  struct End {
    double x;
    double value;
    double slope;
    Vector3 out;
  };
  const double length = (b - a).norm();
  const Vector3 along = (b - a) / length;
  const auto end_at = [&](double x) {
    const Probe::Distance here = probe_.distance(a + x * along + shift);
    return End{x, here.value, here.out.dot(along), here.out};
  };
  End left = end_at(0);
  if (left.slope >= 0) return {.value = left.value, .out = left.out, .at_end = true};
  End right = end_at(length);
  if (right.slope <= 0) return {.value = right.value, .share = 1, .out = right.out, .at_end = true};
  // The distance is convex: its tangents bound it, and where they meet it is looked at next.
  double x = 0;
  double least = 0;
  const auto meet = [&] {
    x = (right.value - right.slope * right.x - left.value + left.slope * left.x) /
        (left.slope - right.slope);
    x = std::clamp(x, left.x, right.x);
    least = left.value + left.slope * (x - left.x);
  };
  meet();
  for (int step = 0; step < kMostSteps && least <= beyond; ++step) {
    if (right.x - left.x < kNear || std::min(left.value, right.value) - least < kNear) break;
    // Not always there: near one end it would creep.
    const double border = 0.02 * (right.x - left.x);
    const End here = end_at(step % 4 == 3 ? (left.x + right.x) / 2
                                          : std::clamp(x, left.x + border, right.x - border));
    (here.slope < 0 ? left : right) = here;
    if (std::abs(here.slope) < kSmooth) break;
    meet();
  }
  meet();
  const double share = right.slope / (right.slope - left.slope);
  return {.value = least,
          .share = x / length,
          .out = share * left.out + (1 - share) * right.out,
          .at_end = false};
}

/// Where an edge is nearest to the tool, or deepest in it, between its ends.
void Search::add_crossing(SolidContact edge, const Triangle& t, std::size_t i) {
  constexpr double kOpposite = 0.2;
  const Vector3& a = solid_.corner(t, i);
  const Vector3& b = solid_.corner(t, (i + 1) % 3);
  if (!probe_.is_simple()) return add_between_normals(edge, t, i);
  const Lowest lowest = lowest_along(a, b, Vector3::Zero(), epsilon_);
  const double size = lowest.out.norm();
  if (lowest.at_end || lowest.value > epsilon_ || !(size > kOpposite)) return;
  edge.p_S = a + lowest.share * (b - a);
  edge.n_S = -lowest.out / size;
  edge.separation = lowest.value / size;
  if (edge.separation > epsilon_) return;
  if (!is_normal(t, i, edge.n_S, kLevel)) {
    // The nearest way out of the tool is not one out of the solid: another edge of it may have one.
    if (probe_.is_flat() && lowest.value < 0) add_between_normals(edge, t, i);
    return;
  }
  add_clear(edge);
}

/// The same by the tool's silhouette along the edge: of the normals between those of the
/// triangles the one along which the two are farthest apart.
void Search::add_between_normals(SolidContact edge, const Triangle& t, std::size_t i) {
  constexpr int kSteps = 34;      // Each leaves 62 % of the angle.
  constexpr double kEnd = 1e-6;   // Share of the angle.
  constexpr double kThin = 1e-9;  // m
  constexpr double kGolden = 0.6180339887498949;
  const Vector3& a = solid_.corner(t, i);
  const Vector3 along = (solid_.corner(t, (i + 1) % 3) - a).normalized();
  const double length = (solid_.corner(t, (i + 1) % 3) - a).norm();
  const Vector3 first = side_ * t.n;
  const Vector3 last =
      t.across[i] < 0
          ? Vector3(along.cross(t.n))
          : Vector3(side_ * solid_.triangles()[static_cast<std::size_t>(t.across[i])].n);
  const double angle = std::acos(std::clamp(first.dot(last), -1.0, 1.0));
  const Vector3 turned = (last - last.dot(first) * first).normalized();
  const auto normal_at = [&](double share) -> Vector3 {
    return std::cos(share * angle) * first + std::sin(share * angle) * turned;
  };
  const auto gap_at = [&](double share) {
    const Vector3 n = normal_at(share);
    return probe_.lowest(n) - n.dot(a);
  };
  double low = 0;
  double high = 1;
  double x = high - kGolden * (high - low);
  double y = low + kGolden * (high - low);
  double at_x = gap_at(x);
  double at_y = gap_at(y);
  for (int step = 0; step < kSteps && !Work::is_spent(); ++step) {
    if (at_x > at_y) {
      high = y;
      y = x;
      at_y = at_x;
      x = high - kGolden * (high - low);
      at_x = gap_at(x);
    } else {
      low = x;
      x = y;
      at_x = at_y;
      y = low + kGolden * (high - low);
      at_y = gap_at(y);
    }
  }
  const double share = (low + high) / 2;
  if (share < kEnd || share > 1 - kEnd) return;  // A face or a corner is nearer.
  edge.n_S = normal_at(share);
  edge.separation = probe_.lowest(edge.n_S) - edge.n_S.dot(a);
  if (edge.separation > epsilon_) return;
  // The edge of the hull is between its outermost corners on either side of that normal.
  const Vector3 one = probe_.outermost(normal_at(low - kEnd));
  const Vector3 other = probe_.outermost(normal_at(high + kEnd));
  const Vector3 beside = edge.n_S.cross(along);
  const double width = beside.dot(other - one);
  const double part = std::abs(width) > kThin ? beside.dot(a - one) / width : 0;
  if (part < 0 || part > 1) return;
  const double at = along.dot(one + part * (other - one) - a);
  if (at <= 0 || at >= length) return;
  edge.p_S = a + at * along;
  add_clear(edge);
}

/// Finds to where the normal of a contact with a vertex or an edge leans from a face there, or of
/// one that does not what other faces are there.
void Search::find_lean(SolidContact& contact) const {
  static const double upright = std::cos(kUpright);
  const auto& triangles = solid_.triangles();
  double nearest = -2;
  Vector3 others = Vector3::Zero();
  const auto consider = [&](const Triangle& t) {
    const double cosine = side_ * t.n.dot(contact.n_S);
    if (cosine < upright) others += side_ * t.n;
    if (cosine <= nearest) return;
    nearest = cosine;
    contact.face_S = side_ * t.n;
  };
  if (contact.solid_kind == FeatureKind::kVertex) {
    solid_.for_each_at(contact.solid_feature, consider);
  } else {
    const Triangle& t = triangles[contact.solid_feature / 3];
    const std::int32_t across = t.across[contact.solid_feature % 3];
    consider(t);
    if (across >= 0) consider(triangles[static_cast<std::size_t>(across)]);
  }
  if (nearest < upright) {
    contact.beyond_S = (contact.n_S - nearest * contact.face_S).normalized();
  } else {
    contact.face_S = others.isZero(0) ? others : Vector3(others.normalized());
  }
}

/// Adds a contact of a vertex or an edge if nothing else of the solid is before it.
void Search::add_clear(const SolidContact& contact) {
  const double to_core = contact.separation + probe_.margin();
  if (to_core > 0 && !solid_.is_clear(contact.p_S, contact.n_S, to_core)) return;
  Candidate candidate{.contact = contact};
  candidate.contact.tool_feature = probe_.feature_at(contact.p_S + to_core * contact.n_S);
  find_lean(candidate.contact);
  add(candidate);
}

void Search::add(const Candidate& candidate) {
  if (found_.size() < found_.capacity()) {
    found_.push_back(candidate);
    return;
  }
  const auto shallowest = std::ranges::max_element(
      found_, {}, [](const Candidate& other) { return other.contact.separation; });
  if (candidate.contact.separation < shallowest->contact.separation) *shallowest = candidate;
}

/// Whether a contact does not overlap any more once the tool has moved by `way`.
bool Search::is_ended_by(const SolidContact& contact, const Vector3& way) const {
  constexpr double kEnded = 1e-6;  // m
  switch (contact.solid_kind) {
    case FeatureKind::kVertex:
      return probe_.distance(contact.p_S - way).value > -kEnded;
    case FeatureKind::kEdge: {
      const Triangle& t = solid_.triangles()[contact.solid_feature / 3];
      const std::size_t i = contact.solid_feature % 3;
      const Lowest lowest =
          lowest_along(solid_.corner(t, i), solid_.corner(t, (i + 1) % 3), -way, 0);
      return lowest.value > -kEnded;
    }
    case FeatureKind::kFace:
      break;
  }
  const double margin = probe_.margin();
  const Vector3 p = contact.p_S + (contact.separation + margin) * contact.n_S + way;
  const auto nearest = solid_.nearest(p, margin + way.norm() - contact.separation);
  if (!nearest) return true;
  const bool is_outside = side_ * solid_.pseudonormal(*nearest).dot(p - nearest->p) >= 0;
  return (is_outside ? nearest->distance : -nearest->distance) > margin - kEnded;
}

/// Leaves what is on the surface of all. Before ways are compared: one that leads into another
/// piece would end the others.
void Search::keep_open(const OpenSurface& open) {
  const auto is_covered = [&](const Candidate& candidate) {
    return Work::is_spent() || !open.has(candidate.contact);
  };
  found_.erase(std::remove_if(found_.begin(), found_.end(), is_covered), found_.end());
}

/// What overlaps has several ways out, of each of its features. Where the way out of one ends the
/// overlap of another, whose own way is longer, that is left out; what was there at the search
/// before comes first.
void Search::keep_shortest_ways() {
  static const double one_surface = std::cos(kOneSurface);
  const auto was_there = [&](const SolidContact& contact) {
    return before_ != nullptr && std::ranges::any_of(before_->pressed, [&](const auto& pressed) {
             return pressed.n_S.dot(contact.n_S) > kSameSide &&
                    (pressed.p_S - contact.p_S).norm() < kGoesOn;
           });
  };
  for (Candidate& candidate : found_) candidate.was_there = was_there(candidate.contact);
  std::ranges::sort(found_, {}, [](const Candidate& candidate) {
    const SolidContact& contact = candidate.contact;
    const bool is_open = contact.separation >= 0;
    return std::tuple(is_open, !candidate.was_there, -contact.separation, contact.solid_kind,
                      contact.solid_feature);
  });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < found_.size(); ++i) {
    const SolidContact& contact = found_[i].contact;
    bool is_ended = false;
    Vector3 way = Vector3::Zero();  // On which all shorter ones end.
    for (std::size_t k = 0; k < kept && contact.separation < 0; ++k) {
      const SolidContact& shorter = found_[k].contact;
      const double near = -kAbout * (shorter.separation + contact.separation);
      if (shorter.n_S.dot(contact.n_S) > one_surface) {
        // Straight on, where the solid ends again.
        is_ended = is_ended || (shorter.tool_feature == contact.tool_feature &&
                                contact.separation < kAbout * shorter.separation - kDeeper);
        continue;
      }
      if ((shorter.p_S - contact.p_S).norm() > near) continue;
      way += std::max(0.0, -shorter.separation - way.dot(shorter.n_S)) * shorter.n_S;
    }
    is_ended = is_ended || (!way.isZero(0) && !Work::is_spent() && is_ended_by(contact, way));
    if (!is_ended) found_[kept++] = found_[i];
  }
  found_.resize(kept);
}

/// Leaves the deepest of contacts that are one.
void Search::merge() {
  static const double one_surface = std::cos(kOneSurface);
  static const double same = std::cos(kSame);
  std::ranges::sort(found_, {}, [](const Candidate& candidate) {
    const SolidContact& contact = candidate.contact;
    return std::tuple(contact.separation, contact.solid_kind, contact.solid_feature);
  });
  const auto are_one = [&](const SolidContact& x, const SolidContact& y) {
    const double cosine = x.n_S.dot(y.n_S);
    if (x.tool_feature.kind == FeatureKind::kVertex && x.tool_feature == y.tool_feature) {
      return cosine > one_surface;
    }
    return cosine > same && (x.p_S - y.p_S).norm() < kOnePlace;
  };
  std::size_t kept = 0;
  for (std::size_t i = 0; i < found_.size(); ++i) {
    const auto end = found_.begin() + static_cast<std::ptrdiff_t>(kept);
    const bool is_known = std::any_of(found_.begin(), end, [&](const Candidate& other) {
      return are_one(other.contact, found_[i].contact);
    });
    if (!is_known) found_[kept++] = found_[i];
  }
  found_.resize(std::min(kept, kMaxSolidContacts));
}

SolidContacts Search::run(SolidMemory& now, const OpenSurface* open) {
  now = {};
  SolidContacts contacts;
  if (!find_side()) return contacts;
  solid_.visit([&](const MeshSolid::Node& node) { return enters(node); },
               [&](std::uint32_t index) { look_at(index); });
  if (open != nullptr) keep_open(*open);
  keep_shortest_ways();
  merge();
  now.side = side_;
  for (const Candidate& candidate : found_) {
    const SolidContact& contact = candidate.contact;
    contacts.push_back(contact);
    now.depth = std::max(now.depth, -contact.separation);
    if (contact.separation < 0 && now.pressed.size() < now.pressed.capacity()) {
      now.pressed.push_back({contact.tool_feature, contact.p_S, contact.n_S});
    }
  }
  return contacts;
}

}  // namespace

SolidContacts find_solid_contacts(const Convex& tool, const Pose& X_ST, const MeshSolid& solid,
                                  double epsilon, const SolidMemory* before, SolidMemory& now,
                                  const OpenSurface* open) noexcept {
  return Search(tool, X_ST, solid, epsilon, before).run(now, open);
}

}  // namespace hlm::geometry
