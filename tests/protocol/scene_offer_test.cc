// What a client offers: read back as it was, and refused by the place of what is wrong.
#include "hlm/protocol/scene_offer.h"

#include <span>
#include <stdexcept>
#include <variant>
#include <vector>

#include "hlm/protocol/scene_store.h"
#include "tests/support/catch.h"

namespace hlm::protocol {
namespace {

SceneShape ball(double radius) { return {.kind = SceneShapeKind::kSphere, .size = {radius, 0, 0}}; }

/// A server's reading of a stream.
struct Reading {
  SceneRecordReader reader = SceneRecordReader();
  SceneStore store = SceneStore(2);

  /// Returns how many shapes came.
  std::size_t read(const std::vector<std::uint8_t>& bytes) {
    std::size_t shapes = 0;
    reader.feed(std::as_bytes(std::span(bytes)));
    while (auto record = reader.next()) {
      if (std::holds_alternative<SceneShape>(*record)) ++shapes;
      REQUIRE(store.apply(std::move(*record)));
    }
    return shapes;
  }
};

TEST_CASE("A store that reads an offer holds its shapes where they were placed, as scene 1") {
  SceneOffer offer{.shapes = {{.shape = ball(0.1), .side = {SideKind::kToolLink, 1}},
                              {.shape = ball(0.1), .side = {}},
                              {.shape = ball(0.2), .side = {SideKind::kMovableBody, 7}}},
                   .apart = {{0, 2}}};
  std::vector<OfferedShape>& shapes = offer.shapes;
  shapes[1].X_BS.p.z() = 2;
  shapes[2].friction = {0.5, FrictionRule::kProduct, 3};
  shapes[2].group = 4;
  OfferedBefore before;
  Reading reading;
  CHECK(reading.read(scene_of(offer, 2, before)) == 2);  // Two are one shape: it goes out once.
  const SceneStore& store = reading.store;
  CHECK(store.scene() == 1);
  REQUIRE(store.placements().size() == 3);
  for (std::uint32_t i = 0; i < 3; ++i) {
    const ScenePlacement& placement = store.placements().at(i);
    CHECK(placement.side == shapes[i].side);
    CHECK(placement.X_BS.p == shapes[i].X_BS.p);
    CHECK(placement.friction == shapes[i].friction);
    CHECK(placement.group == shapes[i].group);
    CHECK(store.shape(placement.shape)->size == shapes[i].shape.size);
  }
  CHECK(store.are_apart(2, 0));
  CHECK_FALSE(store.are_apart(0, 1));
}

TEST_CASE("A friction that no packet has is offered as the largest that one has") {
  const SceneOffer offer{.shapes = {{.shape = ball(0.1), .side = {}, .friction = {1e5}}}};
  OfferedBefore before;
  Reading reading;
  reading.read(scene_of(offer, 2, before));
  CHECK(reading.store.placements().at(0).friction.coefficient == 10);
}

TEST_CASE("A later offer replaces the one before, and brings only the shapes that are new") {
  OfferedBefore before;
  Reading reading;
  SceneOffer offer{.shapes = {{.shape = ball(0.1), .side = {}}, {.shape = ball(0.2), .side = {}}},
                   .apart = {{0, 1}}};
  reading.read(scene_of(offer, 2, before));
  offer.shapes[1].shape = ball(0.3);
  offer.apart.clear();
  CHECK(reading.read(scene_of(offer, 2, before)) == 1);
  CHECK(reading.store.scene() == 2);
  CHECK(reading.store.placements().size() == 2);
  CHECK(reading.store.shapes() == 2);
  CHECK_FALSE(reading.store.are_apart(0, 1));
  offer.shapes.resize(1);
  CHECK(reading.read(scene_of(offer, 2, before)) == 0);
  CHECK(reading.store.placements().size() == 1);
  offer.shapes.push_back({.shape = ball(0.3), .side = {}});  // The server has let it go.
  CHECK(reading.read(scene_of(offer, 2, before)) == 1);
}

TEST_CASE("An offer that a server would refuse names the shape and what is wrong") {
  SceneOffer offer{.shapes = std::vector<OfferedShape>(3, {.shape = ball(0.1), .side = {}})};
  std::vector<OfferedShape>& shapes = offer.shapes;
  const char* expected = "";
  SECTION("link") {
    shapes[1].side = {SideKind::kToolLink, 2};
    expected = "shape 1: placement 1 is on link 2 of the tool; it must be below 2";
  }
  SECTION("half space") {
    shapes[2] = {.shape = {.kind = SceneShapeKind::kHalfSpace},
                 .side = {SideKind::kMovableBody, 0}};
    expected = "shape 2: placement 2 is a half space of movable_body; it must be of the world";
  }
  SECTION("pair") {
    offer.apart = {{0, 3}};
    expected = "placement 3 is to be apart from another; it must be there";
  }
  SECTION("friction") {
    shapes[0].friction.coefficient = -11;
    expected = "shape 0: placement 0: friction -11 must be -10 to 10";
  }
  OfferedBefore before{.scene = 4};
  CHECK_THROWS_WITH(scene_of(offer, 2, before), expected);
  CHECK(before.scene == 4);
}

}  // namespace
}  // namespace hlm::protocol
