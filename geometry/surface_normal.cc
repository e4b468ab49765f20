#include "hlm/geometry/surface_normal.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace hlm::geometry {
namespace {

/// A normal farther than 45° from those of a surface, as a cosine, says nothing of that surface.
constexpr double kNear = 0.7;
/// Nearest probe before a side, m: far above rounding, far below what can be felt.
constexpr double kLeastProbe = 5e-6;
/// A point this far out of a piece is still on its side, m: rounding.
constexpr double kOnSide = 1e-9;
/// Depth to which a tool may be pressed into a wall without losing the floor it stands on, m.
constexpr double kShallow = 3e-4;
/// Squared sine between two sides that are parallel: 2°.
constexpr double kParallel = 1e-3;
/// A smaller square of the sine between normals, or volume of three, makes them one, or a plane.
constexpr double kDegenerate = 1e-9;

using Normals = StaticVector<Vector3, kMaxSides>;

bool has(const Normals& normals, const Vector3& n) {
  return std::ranges::any_of(
      normals, [&](const Vector3& other) { return (other - n).squaredNorm() < kDegenerate; });
}

/// Whether no other piece is within a gap before a point of a piece's side with normal n.
bool is_open(const Vector3& p_F, const Vector3& n_F, const Piece& own,
             const PiecesAtPoint& pieces) {
  constexpr int kProbes = 4;  // More see wedges better that open from the piece's border on.
  for (int i = 0; i <= kProbes; ++i) {
    const double ahead = std::max(kLeastProbe, i * kSeamGap / kProbes);
    if (is_covered(p_F + ahead * n_F, own, pieces)) return false;
  }
  return true;
}

/// Whether a side goes on open next to a point at which another piece stands on it: out of a side
/// of that piece which is near. So a floor does at a wall into which the tool is pressed.
bool is_open_beside(const Vector3& p_F, const Vector3& n_F, const Piece& own,
                    const PiecesAtPoint& pieces) {
  return std::ranges::any_of(pieces, [&](const Piece* piece) {
    return piece != &own &&
           std::ranges::any_of(sides_at(*piece, p_F, kShallow), [&](const PieceSide& side) {
             const Vector3 out = across(side.n_F, n_F);
             if (out.squaredNorm() < kParallel) return false;
             const Vector3 beside = p_F + (kSeamStep - side.height) / out.squaredNorm() * out;
             return contains(own, beside, kOnSide) && is_open(beside, n_F, own, pieces);
           });
  });
}

/// Adds the normals of a piece's sides at a point that no other piece covers there. Each side is
/// probed a step within its borders.
void add_open_normals(const Piece& piece, const Vector3& p_F, const PiecesAtPoint& pieces,
                      Normals& normals) {
  if (!contains(piece, p_F, kSeamGap)) return;
  PieceSides sides = sides_at(piece, p_F, kSeamGap);
  erase_if(sides, [](const PieceSide& side) { return side.height < -kSeamStep; });
  for (const PieceSide& side : sides) {
    Vector3 within = p_F - side.height * side.n_F;
    for (const PieceSide& border : sides) {
      const Vector3 out = across(border.n_F, side.n_F);
      if (&border == &side || out.squaredNorm() < kParallel) continue;
      within -= (border.height + kSeamStep) / out.squaredNorm() * out;
    }
    if (!has(normals, side.n_F) && normals.size() < normals.capacity() &&
        (is_open(within, side.n_F, piece, pieces) ||
         is_open_beside(within, side.n_F, piece, pieces))) {
      normals.push_back(side.n_F);
    }
  }
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

/// The vector nearest to n in the cone of some normals; zero if n is more than 90° off.
Vector3 nearest_in_cone(const Vector3& n, const Normals& normals) {
  Vector3 nearest = Vector3::Zero();  // The projection: of all candidates the longest.
  const auto consider = [&](const Vector3& candidate) {
    if (candidate.squaredNorm() > nearest.squaredNorm()) nearest = candidate;
  };
  for (std::size_t i = 0; i < normals.size(); ++i) {
    consider(std::max(0.0, n.dot(normals[i])) * normals[i]);
    for (std::size_t j = 0; j < i; ++j) {
      if (const auto candidate = between(n, normals[i], normals[j])) consider(*candidate);
      for (std::size_t k = 0; k < j; ++k) {
        if (spanned(n, normals[i], normals[j], normals[k])) return n;
      }
    }
  }
  return nearest;
}

}  // namespace

Vector3 surface_normal(const Vector3& n, const Vector3& p_F, const PiecesAtPoint& pieces) {
  Normals normals;
  for (const Piece* piece : pieces) {
    add_open_normals(*piece, p_F, pieces, normals);
    if (has(normals, n)) return n;  // Mostly of the first piece.
  }
  const Vector3 nearest = nearest_in_cone(n, normals);
  return nearest.norm() < kNear ? Vector3::Zero() : nearest.normalized();
}

}  // namespace hlm::geometry
