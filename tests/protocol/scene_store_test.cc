// What the records of a scene stream make together, and what is refused of it.
#include "hlm/protocol/scene_store.h"

#include <string>

#include "tests/protocol/sample_records.h"
#include "tests/support/catch.h"

namespace hlm::protocol {
namespace {

constexpr std::size_t kLinks = 2;

SceneShape box(double edge) {
  SceneShape shape{.kind = SceneShapeKind::kBox, .size = {edge, edge, edge}};
  shape.hash = hash_of(shape);
  return shape;
}

ScenePlacement placed(std::uint32_t id, const SceneShape& shape, ContactSide side = {}) {
  return {.id = id, .shape = shape.hash, .side = side};
}

/// A store that holds a box, placed as 1, 2 and 3.
SceneStore three_boxes(const SceneLimits& limits = {}) {
  SceneStore store(kLinks, limits);
  REQUIRE(store.apply(box(1)));
  for (std::uint32_t id = 1; id <= 3; ++id) REQUIRE(store.apply(placed(id, box(1))));
  return store;
}

/// The fault after the record, which must be refused, and all after it.
SceneFault fault_of(SceneStore store, const SceneRecord& record) {
  CHECK_FALSE(store.apply(record));
  CHECK_FALSE(store.apply(SceneCommit{1000}));
  CHECK(store.scene() != 1000);
  REQUIRE(store.fault());
  return *store.fault();
}

TEST_CASE("Shapes are held once, placements by their id, and both are counted") {
  SceneStore store = three_boxes();
  CHECK((store.shapes() == 1 && store.placements().size() == 3));
  const std::size_t bytes = store.bytes();
  CHECK(bytes >= sizeof(SceneShape));
  CHECK(store.apply(box(1)));  // again
  CHECK((store.shapes() == 1 && store.bytes() == bytes));
  CHECK(store.apply(test::tetrahedron()));
  CHECK(store.bytes() >= bytes + 4 * 24 + 4 * 12);
  REQUIRE(store.shape(test::tetrahedron().hash));
  CHECK(*store.shape(test::tetrahedron().hash) == test::tetrahedron());
  CHECK(store.shape(1) == nullptr);
  CHECK(store.placements().at(2) == placed(2, box(1)));
  SceneState state;
  CHECK(store.apply(SceneCommit{4}));
  store.describe(state);
  CHECK((state.received_scene == 4 && state.shapes == 1 && state.placements == 3));
  CHECK((state.bytes == bytes && state.error == SceneError::kNone && state.text.empty()));
}

TEST_CASE("A commit drops the shapes that no placement has, and whoever keeps one still has it") {
  SceneStore store = three_boxes();
  CHECK(store.apply(test::tetrahedron()));
  CHECK(store.apply(placed(9, test::tetrahedron())));
  CHECK(store.apply(SceneCommit{1}));
  CHECK(store.shapes() == 2);
  const auto kept = store.shape(box(1).hash);
  const std::size_t before = store.bytes();
  for (std::uint32_t id = 1; id <= 3; ++id) CHECK(store.apply(SceneRemoval{id}));
  CHECK(store.shapes() == 2);  // Not before the commit: it may be placed again.
  CHECK(store.apply(SceneCommit{2}));
  CHECK(store.shapes() == 1);
  CHECK(store.bytes() < before);
  CHECK(*kept == box(1));
  CHECK(fault_of(store, placed(1, box(1))).error == SceneError::kUnknownShape);
  CHECK(store.apply(SceneRemoval{9}));
  CHECK(store.apply(SceneCommit{3}));
  CHECK((store.bytes() == 0 && store.placements().empty()));
}

TEST_CASE("A placement that was removed may come again, without what was said of its pairs") {
  SceneStore store = three_boxes();
  CHECK(store.apply(SceneApart{2, 1}));
  CHECK(store.apply(SceneApart{2, 1}));
  CHECK(store.apply(SceneApart{2, 3}));
  CHECK((store.are_apart(1, 2) && store.are_apart(2, 1) && !store.are_apart(1, 3)));
  CHECK((store.apart() == std::vector<SceneApart>{{1, 2}, {2, 3}}));
  CHECK(store.apply(SceneRemoval{2}));
  CHECK(store.apart().empty());
  CHECK(store.apply(placed(2, box(1), {SideKind::kToolLink, 1})));
  CHECK_FALSE(store.are_apart(1, 2));
  CHECK(store.placements().at(2).side.index == 1);
}

TEST_CASE("What does not fit together is refused, with the placement that it is about") {
  const auto check = [](const SceneRecord& record, SceneError error, std::uint32_t item,
                        const std::string& text) {
    const SceneFault fault = fault_of(three_boxes(), record);
    CHECK(fault.error == error);
    CHECK(fault.item == item);
    CHECK(fault.text == text);
  };
  check(placed(2, box(1)), SceneError::kDuplicate, 2,
        "placement 2 is there already; it must be removed first");
  check(placed(4, box(2)), SceneError::kUnknownShape, 4,
        "placement 4 has a shape that is not there; it must come before");
  check(placed(4, box(1), {SideKind::kToolLink, 2}), SceneError::kSide, 4,
        "placement 4 is on link 2 of the tool; it must be below 2");
  check(SceneRemoval{5}, SceneError::kUnknownPlacement, 5,
        "placement 5 is to be removed; it must be there");
  check(SceneApart{1, 6}, SceneError::kUnknownPlacement, 6,
        "placement 6 is to be apart from another; it must be there");
  check(SceneApart{1, 1}, SceneError::kMalformed, 1,
        "placement 1 is to be apart from itself; it must be another");

  SceneStore store = three_boxes();
  CHECK(store.apply(SceneCommit{5}));
  CHECK(fault_of(store, SceneCommit{5}).text == "commit 5 must be above the one before, 5");
  CHECK(fault_of(store, SceneCommit{4}).error == SceneError::kOrder);
  SceneShape half_space{.kind = SceneShapeKind::kHalfSpace};
  half_space.hash = hash_of(half_space);
  CHECK(store.apply(half_space));
  CHECK(store.apply(placed(8, half_space)));
  const auto on_body = fault_of(store, placed(9, half_space, {SideKind::kMovableBody, 1}));
  CHECK(on_body.error == SceneError::kGeometry);
  CHECK(on_body.text == "placement 9 is a half space of movable_body; it must be of the world");
}

TEST_CASE("More than a store may hold is refused, with the limit") {
  CHECK(fault_of(three_boxes({.placements = 3}), placed(4, box(1))).text ==
        "placements 4 must be at most 3");
  SceneStore pairs = three_boxes({.apart = 1});
  CHECK(pairs.apply(SceneApart{1, 2}));
  CHECK(fault_of(pairs, SceneApart{1, 3}).text == "pairs apart 2 must be at most 1");
  const SceneFault bytes = fault_of(three_boxes({.shape_bytes = 400}), test::tetrahedron());
  CHECK(bytes.error == SceneError::kLimit);
  CHECK(bytes.text.ends_with("must be at most 400"));
}

TEST_CASE("A fault stays, what is held stays, and the state tells it") {
  SceneStore store = three_boxes();
  CHECK(store.apply(SceneCommit{1}));
  store.refuse({SceneError::kGeometry, 2, "placement 2: its hull is flat"});
  store.refuse({SceneError::kLimit, 3, "another"});
  CHECK_FALSE(store.apply(SceneRemoval{1}));
  SceneState state;
  store.describe(state);
  CHECK((state.received_scene == 1 && state.placements == 3));
  CHECK((state.error == SceneError::kGeometry && state.item == 2));
  CHECK(std::string(state.text.begin(), state.text.end()) == "placement 2: its hull is flat");
}

}  // namespace
}  // namespace hlm::protocol
