// The convex pieces that rigid assemblies are made of: which of them adjoin, and whose faces go on
// in each other?
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "hlm/geometry/box_tree.h"
#include "hlm/geometry/piece.h"

namespace hlm::geometry {

/// What a piece is made of.
struct PieceSource {
  CollisionId id;
  const Convex* convex = nullptr;
  Pose X_FG;
  bool fixed = false;          ///< Of the assembly of all fixed bodies, whose frame is the world.
  Friction friction = {};      ///< Piece::friction.
  const Mesh* mesh = nullptr;  ///< Piece::mesh.
  std::size_t triangle = 0;
  const MeshSolid* solid = nullptr;  ///< Instead of a convex shape: of fixed bodies alone.
};

/// Pieces that are fixed to each other.
struct Assembly {
  static constexpr int kFixed = -1;
  int body = kFixed;           ///< Whose frame F is; kFixed: the world's, of all fixed bodies.
  std::vector<Piece*> pieces;  ///< By body, then by shape.
  BoxTree tree;                ///< Over their bounds in F.
};

/// The pieces of a whole world.
class Pieces {
 public:
  /// By body, then by shape, from 0 on, without a gap; a body may have none. Shapes and meshes
  /// outlive this. Throws std::length_error if more pieces adjoin or overlap each one than
  /// `most_adjoining` on the mean: where thousands lie in one place they take memory and time
  /// without end. In a mesh they are some twelve.
  explicit Pieces(std::span<const PieceSource> sources,
                  std::size_t most_adjoining = std::numeric_limits<std::size_t>::max());
  Pieces(const Pieces&) = delete;
  Pieces& operator=(const Pieces&) = delete;

  const Piece& of(const CollisionId& id) const {
    return pieces_[first_[static_cast<std::size_t>(id.body)] + static_cast<std::size_t>(id.shape)];
  }
  /// Number of the edge in which two surfaces meet, among all such edges of their assembly: from
  /// 2^15 on, after all edges of a piece. None if either face of the piece is its alone.
  std::optional<std::uint16_t> border_of(const Piece& piece, std::size_t face_a,
                                         std::size_t face_b) const;
  bool is_fixed(int body) const { return fixed_[static_cast<std::size_t>(body)]; }
  /// That of the fixed bodies first, if there are any.
  std::span<const Assembly> assemblies() const { return assemblies_; }
  /// The pieces that are fixed to a piece, it among them.
  const Assembly& assembly_of(const Piece& piece) const {
    return assemblies_[assembly_of_[static_cast<std::size_t>(piece.id.body)]];
  }
  /// The pieces of a body.
  std::span<const Piece> of(int body) const {
    const auto index = static_cast<std::size_t>(body);
    if (index + 1 >= first_.size()) return {};
    return {pieces_.data() + first_[index], first_[index + 1] - first_[index]};
  }

 private:
  static void find_adjoining(const Assembly& assembly, std::size_t most);
  static void join_faces(const Assembly& assembly);
  static void join_corners(const Assembly& assembly);
  void number_borders(const Assembly& assembly);

  std::vector<Piece> pieces_;
  std::vector<Assembly> assemblies_;
  std::map<std::pair<Piece::Surface, Piece::Surface>, std::uint16_t> borders_;
  std::vector<std::size_t> first_;        ///< First piece of each body, and how many there are.
  std::vector<bool> fixed_;               ///< Fixed or not, for each body.
  std::vector<std::size_t> assembly_of_;  ///< By body.
};

}  // namespace hlm::geometry
