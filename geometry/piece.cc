#include "hlm/geometry/piece.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "hlm/geometry/mesh_normals.h"

namespace hlm::geometry {
namespace {

/// Distance within which pieces are looked for from a point, m: where its neighbourhood is probed.
constexpr double kNeighbourhood = 6e-4;

std::array<Vector3, 3> corners_of(const Mesh& mesh, std::size_t triangle) {
  return {mesh.corner(triangle, 0), mesh.corner(triangle, 1), mesh.corner(triangle, 2)};
}

/// The point of a triangle that is nearest to p.
Vector3 nearest_in_triangle(const std::array<Vector3, 3>& corners, const Vector3& p) {
  const Vector3 n = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
  const Vector3 over = p - n.dot(p - corners[0]) * n;
  Vector3 nearest = over;
  double least = std::numeric_limits<double>::infinity();  // Square of the border's distance, m².
  bool inside = true;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vector3& from = corners[i];
    const Vector3 along = corners[(i + 1) % 3] - from;
    const bool is_inward = n.dot(along.cross(over - from)) >= 0;
    inside = inside && is_inward;
    const double share = std::clamp(along.dot(over - from) / along.squaredNorm(), 0.0, 1.0);
    const Vector3 on_border = from + share * along;
    const double square = (over - on_border).squaredNorm();
    if (square < least) nearest = on_border;
    least = std::min(least, square);
  }
  return inside ? over : nearest;
}

/// The point of a mesh that is nearest to p, by going from a triangle to nearer neighbours, and its
/// triangle.
std::pair<std::size_t, Vector3> nearest_from(const Mesh& mesh, std::size_t triangle,
                                             const Vector3& p) {
  constexpr int kMostSteps = 16;
  Vector3 nearest = nearest_in_triangle(corners_of(mesh, triangle), p);
  for (int step = 0; step < kMostSteps; ++step) {
    const std::size_t from = triangle;
    for (const int corner : mesh.triangles[from]) {
      for (const std::size_t t : mesh.around[static_cast<std::size_t>(corner)]) {
        const Vector3 other = nearest_in_triangle(corners_of(mesh, t), p);
        if ((other - p).norm() >= (nearest - p).norm()) continue;
        nearest = other;
        triangle = t;
      }
    }
    if (triangle == from) break;
  }
  return {triangle, nearest};
}

}  // namespace

bool is_before(const Piece& piece, const Convex& shape, const Pose& X_FS, std::optional<bool> was) {
  const auto& [n_F, offset] = piece.planes[piece.front];
  const Vector3 n_S = X_FS.R.conjugate() * n_F;
  const double origin = n_F.dot(X_FS.p) - offset;
  const double highest = n_S.dot(shape.support(n_S)) + shape.margin() + origin;
  const double lowest = n_S.dot(shape.support(-n_S)) - shape.margin() + origin;
  if (lowest > 0 || highest < 0) return lowest > 0;
  if (was) return *was;
  const Vector3 centre_G = piece.X_FG.inverse() * shape.bounds(X_FS).center();
  const auto [triangle, nearest_G] = nearest_from(*piece.mesh, piece.triangle, centre_G);
  const double side = pseudonormal(*piece.mesh, triangle, nearest_G).dot(centre_G - nearest_G);
  const bool is_front = piece.mesh->back != nullptr;
  return side > 0 || (side == 0 && is_front);
}

std::optional<PieceSide> curved_side(const Piece& piece, const Vector3& p_F) {
  const Convex& convex = *piece.convex;
  const bool round = convex.margin() > 0;
  if (!round && !convex.is_cylinder()) return {};
  const Vector3 p_G = piece.X_FG.inverse() * p_F;
  Vector3 nearest = Vector3::Zero();  // Nearest point of the core, or of a cylinder's axis.
  nearest.z() = p_G.z();
  if (round) {
    const double half = convex.is_point() ? 0 : convex.support(Vector3::UnitZ()).z();
    nearest.z() = std::clamp(p_G.z(), -half, half);
  }
  const Vector3 away = p_G - nearest;
  const double distance = away.norm();
  if (distance == 0) return {};  // A point in the middle has no outward direction.
  const double radius = round ? convex.margin() : convex.support(away).head<2>().norm();
  return PieceSide{piece.X_FG.R * (away / distance), distance - radius, {}};
}

bool is_surface(const Piece& piece, const PieceSide& side) {
  if (piece.mesh == nullptr || side.face == piece.front) return true;
  return side.face && (piece.rims >> *side.face & 1) != 0;
}

Vector3 within(const Piece& piece, const Vector3& p_F) {
  if (piece.mesh != nullptr) {
    return nearest_in_triangle(piece.triangle_F, p_F);
  }
  constexpr int kRounds = 3;  // One does for boxes, whose sides are perpendicular.
  Vector3 nearest = p_F;
  for (int i = 0; i < kRounds; ++i) {
    const Vector3 from = nearest;
    for_each_side(piece, from, [&](const PieceSide& side) {
      nearest -= std::max(0.0, side.height + side.n_F.dot(nearest - from)) * side.n_F;
      return true;
    });
  }
  return nearest;
}

bool contains(const Piece& piece, const Vector3& p_F, double slack) {
  const Vector3 beyond = (p_F - p_F.cwiseMax(piece.bounds_F.min()).cwiseMin(piece.bounds_F.max()));
  if (beyond.cwiseAbs().maxCoeff() > slack) return false;
  bool inside = false;
  for_each_side(piece, p_F, [&](const PieceSide& side) { return inside = side.height <= slack; });
  return inside;
}

PieceSides sides_at(const Piece& piece, const Vector3& p_F, double reach) {
  PieceSides sides;
  for_each_side(piece, p_F, [&](const PieceSide& side) {
    if (std::abs(side.height) <= reach) sides.push_back(side);
    return sides.size() < kMaxSides;
  });
  return sides;
}

PiecesAtPoint pieces_at(const Piece& piece, const Vector3& p_F) {
  PiecesAtPoint found{&piece};
  const auto from = [](const Piece* other) { return other->bounds_F.min().x(); };
  const double first = p_F.x() - kNeighbourhood - piece.widest;
  for (auto other = std::ranges::lower_bound(piece.adjoining, first, {}, from);
       other != piece.adjoining.end() && from(*other) <= p_F.x() + kNeighbourhood; ++other) {
    Work::add(kSideWork);
    if (found.size() < found.capacity() && contains(**other, p_F, kNeighbourhood)) {
      found.push_back(*other);
    }
  }
  return found;
}

bool is_covered(const Vector3& p_F, const Piece& own, const PiecesAtPoint& pieces) {
  return std::ranges::any_of(
      pieces, [&](const Piece* piece) { return piece != &own && contains(*piece, p_F, 0); });
}

}  // namespace hlm::geometry
