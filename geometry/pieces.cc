#include "hlm/geometry/pieces.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <stdexcept>
#include <string>

#include "hlm/geometry/gjk.h"
#include "hlm/geometry/interruption.h"
#include "hlm/geometry/mesh_normals.h"
#include "hlm/geometry/surface_normal.h"

namespace hlm::geometry {
namespace {

/// Faces whose normals differ by less, rad, can go on in each other: 0.1°. Larger flattens meshes.
constexpr double kSameDirection = 1.7e-3;

/// How far beyond a sheet what is pressed onto it is looked for, m. Less: a level sheet loses it.
constexpr double kDeepInSheet = 0.03;

Eigen::AlignedBox3d grown(Eigen::AlignedBox3d box, double by) {
  box.min().array() -= by;
  box.max().array() += by;
  return box;
}

bool is_of_sheet(const Piece& piece) { return piece.mesh != nullptr && piece.mesh->is_sheet(); }

/// Whether a sheet's triangle is in the plane of a face of a piece, and looks as that does.
bool is_level_with(const Piece& sheet, const Piece& piece) {
  const Piece::Plane& front = sheet.planes[sheet.front];
  return std::ranges::any_of(piece.planes, [&](const Piece::Plane& face) {
    return (face.n_F - front.n_F).norm() <= kSameDirection &&
           std::abs(face.offset - front.offset) <= kEdgeStep;
  });
}

/// Whether what is behind a piece of a sheet counts for another piece, and the other way round: the
/// front and the back of sheets are apart, and a solid goes on in one where they are level.
bool may_adjoin(const Piece& a, const Piece& b) {
  if (!is_of_sheet(a) && !is_of_sheet(b)) return true;
  if (!is_of_sheet(a)) return is_level_with(b, a);
  if (!is_of_sheet(b)) return is_level_with(a, b);
  if (a.mesh == b.mesh) return true;
  return a.mesh->sheet != b.mesh->sheet && a.planes[a.front].n_F.dot(b.planes[b.front].n_F) > 0;
}

bool adjoin(const Piece& a, const Piece& b) {
  const Piece& tool = a.convex->is_half_space() ? b : a;
  const Piece& body = a.convex->is_half_space() ? a : b;
  if (tool.convex->is_half_space()) return false;
  if (a.convex->is_ellipsoid() || b.convex->is_ellipsoid()) return false;  // They have no sides.
  if (!may_adjoin(a, b)) return false;
  const CorePair pair(*tool.convex, tool.X_FG, *body.convex, body.X_FG);
  const double margins = tool.convex->margin() + body.convex->margin();
  if (body.convex->is_half_space()) {
    const Vector3 n = Vector3::UnitZ();
    return pair.tool_support(-n).z() - margins <= kEdgeGap;
  }
  return closest_points(pair, kEdgeGap + margins).relation != ClosestPoints::Relation::kBeyond;
}

/// The faces of a piece at its triangle's edges that no other triangle has, a bit each.
std::uint32_t rims_of(const Piece& piece) {
  constexpr double kOnPlane = 1e-7;  // m: rounding.
  const Mesh& mesh = *piece.mesh;
  const auto& corners = mesh.triangles[piece.triangle];
  std::uint32_t rims = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const int from = corners[i];
    const int to = corners[(i + 1) % 3];
    const auto& around = mesh.around[static_cast<std::size_t>(from)];
    const auto has_both = [&](std::size_t t) {
      return std::ranges::count(mesh.triangles[t], to) > 0;
    };
    if (std::ranges::count_if(around, has_both) > 1) continue;
    for (std::size_t face = 0; face < piece.planes.size() && face < 32; ++face) {
      const Piece::Plane& plane = piece.planes[face];
      const auto is_on = [&](int corner) {
        const Vector3 p_F = piece.X_FG * mesh.points[static_cast<std::size_t>(corner)];
        return std::abs(plane.n_F.dot(p_F) - plane.offset) < kOnPlane;
      };
      if (face != piece.front && is_on(from) && is_on(to)) rims |= std::uint32_t{1} << face;
    }
  }
  return rims;
}

}  // namespace

