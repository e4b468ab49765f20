// The contact finder at every tick: it allocates nothing, says what it leaves out, and remembers
// without being changed by it.
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "hlm/geometry/contact_finder.h"
#include "hlm/geometry/mesh_pieces.h"
#include "tests/geometry/reference.h"
#include "tests/support/catch.h"
#include "tests/support/near_touch.h"
#include "tests/support/no_malloc.h"

namespace hlm::geometry::test {
namespace {

using hlm::test::NoMalloc;
using hlm::test::point_on;
using hlm::test::SurfacePoint;
using hlm::test::terrain;
using hlm::test::way_to;

constexpr double kEpsilon = 0.002;  // m
constexpr double kDeepest = 0.02;   // m

/// A tool of one link with shapes of all kinds, and a world with all of them, fixed ones and
/// others; with tiles that adjoin, a plane, a terrain and, if it `keeps_sides` as the others then
/// do, a sheet.
class Zoo {
 public:
  explicit Zoo(Random& random, bool keeps_sides = true)
      : ground_(terrain(10)), sheet_(terrain(6, false)) {
    for (int kind = 0; kind < kShapeKinds; ++kind) {
      add({0, kind}, random_shape(kind, random), random.pose(0.05), false);
    }
    for (int i = 0; i < 4 * kShapeKinds; ++i) {
      const bool fixed = i % 2 == 0;
      X_WB_.push_back(fixed ? Pose{} : random.pose(0.3));
      add({static_cast<int>(X_WB_.size()) - 1, 0}, random_shape(i / 4, random),
          fixed ? random.pose(0.3) : Pose{}, fixed, !fixed && keeps_sides);
    }
    const int tiles = new_body();
    for (int i = 0; i < 16; ++i) {
      add({tiles, i}, Box{Vector3(0.03, 0.03, 0.02)},
          {Vector3(0.5 + 0.03 * (i % 4), 0.03 * (i / 4), 0), Quaternion::Identity()}, true);
    }
    add({new_body(), 0}, HalfSpace{}, {Vector3(0, 0, -0.4), Quaternion::Identity()}, true);
    add_skin(new_body(), ground_, 0, {Vector3(-0.5, 0, 0), Quaternion::Identity()});
    if (keeps_sides) add_sheet();
    pieces_ = std::make_unique<Pieces>(sources_);
  }

  /// A finder of the tool's contacts, with the world in its place.
  std::unique_ptr<ContactFinder> finder(const FinderRoom& room = {}) const {
    const auto may_touch = [](const CollisionId&, const CollisionId& other) {
      return other.body != 0;
    };
    auto made = std::make_unique<ContactFinder>(*pieces_, bodies_, may_touch, std::nullopt, room);
    for (std::size_t i = 0; i < X_WB_.size(); ++i) made->place(static_cast<int>(i), X_WB_[i]);
    return made;
  }

  /// A pose of the tool near touch with any piece, from 20 mm deep to apart.
  Pose near_touch(Random& random) const {
    const auto own = pieces_->of(0);
    const auto other = pieces_->of(random.integer(1, static_cast<int>(X_WB_.size()) - 1));
    const auto any = [&](std::span<const Piece> of) -> const Piece& {
      return of[static_cast<std::size_t>(random.integer(0, static_cast<int>(of.size()) - 1))];
    };
    const Piece& target = any(other);
    const Piece& piece = any(own);
    const Pose X_WO = X_WB_[static_cast<std::size_t>(target.id.body)] * target.X_FG;
    const SurfacePoint at_O = point_on(target, random);
    Pose X_WT{Vector3::Zero(), random.rotation()};
    X_WT.p = way_to({X_WO * at_O.p, X_WO.R * at_O.n}, random.uniform(-kDeepest, 2 * kEpsilon),
                    *piece.convex, X_WT * piece.X_FG);
    return X_WT;
  }

 private:
  int new_body() {
    X_WB_.emplace_back();
    return static_cast<int>(X_WB_.size()) - 1;
  }

  void add(const CollisionId& id, const Shape& shape, const Pose& X_FG, bool fixed,
           bool movable = false, const Mesh* mesh = nullptr, std::size_t triangle = 0) {
    shapes_.push_back(std::make_unique<Convex>(shape));
    bodies_.resize(X_WB_.size());
    bodies_.back().movable = movable;
    sources_.push_back({.id = id,
                        .convex = shapes_.back().get(),
                        .X_FG = X_FG,
                        .fixed = fixed,
                        .mesh = mesh,
                        .triangle = triangle});
  }

  /// Returns the number of the next piece.
  int add_skin(int body, const Mesh& mesh, int first, const Pose& X_FG) {
    const std::vector<Hull> skin = skin_of(mesh);
    for (std::size_t i = 0; i < skin.size(); ++i) {
      add({body, first++}, skin[i], X_FG, true, false, &mesh, i);
    }
    return first;
  }

