#include "hlm/geometry/union.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "hlm/geometry/surface_normal.h"

namespace hlm::geometry {
namespace {

/// How far a tool may be pressed into what a piece stands on without losing it, m.
constexpr double kPressedIn = 3e-4;
/// Sine of 2 degrees between two sides that are parallel.
constexpr double kParallel = 0.035;
/// How far inside of a piece a point of its surface is looked for, m.
constexpr double kUnder = 2e-5;

/// Height that rounding leaves in doubt, m.
constexpr double kRounding = 1e-7;

/// The nearest way out of a piece.
struct WayOut {
  Vector3 n_F = Vector3::UnitZ();  ///< Unit.
  double depth = 0;                ///< m.
};

/// None if the point is not in the piece.
std::optional<WayOut> way_out_of(const Piece& piece, const Vector3& p_F) {
  if (piece.solid != nullptr) {
    if (!piece.solid->is_closed()) return {};
    const Vector3 p_S = piece.X_FG.inverse() * p_F;
    if (!piece.solid->bounds().contains(p_S)) return {};
    const auto nearest = piece.solid->nearest(p_S, std::numeric_limits<double>::infinity());
    if (!nearest) return {};
    const Vector3 n_S = piece.solid->pseudonormal(*nearest);
    if (n_S.dot(p_S - nearest->p) >= 0) return {};
    return WayOut{piece.X_FG.R * n_S.normalized(), nearest->distance};
  }
  if (!contains(piece, p_F, 0)) return {};
  WayOut way{.depth = std::numeric_limits<double>::infinity()};
  for_each_side(piece, p_F, [&](const PieceSide& side) {
    if (-side.height < way.depth) way = {side.n_F, -side.height};
    return true;
  });
  return way;
}

/// The way out of the first piece other than this one that a point lies in.
template <class ForEach>
std::optional<WayOut> cover_of(const Piece& piece, const Vector3& p_F, const ForEach& for_each) {
  std::optional<WayOut> found;
  for_each(p_F, [&](const Piece& other) {
    if (found || &other == &piece || !other.bounds_F.contains(p_F)) return;
    found = way_out_of(other, p_F);
  });
  return found;
}

template <class ForEach>
bool is_open(const Piece& piece, const Vector3& p_F, const Vector3& n_F, const ForEach& for_each) {
  const auto cover = cover_of(piece, p_F + kEdgeGap * n_F, for_each);
  if (!cover) return true;
  if (cover->depth > kPressedIn) return false;
  const Vector3 along = across(cover->n_F, n_F);
  const double sine = along.norm();
  if (sine < kParallel) return false;
  const Vector3 beside = p_F + (cover->depth + kUnder) / (sine * sine) * along;
  if ((beside - p_F).norm() > 2 * kPressedIn) return false;
  if (!way_out_of(piece, beside - kUnder * n_F) || way_out_of(piece, beside + kUnder * n_F)) {
    return false;  // The piece ends there.
  }
  return !cover_of(piece, beside + kEdgeGap * n_F, for_each);
}

}  // namespace

bool is_on_union(const Assembly& assembly, const Piece& piece, const Vector3& p_F,
                 const Vector3& n_F) noexcept {
  if (assembly.pieces.size() < 2) return true;
  return is_open(piece, p_F, n_F, [&](const Vector3& at, const auto& use) {
    assembly.tree.visit([&](const BoxTree::Box& box) { return box.contains(at); },
                        [&](std::size_t place) { use(*assembly.pieces[place]); });
  });
}

bool is_outside(std::span<const Piece* const> solids, const Piece& piece, const Vector3& p_F,
                const Vector3& n_F) noexcept {
  return is_open(piece, p_F, n_F, [&](const Vector3&, const auto& use) {
    for (const Piece* solid : solids) use(*solid);
  });
}

namespace {

/// Whether any of the pieces that are near `ahead` `has` it, other than `piece` or `or_itself`.
bool is_in_another(const Assembly& assembly, const Piece& piece, bool or_itself,
                   const Vector3& ahead, const auto& has) {
  bool found = false;
  const auto is_near = [&](const BoxTree::Box& box) {
    return !found && box.exteriorDistance(ahead) <= kEdgeGap;
  };
  assembly.tree.visit(is_near, [&](std::size_t place) {
    const Piece& other = *assembly.pieces[place];
    if (&other == &piece && !or_itself) return;
    found = found || (is_near(other.bounds_F) && has(other));
  });
  return found;
}

}  // namespace

bool goes_on(const Assembly& assembly, const Piece& piece, const Vector3& p_F,
             const Vector3& face_F, const Vector3& beyond_F, bool on_rim) noexcept {
  const Vector3 ahead = p_F + kEdgeGap * beyond_F;
  const Vector3 under = ahead - (kEdgeStep + kUnder) * face_F;
  return is_in_another(assembly, piece, on_rim, ahead, [&](const Piece& other) {
    if (other.solid == nullptr) return contains(other, under, 0);
    const Pose X_SF = other.X_FG.inverse();
    if (other.solid->is_closed()) return other.solid->contains(X_SF * under);
    return other.solid->nearest(X_SF * ahead, kEdgeGap / 2).has_value();
  });
}

bool rises_to(const Assembly& assembly, const Piece& piece, const Vector3& p_F, const Vector3& n_F,
              const Vector3& beyond_F) noexcept {
  const Vector3 ahead = p_F + kEdgeGap * across(beyond_F, n_F).normalized();
  const Vector3 under = ahead - kRounding * n_F;
  return is_in_another(assembly, piece, false, ahead, [&](const Piece& other) {
    if (other.solid == nullptr) return contains(other, under, 0);
    return other.solid->contains(other.X_FG.inverse() * under);
  });
}

}  // namespace hlm::geometry