Pieces::Pieces(std::span<const PieceSource> sources, std::size_t most_adjoining) {
  for (const PieceSource& source : sources) {
    interruption_point();
    while (first_.size() <= static_cast<std::size_t>(source.id.body)) {
      first_.push_back(pieces_.size());
      fixed_.push_back(source.fixed);
    }
    Piece& piece = pieces_.emplace_back();
    piece.id = source.id;
    piece.convex = source.convex;
    piece.friction = source.friction;
    piece.mesh = source.mesh;
    piece.is_by_skin = source.mesh != nullptr;
    piece.triangle = source.triangle;
    piece.X_FG = source.X_FG;
    piece.solid = source.solid;
    if (piece.solid != nullptr) {
      for (int corner = 0; corner < 8; ++corner) {
        const auto which = static_cast<Eigen::AlignedBox3d::CornerType>(corner);
        piece.bounds_F.extend(piece.X_FG * Vector3(piece.solid->bounds().corner(which)));
      }
      // What is pressed through a sheet is still before it.
      if (!piece.solid->is_closed()) piece.bounds_F = grown(piece.bounds_F, kDeepInSheet);
      continue;
    }
    piece.bounds_F = piece.convex->bounds(piece.X_FG);
    for (const Vector3& n_G : piece.convex->face_normals()) {
      const Vector3 on_face =
          piece.convex->is_half_space() ? Vector3(Vector3::Zero()) : piece.convex->support(n_G);
      const Vector3 n_F = piece.X_FG.R * n_G;
      piece.planes.push_back({n_F, n_F.dot(piece.X_FG * on_face)});
    }
    if (piece.mesh != nullptr) {
      for (std::size_t i = 0; i < 3; ++i) {
        piece.triangle_F[i] = piece.X_FG * piece.mesh->corner(piece.triangle, i);
      }
      const Vector3 out_F = piece.X_FG.R * piece.mesh->area(piece.triangle);
      const auto along = [&](const Piece::Plane& plane) { return out_F.dot(plane.n_F); };
      const auto front = std::ranges::max_element(piece.planes, {}, along);
      piece.front = static_cast<std::size_t>(front - piece.planes.begin());
      if (is_of_sheet(piece)) piece.rims = rims_of(piece);
    }
  }
  first_.push_back(pieces_.size());
  std::map<int, std::vector<Piece*>> together;
  for (Piece& piece : pieces_) {
    together[is_fixed(piece.id.body) ? Assembly::kFixed : piece.id.body].push_back(&piece);
  }
  for (auto& [body, pieces] : together) {
    std::vector<BoxTree::Box> boxes;
    for (const Piece* piece : pieces) boxes.push_back(piece->bounds_F);
    assembly_of_.resize(fixed_.size(), 0);
    for (const Piece* piece : pieces) {
      assembly_of_[static_cast<std::size_t>(piece->id.body)] = assemblies_.size();
    }
    assemblies_.push_back({body, std::move(pieces), BoxTree(boxes)});
    const Assembly& assembly = assemblies_.back();
    if (assembly.pieces.size() < 2) continue;
    find_adjoining(assembly, most_adjoining);
    join_faces(assembly);
    join_corners(assembly);
    number_borders(assembly);
    for (Piece* piece : assembly.pieces) {
      interruption_point();
      bound_normals(*piece);
    }
  }
}

/// most: for each piece, on the mean.
void Pieces::find_adjoining(const Assembly& assembly, std::size_t most) {
  std::size_t pairs = 0;
  for (std::size_t i = 0; i < assembly.pieces.size(); ++i) {
    Piece& a = *assembly.pieces[i];
    if (a.solid != nullptr) continue;
    const Eigen::AlignedBox3d reach = grown(a.bounds_F, kEdgeGap);
    const auto meets = [&](const BoxTree::Box& box) { return reach.intersects(box); };
    assembly.tree.visit(meets, [&](std::size_t j) {
      Piece& b = *assembly.pieces[j];
      if (j <= i || b.solid != nullptr || !reach.intersects(b.bounds_F)) return;
      interruption_point();
      if (!adjoin(a, b)) return;
      if (++pairs / assembly.pieces.size() > most) {
        throw std::length_error("pieces that overlap or adjoin one must be at most " +
                                std::to_string(most) + " on the mean");
      }
      // A plane has no sides: where another piece covers it, that piece is in the way.
      if (!a.convex->is_half_space()) a.adjoining.push_back(&b);
      if (!b.convex->is_half_space()) b.adjoining.push_back(&a);
    });
  }
  for (Piece* piece : assembly.pieces) {
    std::ranges::stable_sort(piece->adjoining, {}, [](const Piece* other) {
      return std::pair(other->bounds_F.min().x(), other->id);
    });
    for (const Piece* other : piece->adjoining) {
      piece->is_by_skin = piece->is_by_skin || other->mesh != nullptr;
      piece->widest = std::max(piece->widest, other->bounds_F.sizes().x());
    }
  }
}

