#include "hlm/geometry/manifold.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "hlm/geometry/clip.h"
#include "hlm/geometry/penetration.h"
#include "hlm/geometry/separation.h"
#include "hlm/geometry/tolerances.h"

namespace hlm::geometry {
namespace {

static_assert(kMaxOpposites + 1 <= kMaxManifoldPoints);

/// A feature pair of the cores and a point of each on one line along the normal, in B.
struct FeaturePair {
  Feature tool_feature;
  Feature body_feature;
  Vector3 p_tool;
  Vector3 p_body;
  std::uint32_t face = 0;  ///< ManifoldPoint::face.
};
using FeaturePairs = StaticVector<FeaturePair, kMaxManifoldPoints>;

Patch in_body_frame(Patch patch, const CorePair& pair) {
  for (auto& corner : patch.corners) corner.p = pair.p_BT + pair.R_BT * corner.p;
  patch.normal = pair.R_BT * patch.normal;
  return patch;
}

/// Numbers the faces of both shapes; 0 unless two edges meet.
std::uint32_t crossed_face(const Opposite& o, const Patch& reference, bool of_body) {
  if (o.first.kind != FeatureKind::kEdge || o.second.kind != FeatureKind::kEdge) return 0;
  return 2 * std::uint32_t{reference.feature.index} + (of_body ? 1 : 2);
}

bool is_aligned_face(const Patch& patch, const Vector3& direction) {
  static const double cosine = std::cos(kOneAxis);
  return patch.is_face() && patch.normal.dot(direction) >= cosine;
}

/// Those of the edges that face each other along n, if they are parallel.
FeaturePairs facing_edges(const CorePair& pair, const Vector3& n) {
  if (pair.tool.is_point() || pair.body.is_point()) return {};
  const Patch tool = in_body_frame(pair.tool.edge_facing(-(pair.R_BT.transpose() * n)), pair);
  FeaturePairs pairs;
  for (const Opposite& o : overlap_of_edges(tool, pair.body.edge_facing(n))) {
    pairs.push_back({o.first, o.second, o.p_first, o.p_second});
  }
  return pairs;
}

/// The features that meet along n: those of a face of either shape if n is normal to it, else those
/// of parallel edges, else none. The body's face is preferred as the reference: the set is the same
/// otherwise except corners on a common border.
FeaturePairs facing_features(const CorePair& pair, const Vector3& n) {
  if (!pair.tool.has_faces() && !pair.body.has_faces()) return facing_edges(pair, n);
  const Vector3 n_T = pair.R_BT.transpose() * n;
  const Patch tool = in_body_frame(pair.tool.facing(-n_T), pair);
  const Patch body = pair.body.facing(n);
  FeaturePairs pairs;
  if (is_aligned_face(body, n)) {
    for (const Opposite& o : overlap(tool, body, n)) {
      pairs.push_back({o.first, o.second, o.p_first, o.p_second, crossed_face(o, body, true)});
    }
  } else if (is_aligned_face(tool, -n)) {
    for (const Opposite& o : overlap(body, tool, n)) {
      pairs.push_back({o.second, o.first, o.p_second, o.p_first, crossed_face(o, tool, false)});
    }
  } else {
    pairs = facing_edges(pair, n);
  }
  return pairs;
}

FeaturePair witness_features(const CorePair& pair, const CoreSeparation& separation) {
  const Witness witness = find_witness(pair, separation);
  const Vector3 p_T = pair.R_BT.transpose() * (witness.p_tool - pair.p_BT);
  return {pair.tool.feature_at(p_T), pair.body.feature_at(witness.p_body), witness.p_tool,
          witness.p_body};
}

double gap_of(const FeaturePair& p, const Vector3& n) { return n.dot(p.p_tool - p.p_body); }

bool stands_for(const FeaturePairs& pairs, const Vector3& n, double gap) {
  return std::any_of(pairs.begin(), pairs.end(), [&](const FeaturePair& p) {
    return gap_of(p, n) <= gap + narrow::kRepresents;
  });
}

/// Adds a pair instead of one of the same features.
void put(FeaturePairs& pairs, const FeaturePair& added) {
  erase_if(pairs, [&](const FeaturePair& p) {
    return p.tool_feature == added.tool_feature && p.body_feature == added.body_feature;
  });
  if (pairs.size() < pairs.capacity()) pairs.push_back(added);
}

void erase_far(FeaturePairs& pairs, const Vector3& n, double largest_gap) {
  erase_if(pairs, [&](const FeaturePair& p) { return !(gap_of(p, n) <= largest_gap); });
}

/// Whether the cap of a cylinder leans, so that its rim rolls: its corners pass by the lowest point
/// and do not stand for that.
bool rolls(const CorePair& pair, const Vector3& n) {
  const auto leans = [](const Convex& core, double cosine) {
    return core.is_cylinder() && cosine * cosine > 0.5 &&
           1 - cosine * cosine > narrow::kLeans * narrow::kLeans;
  };
  return leans(pair.tool, n.dot(pair.R_BT.col(2))) || leans(pair.body, n.z());
}

/// All feature pairs with a gap of at most `largest_gap` between the cores, m. One of them has the
/// gap of the separation.
FeaturePairs near_features(const CorePair& pair, const CoreSeparation& separation,
                           double largest_gap) {
  const Vector3& n = separation.n_B;
  FeaturePairs pairs = facing_features(pair, n);
  erase_far(pairs, n, largest_gap);
  if (rolls(pair, n) || !stands_for(pairs, n, separation.gap)) {
    put(pairs, witness_features(pair, separation));
  }
  return pairs;
}

/// A unit normal and the gap that the cores have along it, m.
struct Axis {
  Vector3 n_B;
  double gap;
};
/// Most axes of faces and edges. Of 30 of two boxes some ten are near, with a large ε.
constexpr std::size_t kMaxAxes = 31;
using Axes = StaticVector<Axis, kMaxAxes + 1>;  // The best one may be another.
/// Most normals of faces and edges that are near at a time; of more the half with the largest gaps
/// stays.
constexpr std::size_t kMaxCandidates = 512;

/// The axes of faces and edges with a gap beyond `least`, m, the largest gap first. A face is
/// looked at more closely if a point of the other core is far enough over it: of `n_B`'s supports,
/// which are near the faces that matter. Of the faces of a hull, which may be round, those stay
/// that are kOneAxis from all with a larger gap.
Axes polytope_axes(const CorePair& pair, const Vector3& n_B, double least) {
  enum class Source : std::uint8_t { kToolHull, kBodyHull, kOther };
  struct Candidate {
    Axis axis;
    Source source;
    std::uint32_t number;  ///< In the order of their finding, which decides between equal gaps.
  };
  StaticVector<Candidate, kMaxCandidates> near;
  const auto sort = [&near] {
    std::ranges::sort(near, [](const Candidate& a, const Candidate& b) {
      return a.axis.gap > b.axis.gap || (a.axis.gap == b.axis.gap && a.number < b.number);
    });
  };
  std::uint32_t number = 0;
  const auto consider = [&](const Vector3& n, Source source) {
    const double gap = pair.gap(n);
    if (!(gap > least)) return;
    if (near.size() == near.capacity()) {
      sort();
      near.resize(near.capacity() / 2);
    }
    near.push_back({{n, gap}, source, number++});
  };
  const Vector3 tool_point = pair.tool_support(-n_B);
  const Vector3 body_point_T = pair.R_BT.transpose() * (pair.body_support(n_B) - pair.p_BT);
  for (std::size_t i = 0; i < pair.body.face_normals().size(); ++i) {
    if (!(pair.body.height_over_face(i, tool_point) > least)) continue;
    consider(pair.body.face_normals()[i], pair.body.is_hull() ? Source::kBodyHull : Source::kOther);
  }
  for (std::size_t i = 0; i < pair.tool.face_normals().size(); ++i) {
    if (!(pair.tool.height_over_face(i, body_point_T) > least)) continue;
    consider(-(pair.R_BT * pair.tool.face_normals()[i]),
             pair.tool.is_hull() ? Source::kToolHull : Source::kOther);
  }
  for_each_edge_axis(pair, [&](const Vector3& n) { consider(n, Source::kOther); });
  sort();

  static const double cosine = std::cos(kOneAxis);
  StaticVector<Candidate, kMaxAxes> kept;
  for (const Candidate& candidate : near) {
    const bool stood_for = std::any_of(kept.begin(), kept.end(), [&](const Candidate& other) {
      return candidate.source != Source::kOther && other.source == candidate.source &&
             candidate.axis.n_B.dot(other.axis.n_B) > cosine;
    });
    if (!stood_for && kept.size() < kept.capacity()) kept.push_back(candidate);
  }
  Axes axes;
  for (const Candidate& candidate : kept) axes.push_back(candidate.axis);
  return axes;
}

/// The outermost point of one core over an aligned face of the other along an axis, if none of the
/// pairs has it: the face of a hull whose normal is nearest to the axis need not have the point
/// that is outermost of all, nor have the corners that stand for a rim.
void add_support(const CorePair& pair, const Axis& axis, bool over_body, FeaturePairs& pairs) {
  const Vector3& n = axis.n_B;
  if (stands_for(pairs, n, axis.gap)) return;
  if (over_body) {
    const Vector3 p = pair.tool_support(-n);
    const Vector3 p_T = pair.R_BT.transpose() * (p - pair.p_BT);
    put(pairs, {pair.tool.feature_at(p_T), pair.body.facing(n).feature, p, p - axis.gap * n});
  } else {
    const Vector3 p = pair.body_support(n);
    const Feature face = pair.tool.facing(-(pair.R_BT.transpose() * n)).feature;
    put(pairs, {face, pair.body.feature_at(p), p + axis.gap * n, p});
  }
}

/// The outermost points of either core along an axis that is normal to a face of the other, or
/// where the edges cross that the axis is normal to.
void add_outermost(const CorePair& pair, const Axis& axis, FeaturePairs& pairs) {
  const Vector3& n = axis.n_B;
  const Vector3 n_T = pair.R_BT.transpose() * n;
  const Patch tool = in_body_frame(pair.tool.facing(-n_T), pair);
  const Patch body = pair.body.facing(n);
  if (is_aligned_face(body, n)) {
    const double top = n.dot(pair.body_support(n));
    for (const auto& corner : tool.corners) {
      put(pairs, {corner.vertex, body.feature, corner.p, corner.p + (top - n.dot(corner.p)) * n});
    }
    add_support(pair, axis, true, pairs);
  } else if (is_aligned_face(tool, -n)) {
    const double bottom = n.dot(pair.tool_support(-n));
    for (const auto& corner : body.corners) {
      put(pairs,
          {tool.feature, corner.vertex, corner.p + (bottom - n.dot(corner.p)) * n, corner.p});
    }
    add_support(pair, axis, false, pairs);
  } else {
    const Patch e = in_body_frame(pair.tool.edge_facing(-n_T), pair);
    const Patch f = pair.body.edge_facing(n);
    Vector3 p = e.corners[0].p;
    if (e.corners.size() == 2 && f.corners.size() == 2) {
      const Vector3 along = e.corners[1].p - p;
      const Vector3 across = n.cross(f.corners[1].p - f.corners[0].p);
      const double share = across.dot(f.corners[0].p - p) / across.dot(along);
      if (std::isfinite(share)) p += std::clamp(share, 0.0, 1.0) * along;
    }
    put(pairs, {e.feature, f.feature, p, p - axis.gap * n});
  }
}

/// Those of the tool's face over a face of the body, or beyond its border.
FeaturePairs outermost_tool_points(const CorePair& pair, const Axis& axis) {
  FeaturePairs pairs;
  add_outermost(pair, axis, pairs);
  return pairs;
}

/// Whether the features meet on an axis that is there already.
bool is_taken(const AxesManifold& manifold, const FeaturePair& p) {
  return std::any_of(manifold.begin(), manifold.end(), [&](const ManifoldPoint& point) {
    return point.tool_feature == p.tool_feature && point.body_feature == p.body_feature &&
           point.face == p.face;
  });
}

/// Whether the axis is normal to a face of the body, and none of `kept` is the same.
bool is_new_face(const Axis& axis, const Convex& body, const Axes& kept) {
  const bool is_face = (body.facing(axis.n_B).normal - axis.n_B).norm() < narrow::kDirection;
  return is_face && std::none_of(kept.begin(), kept.end(), [&](const Axis& other) {
           return (other.n_B - axis.n_B).norm() < narrow::kSameAxis;
         });
}

FeaturePairs axis_features(const CorePair& pair, const Axis& axis, double largest_gap) {
  const Vector3& n = axis.n_B;
  FeaturePairs pairs = facing_features(pair, n);
  const bool flat =
      is_aligned_face(pair.body.facing(n), n) &&
      is_aligned_face(pair.tool.facing(-(pair.R_BT.transpose() * n)), -(pair.R_BT.transpose() * n));
  // Where two faces lie over each other, the border of one stands for its own axis; not a rim,
  // whose axis turns with every motion.
  if (!flat || pairs.empty()) {
    if (!stands_for(pairs, n, axis.gap)) add_outermost(pair, axis, pairs);
  } else if (!pair.tool.is_polytope() || !pair.body.is_polytope()) {
    add_support(pair, axis, true, pairs);
  }
  double least = std::numeric_limits<double>::infinity();
  for (const FeaturePair& p : pairs) least = std::min(least, gap_of(p, n));
  erase_far(pairs, n, std::max(largest_gap, least));
  return pairs;
}

/// Whether the normals of faces and edges alone decide if the shapes overlap. Those of a hull's
/// edges are not listed.
bool sharp(const CorePair& pair) {
  return pair.tool.is_polytope() && pair.body.is_polytope() && pair.tool.margin() == 0 &&
         pair.body.margin() == 0;
}

/// Whether no list of normals decides if the shapes overlap.
bool turns(const CorePair& pair) {
  return !sharp(pair) || pair.tool.is_hull() || pair.body.is_hull();
}

/// The signed distance if it is within epsilon and confirmed.
std::optional<CoreSeparation> near_separation(const CorePair& pair, double epsilon,
                                              ProximityStatistics& statistics,
                                              const std::optional<Vector3>& before_B,
                                              KnownSeparation* known = nullptr) {
  assert(!pair.tool.is_half_space());
  ++statistics.queries;
  const double margins = pair.tool.margin() + pair.body.margin();
  KnownSeparation fresh;
  if (known == nullptr) known = &fresh;
  if (!known->is_known) {
    known->separation = find_separation(pair, epsilon + margins, known->apart_B);
    known->is_known = true;
  }
  auto separation = known->separation;
  if (!separation) return {};
  const bool overlaps = separation->gap - margins < 0;
  if (before_B && overlaps && !pair.body.is_half_space() &&
      separation->n_B.dot(*before_B) < narrow::kSameSide) {
    separation = find_penetration_near(pair, *before_B);
  }
  if (!separation->is_confirmed()) {
    ++statistics.failures;
    return {};
  }
  if (separation->gap - margins > epsilon) return {};
  return separation;
}

ManifoldPoint manifold_point(const CorePair& pair, const Pose& X_WB, const FeaturePair& p,
                             const Vector3& n) {
  return {.tool_feature = p.tool_feature,
          .body_feature = p.body_feature,
          .p_WC = X_WB * (p.p_body + pair.body.margin() * n),
          .n_W = X_WB.R * n,
          .separation = gap_of(p, n) - pair.tool.margin() - pair.body.margin()};
}

}  // namespace

Manifold find_contacts(const Convex& tool, const Pose& X_WT, const Convex& body, const Pose& X_WB,
                       double epsilon, ProximityStatistics& statistics,
                       const std::optional<Vector3>& before_B, bool may_allocate,
                       KnownSeparation* known) {
  CorePair pair(tool, X_WT, body, X_WB);
  pair.may_allocate = may_allocate;
  const auto separation = near_separation(pair, epsilon, statistics, before_B, known);
  Manifold manifold;
  if (!separation) return manifold;
  const double largest_gap = epsilon + tool.margin() + body.margin();
  for (const FeaturePair& p : near_features(pair, *separation, largest_gap)) {
    manifold.push_back(manifold_point(pair, X_WB, p, separation->n_B));
  }
  return manifold;
}

AxesManifold find_axes(const Convex& tool, const Pose& X_WT, const Convex& body, const Pose& X_WB,
                       double epsilon, ProximityStatistics& statistics,
                       const std::optional<Vector3>& before_B, bool may_allocate) {
  CorePair pair(tool, X_WT, body, X_WB);
  pair.may_allocate = may_allocate;
  const auto separation = near_separation(pair, epsilon, statistics, before_B);
  AxesManifold manifold;
  if (!separation) return manifold;
  const double margins = tool.margin() + body.margin();
  Axes kept;
  Axes bearing;  // Axes of these that are meant to carry load.
  std::uint16_t count = 0;
  const auto add = [&](const Axis& axis, const FeaturePairs& pairs, bool bears = true) {
    if (pairs.empty() || manifold.size() + pairs.size() > kMaxAxesPoints) return;
    for (const FeaturePair& p : pairs) {
      ManifoldPoint& point = manifold.emplace_back(manifold_point(pair, X_WB, p, axis.n_B));
      point.axis = count;
      point.face = !bears || is_taken(manifold, p) ? kTellsApart + count : p.face;
    }
    ++count;
  };

  const double least = separation->gap - narrow::kReach * epsilon;
  const Axes axes = body.is_half_space() ? Axes{} : polytope_axes(pair, separation->n_B, least);
  CoreSeparation best = *separation;
  bool is_axis = body.is_half_space() || (sharp(pair) && best.gap <= 0);
  for (const Axis& axis : axes) {
    if (is_axis || (axis.n_B - best.n_B).norm() > narrow::kSameAxis) continue;
    best = {axis.gap, separation->upper, axis.n_B, {}};
    is_axis = true;
  }
  if (is_axis) {
    add({best.n_B, best.gap}, near_features(pair, best, epsilon + margins));
    kept.push_back({best.n_B, best.gap});
    bearing.push_back({best.n_B, best.gap});
  } else if (turns(pair)) {
    add({best.n_B, best.gap}, near_features(pair, best, epsilon + margins));
    kept.push_back({best.n_B, best.gap});
  }
  const auto is_known = [&bearing](const Vector3& n_B) {
    return std::any_of(bearing.begin(), bearing.end(),
                       [&](const Axis& other) { return n_B.dot(other.n_B) > std::cos(kOneAxis); });
  };
  for (const Axis& axis : axes) {
    if (!is_known(axis.n_B)) {
      add(axis, axis_features(pair, axis, epsilon + margins));
      bearing.push_back(axis);
    } else if (is_new_face(axis, pair.body, kept)) {
      add(axis, outermost_tool_points(pair, axis), false);
    } else {
      continue;
    }
    kept.push_back(axis);
  }
  return manifold;
}

}  // namespace hlm::geometry
