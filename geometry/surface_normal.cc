#include "hlm/geometry/surface_normal.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "hlm/geometry/work.h"

namespace hlm::geometry {
namespace {

/// A normal farther than 45° from those of a surface, as a cosine, says nothing of that surface.
constexpr double kNear = 0.7;
/// Overlap of the ball that feels sides, m: what makes a step of kEdgeStep none.
constexpr double kBallOverlap = kEdgeStep;
/// Its radius, m: with that overlap it fits into gaps wider than kEdgeGap.
constexpr double kBallRadius = kEdgeGap / 2 + kBallOverlap;
/// How far its foot may be beyond the border of its side, m: then it rests on neighbours that are
/// a step lower.
constexpr double kBeyondBorder = kBallRadius - kBallOverlap - kEdgeStep;
/// How far from a point its foot may be, m: a tool may be pressed into a wall by some of it without
/// losing the floor it stands on.
constexpr double kFarthest = 3e-4 + kBallRadius;
/// Distance from a point at which a side is looked for, m: far above steps, far below what is felt.
constexpr double kHollow = 2e-4;
/// Squared sine between two sides that are parallel: 2°.
constexpr double kParallel = 1e-3;
/// A smaller square of the sine between normals, or volume of three, makes them one, or a plane.
constexpr double kDegenerate = 1e-9;

/// A normal of the surface at a point, and one piece whose side has it.
struct OpenNormal {
  Vector3 n;
  const Piece* piece = nullptr;
};
using Normals = StaticVector<OpenNormal, kMaxSides>;

bool has(const Normals& normals, const Vector3& n) {
  return std::ranges::any_of(
      normals, [&](const OpenNormal& other) { return (other.n - n).squaredNorm() < kDegenerate; });
}

/// Whether two sides that meet at a point leave a hollow there: the first lies on the side to which
/// the other leans.
bool is_hollow(const OpenNormal& a, const OpenNormal& b, const Vector3& p_F) {
  if (a.piece == b.piece) return false;
  const Vector3 way = kHollow * across(b.n, a.n).normalized();
  return contains(*a.piece, p_F + way, kEdgeStep) && !contains(*a.piece, p_F - way, kEdgeStep);
}

/// How far a point is within the sides of a piece, each moved out by a radius, m; of one that is
/// no deeper than `least`, something no larger than that.
double depth_in(const Piece& piece, const Vector3& p_F, double radius, double least) {
  double depth = std::numeric_limits<double>::infinity();
  if (piece.mesh != nullptr) {  // It is mostly over the triangle.
    const auto& [n_F, offset] = piece.planes[piece.front];
    depth = radius - (n_F.dot(p_F) - offset);
    if (depth <= least) return depth;
  }
  for_each_side(piece, p_F, [&](const PieceSide& side) {
    depth = std::min(depth, radius - side.height);
    return depth > least;
  });
  return depth;
}

/// Moves the foot of a ball along a side with normal n the shortest way out of a piece.
void push_out(const Piece& piece, const Vector3& n, Vector3& foot) {
  const Vector3 center = foot + kBallRadius * n;
  Vector3 shortest = Vector3::Zero();
  double least = kFarthest * kFarthest;
  for_each_side(piece, center, [&](const PieceSide& side) {
    const Vector3 out = across(side.n_F, n);
    if (out.squaredNorm() < kParallel) return true;
    const Vector3 way = (kBallRadius - side.height) / out.squaredNorm() * out;
    if (way.squaredNorm() < least) shortest = way;
    least = std::min(least, way.squaredNorm());
    return true;
  });
  foot += shortest;
}

/// Whether a side of a piece is felt at or near a point of it: a small ball can touch it there and
/// is in no other piece. So narrow gaps and low steps make no difference, and a floor is felt at
/// the wall into which the tool is pressed.
bool is_open(const Vector3& p_F, const Vector3& n_F, const Piece& own,
             const PiecesAtPoint& pieces) {
  constexpr int kRounds = 4;
  Vector3 foot = p_F;
  for (int round = 0;; ++round) {
    for_each_side(own, foot, [&](const PieceSide& border) {
      if (border.height <= 0) return true;
      const Vector3 out = across(border.n_F, n_F);
      const double beyond = border.height / out.norm() - kBeyondBorder;  // Along the side.
      if (out.squaredNorm() > kParallel && beyond > 0) foot -= beyond * out.normalized();
      return true;
    });
    if ((foot - p_F).squaredNorm() > kFarthest * kFarthest || Work::is_spent()) return false;
    const Piece* deepest = nullptr;
    double depth = kBallOverlap;
    const Vector3 center = foot + kBallRadius * n_F;
    for (const Piece* piece : pieces) {
      if (piece == &own) continue;
      const double in = depth_in(*piece, center, kBallRadius, depth);
      if (in > depth) {
        deepest = piece;
        depth = in;
      }
    }
    if (deepest == nullptr) return true;
    if (round == kRounds) return false;
    push_out(*deepest, n_F, foot);
  }
}

/// Calls `use(side)` for the sides of a piece that a point is on, open or not.
template <class Use>
void for_each_side_at(const Piece& piece, const Vector3& p_F, const Use& use) {
  if (piece.mesh != nullptr && piece.rims == 0) {  // Its triangle alone counts: mostly it is not.
    const auto& [n_F, offset] = piece.planes[piece.front];
    const PieceSide front{n_F, n_F.dot(p_F) - offset, piece.front};
    const bool is_there = front.height >= -kEdgeStep && front.height <= kEdgeGap;
    if (is_there && contains(piece, p_F, kEdgeGap)) use(front);
    return;
  }
  if (!contains(piece, p_F, kEdgeGap)) return;
  for (const PieceSide& side : sides_at(piece, p_F, kEdgeGap)) {
    if (side.height >= -kEdgeStep && is_surface(piece, side)) use(side);
  }
}

/// Adds the normals of a piece's sides at a point that are felt there.
void add_open_normals(const Piece& piece, const Vector3& p_F, const PiecesAtPoint& pieces,
                      Normals& normals) {
  for_each_side_at(piece, p_F, [&](const PieceSide& side) {
    if (!has(normals, side.n_F) && normals.size() < normals.capacity() &&
        is_open(p_F - side.height * side.n_F, side.n_F, piece, pieces)) {
      normals.push_back({side.n_F, &piece});
    }
  });
}

/// The part of n in the span of two normals, if it is a sum of positive multiples of them.
std::optional<Vector3> between(const Vector3& n, const Vector3& a, const Vector3& b) {
  const double ab = a.dot(b);
  const double determinant = 1 - ab * ab;
  if (determinant < kDegenerate) return {};
  const double of_a = (n.dot(a) - ab * n.dot(b)) / determinant;
  const double of_b = (n.dot(b) - ab * n.dot(a)) / determinant;
  if (of_a < 0 || of_b < 0) return {};
  return of_a * a + of_b * b;
}

bool spanned(const Vector3& n, const Vector3& a, const Vector3& b, const Vector3& c) {
  const double volume = a.dot(b.cross(c));
  if (std::abs(volume) < kDegenerate) return false;
  return n.dot(b.cross(c)) / volume >= 0 && n.dot(c.cross(a)) / volume >= 0 &&
         n.dot(a.cross(b)) / volume >= 0;
}

/// The vector nearest to n in the cone of some normals; zero if n is more than 90° off. Between the
/// sides of a hollow there is no normal.
template <class IsHollow>
Vector3 nearest_in_cone(const Vector3& n, const Normals& normals, const IsHollow& is_hollow) {
  Vector3 nearest = Vector3::Zero();  // The projection: of all candidates the longest.
  const auto consider = [&](const Vector3& candidate) {
    if (candidate.squaredNorm() > nearest.squaredNorm()) nearest = candidate;
  };
  for (std::size_t i = 0; i < normals.size(); ++i) {
    consider(std::max(0.0, n.dot(normals[i].n)) * normals[i].n);
    for (std::size_t j = 0; j < i; ++j) {
      if (is_hollow(normals[i], normals[j])) continue;
      if (const auto candidate = between(n, normals[i].n, normals[j].n)) consider(*candidate);
      for (std::size_t k = 0; k < j; ++k) {
        if (spanned(n, normals[i].n, normals[j].n, normals[k].n)) return n;
      }
    }
  }
  return nearest;
}

/// Whether no normal of the sides at a point can be near n, whichever of them are open: quick, and
/// mostly so where a piece of a skin ends below the surface.
bool is_far_from_all(const Vector3& n, const Vector3& p_F, const PiecesAtPoint& pieces) {
  constexpr double kSurely = 1e-3;  // Cosine: sides that count as one differ by less.
  Normals sides;
  for (const Piece* piece : pieces) {
    for_each_side_at(*piece, p_F, [&](const PieceSide& side) {
      const bool is_new = !has(sides, side.n_F) && sides.size() < sides.capacity();
      if (is_new) sides.push_back({side.n_F, piece});
    });
  }
  if (sides.size() == sides.capacity()) return false;
  const auto none = [](const OpenNormal&, const OpenNormal&) { return false; };
  return nearest_in_cone(n, sides, none).norm() < kNear - kSurely;
}

}  // namespace

void bound_normals(Piece& piece) {
  constexpr double kSurely = 1e-3;  // rad: normals that count as one differ by less.
  const auto normal_of = [](const Piece& of) -> const Vector3& { return of.planes[of.front].n_F; };
  const auto is_plain = [](const Piece* of) { return of->mesh != nullptr && of->rims == 0; };
  // With more than a contact's place has room for, any normal is taken for one.
  if (!is_plain(&piece) || piece.adjoining.size() + 1 >= Normals::static_capacity) return;
  if (!std::ranges::all_of(piece.adjoining, is_plain)) return;
  Vector3 sum = normal_of(piece);
  for (const Piece* other : piece.adjoining) sum += normal_of(*other);
  const Vector3 middle = sum.normalized();
  double least = middle.dot(normal_of(piece));
  for (const Piece* other : piece.adjoining) least = std::min(least, middle.dot(normal_of(*other)));
  if (!(least > 0)) return;  // No convex cone.
  piece.middle_normal_F = middle;
  const double widest = std::acos(std::min(1.0, least)) + std::acos(kNear) + kSurely;
  piece.least_along = std::cos(std::min(widest, std::numbers::pi));
}

bool is_flat(const Vector3& n, const Vector3& p_F, const PiecesAtPoint& pieces) {
  constexpr double kFlat = 0.035;
  Normals normals;
  for (const Piece* piece : pieces) {
    const std::size_t known = normals.size();
    add_open_normals(*piece, p_F, pieces, normals);
    for (std::size_t i = known; i < normals.size(); ++i) {
      if ((normals[i].n - n).norm() >= kFlat) return false;
    }
  }
  return !normals.empty();
}

Vector3 surface_normal(const Vector3& n, const Vector3& p_F, const PiecesAtPoint& pieces) {
  Normals normals;
  for (const Piece* piece : pieces) {
    add_open_normals(*piece, p_F, pieces, normals);
    if (has(normals, n) || Work::is_spent()) return n;  // Mostly of the first piece.
    if (piece == pieces.front() && is_far_from_all(n, p_F, pieces)) return Vector3::Zero();
  }
  if (normals.size() == normals.capacity()) return n;  // There may be more: a tip of many faces.
  const auto hollow = [&](const OpenNormal& a, const OpenNormal& b) {
    return is_hollow(a, b, p_F);
  };
  const Vector3 nearest = nearest_in_cone(n, normals, hollow);
  return nearest.norm() < kNear ? Vector3::Zero() : nearest.normalized();
}

}  // namespace hlm::geometry
