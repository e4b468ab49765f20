#include "hlm/geometry/gjk.h"

#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace hlm::geometry {
namespace {

/// Upper and lower bound of the distance this close, m, end the search. Rounding of coordinates of
/// a metre is 1e-16; a larger value costs accuracy of the normal on curved cores.
constexpr double kConverged = 1e-13;
/// Polytopes need about 10 iterations, cylinders about 40. What is not done by then is judged by
/// its bounds.
constexpr int kMaxIterations = 128;
/// A triangle or tetrahedron flatter than this (sine, or sine times sine) is left to its parts.
constexpr double kFlatSine = 1e-12;

/// A point of the Minkowski difference tool - body, and the two points that it comes from.
struct SimplexPoint {
  Vector3 w;
  Vector3 tool;
  Vector3 body;
  double square;  ///< Of the norm of w, m².
};
using Simplex = StaticVector<SimplexPoint, 4>;

/// Some points of a simplex, by their indices, and a weight for each.
struct Part {
  std::array<std::size_t, 4> index{};
  std::array<double, 4> weight{};
  std::size_t size = 0;
};

/// Sets the weights of the foot v of the origin on the affine hull of the part. False if the foot
/// is not inside the part, or the part is degenerate. Reckoned from the part's first point, and for
/// a triangle along its normal: a mean of points metres away would turn a v of a micrometre by
/// their rounding.
bool find_foot(const Simplex& simplex, Part& part, Vector3& v) {
  auto& weight = part.weight;
  const Vector3& w0 = simplex[part.index[0]].w;
  if (part.size == 1) {
    weight[0] = 1;
    v = w0;
    return true;
  }
  const Vector3 e1 = simplex[part.index[1]].w - w0;
  if (part.size == 2) {
    weight[1] = -w0.dot(e1) / e1.squaredNorm();
    weight[0] = 1 - weight[1];
    v = w0 + weight[1] * e1;
    return weight[0] > 0 && weight[1] > 0;
  }
  const Vector3 e2 = simplex[part.index[2]].w - w0;
  const Vector3 area = e1.cross(e2);
  if (part.size == 3) {
    const double square = area.squaredNorm();
    if (!(square > kFlatSine * kFlatSine * e1.squaredNorm() * e2.squaredNorm())) return false;
    weight[1] = e2.cross(w0).dot(area) / square;
    weight[2] = w0.cross(e1).dot(area) / square;
    weight[0] = 1 - weight[1] - weight[2];
    v = w0.dot(area) / square * area;
    return weight[0] > 0 && weight[1] > 0 && weight[2] > 0;
  }
  const Vector3 e3 = simplex[part.index[3]].w - w0;
  const double volume = area.dot(e3);
  const double box = e1.squaredNorm() * e2.squaredNorm() * e3.squaredNorm();
  if (!(volume * volume > kFlatSine * kFlatSine * box)) return false;
  const Vector3 beside = w0.cross(e3) / volume;
  weight[1] = e2.dot(beside);
  weight[2] = -e1.dot(beside);
  weight[3] = -w0.dot(area) / volume;
  weight[0] = 1 - weight[1] - weight[2] - weight[3];
  v.setZero();
  return weight[0] > 0 && weight[1] > 0 && weight[2] > 0 && weight[3] > 0;
}

/// The part of a simplex that holds its point nearest the origin.
struct Nearest {
  Part part;
  Vector3 v = Vector3::Zero();  ///< That point; the origin itself if the simplex contains it.
  double square = std::numeric_limits<double>::infinity();  ///< Square of its distance, m².
};

/// Whether no point of the simplex is nearer the origin than the plane through the part's nearest
/// point v, across v: then none of any other part is.
bool is_nearest_of_all(const Simplex& simplex, unsigned others, const Vector3& v, double square) {
  for (std::size_t i = 0; i + 1 < simplex.size(); ++i) {
    if ((others >> i & 1U) == 0 && simplex[i].w.dot(v) < square) return false;
  }
  return true;
}

/// Tries the parts of the simplex that contain its last point, for after a support step
/// the nearest point lies on one of them: those first that it mostly lies on.
Nearest nearest_to_origin(const Simplex& simplex) {
  Nearest best;
  const std::size_t newest = simplex.size() - 1;
  for (const unsigned others : {3U, 5U, 6U, 7U, 1U, 2U, 4U, 0U}) {
    if (others >= 1U << newest) continue;
    Part part;
    part.index[part.size++] = newest;
    for (std::size_t i = 0; i < newest; ++i) {
      if ((others >> i & 1U) == 0) continue;
      part.index[part.size++] = i;
      if (simplex[i].square < simplex[part.index[0]].square) {
        std::swap(part.index[0], part.index[part.size - 1]);
      }
    }
    Vector3 v;
    if (!find_foot(simplex, part, v)) continue;
    const double square = v.squaredNorm();
    if (square < best.square) best = {part, v, square};
    if (is_nearest_of_all(simplex, others, v, square)) break;
  }
  return best;
}

/// Sets the answer's points from the part, and reduces the simplex to it.
void accept(const Nearest& nearest, Simplex& simplex, ClosestPoints& answer) {
  answer.upper = std::sqrt(nearest.square);
  answer.p_tool.setZero();
  answer.p_body.setZero();
  Simplex reduced;
  for (std::size_t i = 0; i < nearest.part.size; ++i) {
    const SimplexPoint& point = simplex[nearest.part.index[i]];
    answer.p_tool += nearest.part.weight[i] * point.tool;
    answer.p_body += nearest.part.weight[i] * point.body;
    reduced.push_back(point);
  }
  simplex = reduced;
}

}  // namespace

