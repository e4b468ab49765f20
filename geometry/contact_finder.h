// Which contacts are there within ε, of the tool or of a body, with all others?
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "hlm/geometry/flat_map.h"
#include "hlm/geometry/internal_edges.h"
#include "hlm/geometry/manifold.h"
#include "hlm/geometry/merge.h"
#include "hlm/geometry/pieces.h"
#include "hlm/geometry/solid_contacts.h"

namespace hlm::geometry {

/// What a search has room for, made once: a finder of a few pieces takes less. Larger: memory, 0.4
/// kB for each contact and 0.25 for each pair. Smaller: FinderCut is not 0 where it matters.
struct FinderRoom {
  std::size_t pairs = 16384;     ///< Pieces that are near a piece of the bodies searched for.
  std::size_t contacts = 16384;  ///< Contacts before those of several pairs are merged.
};

/// What a search left out for want of room or work. A pair has all its contacts or none; of pairs
/// that it did not get to know one is counted.
struct FinderCut {
  std::size_t pairs = 0;
  std::size_t contacts = 0;
  bool operator==(const FinderCut&) const = default;
  FinderCut& operator+=(const FinderCut& other) noexcept {
    pairs += other.pairs;
    contacts += other.contacts;
    return *this;
  }
};

/// Shapes once, poses whenever they change. A body is a link of a tool or one of the world's.
///
/// After its construction nothing allocates, takes a lock or throws, if `may_touch` does not.
class ContactFinder {
 public:
  struct Body {
    int link = -1;         ///< Of the tool; -1: none.
    bool movable = false;  ///< Where the tool overlaps it, it stays on the side on which it was.
  };
  /// Whether two pieces may touch, of different bodies.
  using MayTouch = std::function<bool(const CollisionId& a, const CollisionId& b)>;

  struct Search {
    double epsilon = 0;     ///< ε, m, >= 0.
    bool all_axes = false;  ///< On all near axes of each pair (find_axes()), not the best alone.
    /// Of the tool: sides are kept, and known from the search before.
    bool of_tool = false;
    /// Also those of what stands still: for searches that follow each other as closely as ticks.
    bool keeps_all_sides = false;
    /// Whether the sides are kept for the next search.
    bool remembers = true;
    /// Work that it may do. Where a search of the same bodies has come near to it, the next one
    /// begins with the pairs that may be deepest.
    std::uint64_t work = std::numeric_limits<std::uint64_t>::max();
  };

  /// `bodies`: by their numbers in `pieces`, which outlives this. All are at the world's origin.
  /// `planar_normal_W`: of the plane in which a planar tool's first link moves.
  ContactFinder(const Pieces& pieces, std::vector<Body> bodies, MayTouch may_touch,
                const std::optional<Vector3>& planar_normal_W = {}, const FinderRoom& room = {});

  /// Sets the pose of a body that is not fixed.
  void place(int body, const Pose& X_WB) noexcept { X_WB_[static_cast<std::size_t>(body)] = X_WB; }
  Pose X_WG(const Piece& piece) const;

  /// All contacts of some bodies with σ <= ε, in an order that depends on the input alone, without
  /// velocities and loads. `a` is the side of these bodies, to which normals point; `b` is a link,
  /// or counts as the world. Valid until the next call.
  std::span<const FoundContact> find(std::span<const int> bodies, const Search& search) noexcept;
  /// Whether in the latest search a pair overlapped deeply at an internal edge but had no contact:
  /// a narrow tool is deep in two pieces, past the sides on which they adjoin.
  bool lost() const noexcept { return lost_; }
  /// What the latest search left out.
  const FinderCut& cut() const noexcept { return cut_; }

  const ProximityStatistics& statistics() const noexcept { return statistics_; }

 private:
  /// A piece of the tool or of a body, and one that it is near.
  struct Pair {
    const Piece& own;
    const Piece& other;
    Pose X_WG;
    Pose X_WO;
    bool keeps_side = false;       ///< The tool stays on its side of a movable body.
    bool may_pass_beside = false;  ///< A planar tool may be beside it for good.
    KnownSeparation known = {};
  };

  /// Pieces whose bounds are near each other.
  struct Candidate {
    const Piece* own;
    const Piece* other;
    double overlap = 0;  ///< Of the bounds, m, at most.
  };

  /// About an assembly's origin, around all of it.
  struct Ball {
    int body;      ///< Assembly::body.
    double reach;  ///< Its radius, m.
  };

  const Body& body_of(const Piece& piece) const {
    return bodies_[static_cast<std::size_t>(piece.id.body)];
  }
  void gather(std::span<const int> bodies, const Search& search);
  void find_near(const Piece& own, double epsilon);
  void sort_deepest_first();
  void add_pairs(const Search& search);
  void merge();
  void add_pair(const Piece& own, const Pose& X_WG, const Piece& other, const Search& search);
  void add_of_solid(const Piece& own, const Pose& X_WG, const Piece& other, const Search& search);
  void drop_in_solids(const Pair& pair, std::size_t first);
  bool has_room_for(std::size_t count);
  void add_contact(const Piece& own, const Piece& other, const ManifoldPoint& point);
  bool stays_apart(const Pair& pair, const Search& search);
  bool is_inside(const Pair& pair, const FoundContact& contact) const;
  bool is_before_sheet(const Pair& pair, const Search& search) const;
  void add_deep_contacts(Pair& pair, const Search& search);
  void add_on_next_axis(const Pair& pair, const Search& search);
  void add_on_surface(const Pair& pair, const AxesManifold& manifold);
  double add_contacts(Pair& pair, const Search& search, const std::optional<Vector3>& near_O);
  AxesManifold manifold_of(Pair& pair, const Search& search, const std::optional<Vector3>& near_O);

  /// Normals between pieces of the tool and of movable bodies, in the frame of the latter.
  using Sides = FlatMap<std::pair<CollisionId, CollisionId>, Vector3>;
  /// Front or back of the sheets onto which the tool is pressed, by its piece, sheet and triangle.
  using Pressed = FlatMap<std::tuple<CollisionId, const Mesh*, std::size_t>, const Mesh*>;

  /// What is known of pairs of a piece and a solid, and of which search of the piece's body.
  struct KnownSolid {
    std::uint64_t search = 0;
    SolidMemory memory;
  };
  using KnownSolids = FlatMap<std::pair<const Piece*, const Piece*>, KnownSolid>;

  /// Normals along which pairs are apart, in the frame of the other shape.
  using Apart = FlatMap<std::pair<const Piece*, const Piece*>, Vector3>;

  const Pieces& pieces_;
  std::vector<Body> bodies_;
  MayTouch may_touch_;
  std::optional<Vector3> planar_normal_W_;
  std::vector<Pose> X_WB_;
  std::vector<Ball> balls_;  ///< In the order of the assemblies.
  FinderRoom room_;
  FinderCut cut_;
  std::vector<Candidate> near_;
  std::vector<bool> crowded_;  ///< By the first body of a search: it came near to its work.
  std::vector<FoundContact> contacts_;
  MergeSpace merge_space_;
  bool shared_ = false;  ///< Whether pieces may have found the same contact.
  bool lost_ = false;
  Sides sides_before_;  ///< Sides at the search of the tool before.
  Sides sides_;         ///< Sides at the present or latest one.
  Pressed pressed_before_;
  Pressed pressed_;
  Apart apart_before_;
  Apart apart_;
  KnownSolids known_solids_;
  std::vector<std::uint64_t> searches_;  ///< By body: how many have been remembered.
  std::vector<const Piece*> solids_;     ///< All of them.
  ProximityStatistics statistics_;
};

}  // namespace hlm::geometry
