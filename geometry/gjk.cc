#include "hlm/geometry/gjk.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "hlm/geometry/tolerances.h"
#include "hlm/geometry/work.h"

namespace hlm::geometry {
namespace {

/// Polytopes need about 10 iterations, cylinders about 40. What is not done by then is judged by
/// its bounds.
constexpr int kMaxIterations = 128;
/// Work of one, besides that of the supports of hulls.
constexpr std::uint64_t kIterationWork = 80;

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
    if (!(square > narrow::kLine * narrow::kLine * e1.squaredNorm() * e2.squaredNorm()))
      return false;
    weight[1] = e2.cross(w0).dot(area) / square;
    weight[2] = w0.cross(e1).dot(area) / square;
    weight[0] = 1 - weight[1] - weight[2];
    v = w0.dot(area) / square * area;
    return weight[0] > 0 && weight[1] > 0 && weight[2] > 0;
  }
  const Vector3 e3 = simplex[part.index[3]].w - w0;
  const double volume = area.dot(e3);
  const double box = e1.squaredNorm() * e2.squaredNorm() * e3.squaredNorm();
  if (!(volume * volume > narrow::kLine * narrow::kLine * box)) return false;
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

/// Part of a core that nearest points of curved cores lie on: a segment, or what the support along
/// a normal is wherever that turns to.
struct Carrier {
  bool is_segment = false;
  Vector3 from = Vector3::Zero();
  Vector3 to = Vector3::Zero();

  Vector3 along() const { return to - from; }
  /// The point nearest to p.
  Vector3 nearest(const Vector3& p) const {
    const Vector3 d = along();
    return from + std::clamp((p - from).dot(d) / d.squaredNorm(), 0.0, 1.0) * d;
  }
};

/// What a core's points of a simplex lie on. None if it is a face.
template <class Point>
std::optional<Carrier> carrier(const Convex& core, const Simplex& simplex, const Point& point) {
  Carrier found{false, point(0), point(0)};
  if (core.is_ellipsoid()) return found;
  for (std::size_t i = 1; i < simplex.size(); ++i) {
    const Vector3 p = point(i);
    if (p == found.from || p == found.to) continue;
    if (found.is_segment) return {};
    found.is_segment = true;
    found.to = p;
  }
  return found;
}

/// Nearest points of curved cores by Newton's method for the normal, from that of a search that is
/// nearly done: two or three steps take the place of some twenty. They are proved as the others
/// are.
class Finish {
 public:
  Finish(const CorePair& pair, const Simplex& simplex) : pair_(pair) {
    known_ = find(
                 pair.tool, Vector3(pair.R_BT.col(2)), pair.p_BT, simplex,
                 [&](std::size_t i) { return simplex[i].tool; }, tool_) &&
             find(
                 pair.body, Vector3(Vector3::UnitZ()), Vector3(Vector3::Zero()), simplex,
                 [&](std::size_t i) { return simplex[i].body; }, body_);
  }

  /// Whether it has found them, and set the answer.
  bool run(Vector3 n, ClosestPoints& answer) {
    if (!known_ || (tool_.is_segment && body_.is_segment && !cross(n))) return false;
    for (int step = 0; step < kMaxSteps; ++step) {
      Work::add(kIterationWork);
      for (const Carrier* carrier : {&tool_, &body_}) {
        if (!carrier->is_segment) continue;
        const Vector3 e = carrier->along();
        n -= n.dot(e) / e.squaredNorm() * e;
      }
      n.normalize();
      Vector3 p_tool = pair_.tool_support(-n);
      Vector3 p_body = pair_.body_support(n);
      const double lower = n.dot(p_tool - p_body);
      slide(pair_.tool, Vector3(pair_.R_BT.col(2)), pair_.p_BT, p_tool, tool_);
      slide(pair_.body, Vector3(Vector3::UnitZ()), Vector3(Vector3::Zero()), p_body, body_);
      meet(p_tool, p_body);
      const Vector3 w = p_tool - p_body;
      const double upper = w.norm();
      if (upper - lower <= narrow::kLength) {
        answer.lower = lower;
        answer.upper = upper;
        answer.n_B = n;
        answer.p_tool = p_tool;
        answer.p_body = p_body;
        return true;
      }
      if (!turn(w, n)) return false;
    }
    return false;
  }

 private:
  static constexpr int kMaxSteps = 4;

  template <class Point>
  static bool find(const Convex& core, const Vector3& axis, const Vector3& middle,
                   const Simplex& simplex, const Point& point, Carrier& found) {
    if (core.is_cylinder()) {
      // Its line if there are points of both rims, else the rim.
      const double first = axis.dot(point(0) - middle);
      for (std::size_t i = 1; i < simplex.size(); ++i) {
        if (axis.dot(point(i) - middle) * first > 0) continue;
        found = {true, middle, middle + axis};
        return true;
      }
      return true;
    }
    const auto known = carrier(core, simplex, point);
    if (known) found = *known;
    return known.has_value();
  }