ClosestPoints closest_points(const CorePair& pair, double beyond) noexcept {
  return closest_points(pair, beyond, pair.p_BT.isZero() ? Vector3(Vector3::UnitX()) : pair.p_BT);
}

ClosestPoints closest_points(const CorePair& pair, double beyond, Vector3 v) noexcept {
  using Relation = ClosestPoints::Relation;
  ClosestPoints answer;
  answer.upper = std::numeric_limits<double>::infinity();
  answer.lower = -std::numeric_limits<double>::infinity();
  Simplex simplex;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    const Vector3 n_B = v.normalized();
    const Vector3 p_tool = pair.tool_support(-v);
    const Vector3 p_body = pair.body_support(v);
    const Vector3 w = p_tool - p_body;
    const double gap = n_B.dot(w);
    // Near the end rounding makes the gap smaller again. A gap that is no number is kept.
    if (!(gap <= answer.lower)) {
      answer.lower = gap;
      answer.n_B = n_B;
    }
    if (answer.lower > beyond) return answer;
    if (answer.upper - answer.lower <= kConverged) break;

    simplex.push_back({w, p_tool, p_body, w.squaredNorm()});
    const Nearest nearest = nearest_to_origin(simplex);
    if (!(std::sqrt(nearest.square) < answer.upper)) break;
    accept(nearest, simplex, answer);
    if (answer.upper < kTouchingDistance) {
      answer.relation = Relation::kTouching;
      answer.n_B = answer.upper > 0 ? nearest.v.normalized() : Vector3(Vector3::Zero());
      return answer;
    }
    v = nearest.v;
  }
  answer.relation = Relation::kSeparate;
  return answer;
}

ClosestPoints closest_points_moved_apart(const CorePair& pair, const Vector3& n_B,
                                         double gap) noexcept {
  const Vector3 move = (kMovedApart - gap) * n_B;
  CorePair apart = pair;
  apart.p_BT += move;
  ClosestPoints answer = closest_points(apart, std::numeric_limits<double>::infinity(), n_B);
  answer.p_tool -= move;
  return answer;
}

}  // namespace hlm::geometry
