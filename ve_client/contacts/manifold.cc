#include "ve_client/contacts/manifold.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "ve_client/contacts/clip.h"
#include "ve_client/contacts/penetration.h"
#include "ve_client/contacts/separation.h"

namespace hlm::ve {
namespace {

/// A face whose normal is within this angle, rad, of the contact's normal takes part with all its
/// points. A peg in its hole is tilted by up to 0.02 rad. A larger value makes contacts whose
/// normal is off that of the face by so much, where one face slips off the border of another; a
/// smaller one leaves a single contact there.
constexpr double kFaceAngle = 0.1;
/// A contact this near to the smallest separation, m, stands for it. A tenth of the accuracy.
constexpr double kRepresents = 1e-7;

/// Cosine between two normals of a pair that are on one side of it: 30°.
constexpr double kSameSide = 0.866;

static_assert(kMaxOpposites + 1 <= kMaxManifoldPoints);

/// A feature pair of the cores and a point of each on one line along the normal, in B.
struct FeaturePair {
  Feature tool_feature;
  Feature body_feature;
  Vector3 p_tool;
  Vector3 p_body;
};
using FeaturePairs = StaticVector<FeaturePair, kMaxManifoldPoints>;

Patch in_body_frame(Patch patch, const CorePair& pair) {
  for (auto& corner : patch.corners) corner.p = pair.p_BT + pair.R_BT * corner.p;
  patch.normal = pair.R_BT * patch.normal;
  return patch;
}

bool is_aligned_face(const Patch& patch, const Vector3& direction) {
  static const double cosine = std::cos(kFaceAngle);
  return patch.is_face() && patch.normal.dot(direction) >= cosine;
}

/// The features that meet along n: those of a face of either shape if n is normal to it, else those
/// of parallel edges, else none. The body's face is preferred as the reference: the set is the same
/// otherwise except corners on a common border.
FeaturePairs facing_features(const CorePair& pair, const Vector3& n) {
  const Vector3 n_T = pair.R_BT.transpose() * n;
  const Patch tool = in_body_frame(pair.tool.facing(-n_T), pair);
  const Patch body = pair.body.facing(n);
  FeaturePairs pairs;
  if (is_aligned_face(body, n)) {
    for (const Opposite& o : overlap(tool, body, n)) {
      pairs.push_back({o.first, o.second, o.p_first, o.p_second});
    }
  } else if (is_aligned_face(tool, -n)) {
    for (const Opposite& o : overlap(body, tool, n)) {
      pairs.push_back({o.second, o.first, o.p_second, o.p_first});
    }
  } else {
    const Patch tool_edge = in_body_frame(pair.tool.edge_facing(-n_T), pair);
    for (const Opposite& o : overlap_of_edges(tool_edge, pair.body.edge_facing(n))) {
      pairs.push_back({o.first, o.second, o.p_first, o.p_second});
    }
  }
  return pairs;
}

FeaturePair witness_features(const CorePair& pair, const CoreSeparation& separation) {
  const Witness witness = find_witness(pair, separation);
  const Vector3 p_T = pair.R_BT.transpose() * (witness.p_tool - pair.p_BT);
  return {pair.tool.feature_at(p_T), pair.body.feature_at(witness.p_body), witness.p_tool,
          witness.p_body};
}

/// All feature pairs with a gap of at most `largest_gap` between the cores, m. One of them has the
/// gap of the separation.
FeaturePairs near_features(const CorePair& pair, const CoreSeparation& separation,
                           double largest_gap) {
  const Vector3& n = separation.n_B;
  const auto gap = [&](const FeaturePair& p) { return n.dot(p.p_tool - p.p_body); };
  FeaturePairs pairs = facing_features(pair, n);
  erase_if(pairs, [&](const FeaturePair& p) { return !(gap(p) <= largest_gap); });
  const bool represented = std::any_of(pairs.begin(), pairs.end(), [&](const FeaturePair& p) {
    return gap(p) <= separation.gap + kRepresents;
  });
  if (represented) return pairs;

  const FeaturePair witness = witness_features(pair, separation);
  erase_if(pairs, [&](const FeaturePair& p) {
    return p.tool_feature == witness.tool_feature && p.body_feature == witness.body_feature;
  });
  pairs.push_back(witness);
  return pairs;
}

}  // namespace

Manifold find_contacts(const Convex& tool, const Pose& X_WT, const Convex& body, const Pose& X_WB,
                       double epsilon, ProximityStatistics& statistics,
                       const std::optional<Vector3>& before_B) {
  assert(!tool.is_half_space());
  ++statistics.queries;
  const CorePair pair(tool, X_WT, body, X_WB);
  const double margins = tool.margin() + body.margin();
  auto separation = find_separation(pair, epsilon + margins);
  if (!separation) return {};
  const bool overlaps = separation->gap - margins < 0;
  if (before_B && overlaps && !body.is_half_space() && separation->n_B.dot(*before_B) < kSameSide) {
    separation = find_penetration_near(pair, *before_B);
  }
  if (!separation->is_confirmed()) {
    ++statistics.failures;
    return {};
  }
  if (separation->gap - margins > epsilon) return {};

  const Vector3& n = separation->n_B;
  Manifold manifold;
  for (const FeaturePair& p : near_features(pair, *separation, epsilon + margins)) {
    manifold.push_back({.tool_feature = p.tool_feature,
                        .body_feature = p.body_feature,
                        .p_WC = X_WB * (p.p_body + body.margin() * n),
                        .n_W = X_WB.R * n,
                        .separation = n.dot(p.p_tool - p.p_body) - margins});
  }
  return manifold;
}

}  // namespace hlm::ve