/// Coplanar faces of pieces that adjoin go on in each other, and so do those of a chain of such
/// pieces.
void Pieces::join_faces(const Assembly& assembly) {
  struct Face {
    Piece* piece;
    std::size_t face;
    auto operator<=>(const Face&) const = default;
  };
  std::map<Face, Face> leads_to;  // Towards the face of the smallest piece, which has no entry.
  const auto root = [&](Face face) {
    for (auto next = leads_to.find(face); next != leads_to.end(); next = leads_to.find(face)) {
      face = next->second;
    }
    return face;
  };
  const auto join = [&](Face a, Face b) {
    a = root(a);
    b = root(b);
    if (a == b) return;
    const bool b_stands = std::pair(b.piece->id, b.face) < std::pair(a.piece->id, a.face);
    leads_to.emplace(b_stands ? a : b, b_stands ? b : a);
  };
  for (Piece* a : assembly.pieces) {
    for (Piece* b : a->adjoining) {
      const Vector3 there = a->bounds_F.intersection(b->bounds_F).center();  // Also of a gap.
      for (std::size_t i = 0; i < a->planes.size(); ++i) {
        interruption_point();
        for (std::size_t j = 0; j < b->planes.size(); ++j) {
          const auto& [n, offset] = a->planes[i];
          if ((n - b->planes[j].n_F).norm() > kSameDirection) continue;
          const double step = (n - b->planes[j].n_F).dot(there) - offset + b->planes[j].offset;
          if (std::abs(step) <= kEdgeStep) join({a, i}, {b, j});
        }
      }
    }
  }
  std::map<Face, bool> joined;
  for (const auto& [face, next] : leads_to) joined[face] = joined[root(face)] = true;
  for (const auto& [face, is_joined] : joined) {
    const Face stands = root(face);
    Piece* const piece = face.piece;
    if (piece->surfaces.empty()) {
      for (std::size_t i = 0; i < piece->planes.size(); ++i) {
        piece->surfaces.push_back({piece->id, static_cast<std::uint16_t>(i)});
      }
    }
    piece->surfaces[face.face] = {stands.piece->id, static_cast<std::uint16_t>(stands.face), true};
  }
}

/// Corners of pieces in one place have one name, that of the first piece.
void Pieces::join_corners(const Assembly& assembly) {
  constexpr double kSamePoint = 1e-6;  // m
  const auto has_corners = [](const Piece& piece) {
    return piece.mesh == nullptr && piece.convex->is_polytope() && piece.convex->margin() == 0;
  };
  for (Piece* piece : assembly.pieces) {
    if (piece->adjoining.empty() || !has_corners(*piece)) continue;
    const auto vertices = piece->convex->vertices();
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      interruption_point();
      Piece::Surface stands{piece->id, static_cast<std::uint16_t>(i)};
      const Vector3 p_F = piece->X_FG * vertices[i];
      for (const Piece* other : piece->adjoining) {
        if (!(other->id < stands.id) || !has_corners(*other)) continue;
        const Vector3 p_G = other->X_FG.inverse() * p_F;
        const auto others = other->convex->vertices();
        const auto same = std::ranges::find_if(
            others, [&](const Vector3& q_G) { return (q_G - p_G).norm() < kSamePoint; });
        if (same == others.end()) continue;
        stands = {other->id, static_cast<std::uint16_t>(same - others.begin()), true};
      }
      piece->corners.push_back(stands);
    }
  }
}

void Pieces::number_borders(const Assembly& assembly) {
  constexpr std::uint16_t kFirst = 1 << 15;
  std::uint16_t next = kFirst;
  for (const Piece* piece : assembly.pieces) {
    for (const Piece::Surface& a : piece->surfaces) {
      interruption_point();
      for (const Piece::Surface& b : piece->surfaces) {
        if (next >= kFirst && a < b && borders_.try_emplace({a, b}, next).second) ++next;
      }
    }
  }
}

std::optional<std::uint16_t> Pieces::border_of(const Piece& piece, std::size_t face_a,
                                               std::size_t face_b) const {
  if (piece.surfaces.empty()) return {};
  const auto found = borders_.find(std::minmax(piece.surfaces[face_a], piece.surfaces[face_b]));
  if (found == borders_.end()) return {};
  return found->second;
}

}  // namespace hlm::geometry