  void add_sheet() {
    const int sheet = new_body();
    const Pose X_WS{Vector3(0, 0.6, 0), Quaternion::Identity()};
    const int fronts = add_skin(sheet, sheet_, 0, X_WS);
    if (sheet_.back) add_skin(sheet, *sheet_.back, fronts, X_WS);
  }

  Mesh ground_;
  Mesh sheet_;
  std::vector<std::unique_ptr<Convex>> shapes_;
  std::vector<PieceSource> sources_;
  std::vector<ContactFinder::Body> bodies_{{.link = 0}};
  std::vector<Pose> X_WB_{1};
  std::unique_ptr<Pieces> pieces_;
};

}  // namespace

TEST_CASE("A search of the tool allocates nothing, from 20 mm deep to apart", "[optimised]") {
  Random random;
  const Zoo zoo(random);
  const bool all_axes = GENERATE(false, true);
  CAPTURE(all_axes, hlm::test::random_seed());
  const auto finder = zoo.finder();
  ContactFinder::Search search{.epsilon = kEpsilon, .all_axes = all_axes, .of_tool = true};
  const int tool = 0;
  std::size_t contacts = 0;
  std::size_t allocations = 0;
  for (int i = 0; i < 600; ++i) {
    finder->place(tool, zoo.near_touch(random));
    search.remembers = i % 3 > 0;
    const NoMalloc guard;
    contacts += finder->find({&tool, 1}, search).size();
    allocations += guard.allocations();
    CHECK(finder->cut() == FinderCut{});
  }
  CHECK(allocations == 0);
  CHECK(contacts > 1200);
}

TEST_CASE("A finder without room says how many pairs and contacts it left out") {
  Random random;
  const Zoo zoo(random);
  const auto all = zoo.finder();
  const auto few_pairs = zoo.finder({.pairs = 3});
  const auto few_contacts = zoo.finder({.contacts = 4});
  const int tool = 0;
  int without_pairs = 0;
  int without_contacts = 0;
  for (int i = 0; i < 100; ++i) {
    const Pose X_WT = zoo.near_touch(random);
    for (const auto* finder : {&all, &few_pairs, &few_contacts}) (*finder)->place(tool, X_WT);
    const ContactFinder::Search search{.epsilon = kEpsilon, .of_tool = true, .remembers = false};
    const std::size_t found = all->find({&tool, 1}, search).size();
    const std::size_t of_pairs = few_pairs->find({&tool, 1}, search).size();
    const std::size_t of_contacts = few_contacts->find({&tool, 1}, search).size();
    CHECK(all->cut() == FinderCut{});
    CHECK(of_contacts <= 4);
    CHECK((few_pairs->cut().pairs > 0 || of_pairs == found));
    CHECK((few_contacts->cut().contacts > 0 || of_contacts == found));
    without_pairs += few_pairs->cut().pairs > 0;
    without_contacts += few_contacts->cut().contacts > 0;
  }
  CHECK(without_pairs > 10);
  CHECK(without_contacts > 10);
}

TEST_CASE("What a finder remembers of pairs that are apart changes no contact", "[optimised]") {
  Random random;
  const Zoo zoo(random, false);
  CAPTURE(hlm::test::random_seed());
  const auto walker = zoo.finder();
  const int tool = 0;
  std::size_t contacts = 0;
  std::uint64_t queries = 0;  // Of finders without a memory.
  for (int walk = 0; walk < 40; ++walk) {
    Pose X_WT = zoo.near_touch(random);
    const double speed = std::pow(10, random.uniform(-5, -2.5));  // m each search, and 10 rad of it
    const Vector3 way = speed * random.direction();
    const Quaternion turn = rotation_from_vector(10 * speed * random.direction());
    for (int i = 0; i < 25; ++i) {
      X_WT = {X_WT.p + way + 0.5 * random.vector(speed), (turn * X_WT.R).normalized()};
      const auto fresh = zoo.finder();
      walker->place(tool, X_WT);
      fresh->place(tool, X_WT);
      const ContactFinder::Search search{.epsilon = kEpsilon, .of_tool = true};
      const auto found = walker->find({&tool, 1}, search);
      const auto expected = fresh->find({&tool, 1}, search);
      REQUIRE(found.size() == expected.size());
      for (std::size_t k = 0; k < found.size(); ++k) {
        CHECK(found[k].key == expected[k].key);
        CHECK(found[k].p_WC == expected[k].p_WC);
        CHECK(found[k].n_W == expected[k].n_W);
        CHECK(found[k].separation == expected[k].separation);
      }
      CHECK(walker->lost() == fresh->lost());
      contacts += found.size();
      queries += fresh->statistics().queries;
    }
  }
  CHECK(contacts > 1000);
  CHECK(5 * walker->statistics().queries < 4 * queries);
}

}  // namespace hlm::geometry::test