  /// The line of a cylinder is where the support along the normal is.
  static void slide(const Convex& core, const Vector3& axis, const Vector3& middle,
                    const Vector3& p, Carrier& carrier) {
    if (!core.is_cylinder() || !carrier.is_segment) return;
    const Vector3 foot = p - axis.dot(p - middle) * axis;
    carrier.from = foot - core.half_length() * axis;
    carrier.to = foot + core.half_length() * axis;
  }

  /// Sets n to the normal of two segments; false if they are parallel.
  bool cross(Vector3& n) const {
    const Vector3 e = tool_.along();
    const Vector3 f = body_.along();
    const Vector3 across = e.cross(f);
    if (!(across.squaredNorm() >
          narrow::kDirection * narrow::kDirection * e.squaredNorm() * f.squaredNorm())) {
      return false;
    }
    n = across.dot(n) > 0 ? across : Vector3(-across);
    return true;
  }

  /// The points of the carriers nearest to each other.
  void meet(Vector3& p_tool, Vector3& p_body) const {
    if (tool_.is_segment && body_.is_segment) {
      const Vector3 e = tool_.along();
      const Vector3 f = body_.along();
      const Vector3 across = e.cross(f).cross(f);  // Perpendicular to f, in the plane of both.
      const double share = across.dot(body_.from - tool_.from) / across.dot(e);
      p_tool = tool_.from + std::clamp(share, 0.0, 1.0) * e;
      p_body = body_.nearest(p_tool);
    } else if (tool_.is_segment) {
      p_tool = tool_.nearest(p_body);
    } else if (body_.is_segment) {
      p_body = body_.nearest(p_tool);
    }
  }

  /// Turns n so that the supports are along it: w + dw = g (n + dn), where dw = -J dn.
  bool turn(const Vector3& w, Vector3& n) const {
    if (tool_.is_segment && body_.is_segment) return false;
    const auto rate = [&](const Vector3& t) {
      const Vector3 n_T = pair_.R_BT.transpose() * n;
      return Vector3(pair_.R_BT * pair_.tool.support_rate(-n_T, pair_.R_BT.transpose() * t) +
                     pair_.body.support_rate(n, t));
    };
    const double g = w.dot(n);
    if (tool_.is_segment || body_.is_segment) {
      const Vector3 t = n.cross((tool_.is_segment ? tool_ : body_).along()).normalized();
      n += w.dot(t) / (t.dot(rate(t)) + g) * t;
    } else {
      const Vector3 e = n.unitOrthogonal();
      const Vector3 f = n.cross(e);
      const Vector3 Je = rate(e);
      const Vector3 Jf = rate(f);
      const double ee = e.dot(Je) + g;
      const double ff = f.dot(Jf) + g;
      const double ef = e.dot(Jf);
      const double determinant = ee * ff - ef * ef;
      const double we = w.dot(e);
      const double wf = w.dot(f);
      n += ((ff * we - ef * wf) * e + (ee * wf - ef * we) * f) / determinant;
    }
    return n.allFinite();
  }

  const CorePair& pair_;
  Carrier tool_;
  Carrier body_;
  bool known_ = false;
};

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
  const bool curved = !pair.tool.is_polytope() || !pair.body.is_polytope();
  double finish_from = narrow::kNewtonFrom;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    Work::add(kIterationWork);
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
    if (answer.upper - answer.lower <= narrow::kLength) break;

    simplex.push_back({w, p_tool, p_body, w.squaredNorm()});
    const Nearest nearest = nearest_to_origin(simplex);
    if (!(std::sqrt(nearest.square) < answer.upper)) break;
    accept(nearest, simplex, answer);
    if (answer.upper < narrow::kAccuracy) {
      answer.relation = Relation::kTouching;
      answer.n_B = answer.upper > 0 ? nearest.v.normalized() : Vector3(Vector3::Zero());
      return answer;
    }
    v = nearest.v;
    const double width = answer.upper - answer.lower;
    if (curved && width < finish_from) {
      if (Finish(pair, simplex).run(v, answer)) break;
      finish_from = narrow::kNewtonAgain * width;
    }
  }
  answer.relation = Relation::kSeparate;
  return answer;
}

ClosestPoints closest_points_moved_apart(const CorePair& pair, const Vector3& n_B,
                                         double gap) noexcept {
  const Vector3 move = (narrow::kMovedApart - gap) * n_B;
  CorePair apart = pair;
  apart.p_BT += move;
  ClosestPoints answer = closest_points(apart, std::numeric_limits<double>::infinity(), n_B);
  answer.p_tool -= move;
  return answer;
}

}  // namespace hlm::geometry
