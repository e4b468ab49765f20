// A scene names the sides that touch, and leaves out what never touches.
#include "hlm/haptic_server/scene/scene.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>

#include "tests/support/catch.h"
#include "tests/support/no_malloc.h"
#include "tests/support/placed_shape.h"
#include "tests/support/random.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

using Catch::Matchers::ContainsSubstring;
using geometry::AnyShape;
using geometry::FoundContact;
using test::placed;

constexpr double kEpsilon = 0.01;  // m
constexpr ContactSide kWorld{SideKind::kWorld, 0};
constexpr ContactSide kTool{SideKind::kToolLink, 0};
constexpr ContactSide kBody{SideKind::kMovableBody, 7};

Pose at(double x, double y = 0, double z = 0) { return {{x, y, z}, Quaternion::Identity()}; }

/// With a radius or half an edge of 0.1 m.
AnyShape ball() { return geometry::Shape(geometry::Sphere{0.1}); }
AnyShape box() { return geometry::Shape(geometry::Box{Vector3::Constant(0.2)}); }
AnyShape half_space() { return geometry::Shape(geometry::HalfSpace{}); }
AnyShape skin() {
  geometry::Mesh mesh;
  mesh.points = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, 0.2}, {0.5, 0.5, 1}};
  // A tent with a dent in its floor.
  mesh.triangles = {{0, 1, 5}, {1, 2, 5}, {2, 3, 5}, {3, 0, 5},
                    {1, 0, 4}, {2, 1, 4}, {3, 2, 4}, {0, 3, 4}};
  return mesh;
}

ToolDescription tool_of(int links) {
  ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  for (int i = 1; i < links; ++i) {
    Link link = tool.links[0];
    link.parent = i - 1;
    link.joint = JointType::kRevolute;
    tool.links.push_back(link);
  }
  return tool;
}

/// Each with the shapes in that order.
struct Touching {
  std::vector<PlacedShape> shapes = {};
  std::vector<std::pair<std::uint32_t, std::uint32_t>> apart = {};
  int links = 1;

  std::unique_ptr<Scene> scene() const {
    return std::make_unique<Scene>(shapes, apart, tool_of(links));
  }
  /// With links and body at the origin.
  bool tool_touches() const {
    const auto made = scene();
    for (int link = 0; link < links; ++link) {
      made->place({SideKind::kToolLink, static_cast<std::uint32_t>(link)}, Pose{});
    }
    made->place(kBody, Pose{});
    return !made->of_tool(kEpsilon).empty();
  }
};

/// A ball of the tool 5 mm before one of the world.
Touching ball_before_ball() { return {{placed(ball(), kWorld, at(0.205)), placed(ball(), kTool)}}; }

TEST_CASE("A contact of the tool names its link, then what it touches, and points to the link") {
  const ContactSide other = GENERATE(kWorld, kBody);
  const Touching touching{{placed(ball(), other, at(0.205)), placed(ball(), kTool)}};
  const auto scene = touching.scene();
  scene->place(kTool, Pose{});
  scene->place(kBody, Pose{});
  const auto found = scene->of_tool(kEpsilon);
  REQUIRE(found.size() == 1);
  CHECK(found[0].key.a == kTool);
  CHECK(found[0].key.b == other);
  CHECK(found[0].n_W.x() == Approx(-1));
  CHECK(found[0].separation == Approx(0.005).margin(1e-9));
}

TEST_CASE("What is further away than epsilon is not found, and what came nearer is") {
  const auto scene = ball_before_ball().scene();
  scene->place(kTool, at(-0.006));
  CHECK(scene->of_tool(kEpsilon).empty());
  scene->forget();
  scene->place(kTool, at(-0.004));
  CHECK(scene->of_tool(kEpsilon).size() == 1);
}

TEST_CASE("A body's contacts are those with all except the tool, and name the body first") {
  const ContactSide other{SideKind::kMovableBody, 3};
  const Touching touching{{placed(ball(), kTool, at(0, 0.205)), placed(ball(), kBody),
                           placed(ball(), kWorld, at(0.205)), placed(ball(), other, at(-0.205))}};
  const auto scene = touching.scene();
  for (const ContactSide& side : {kTool, kBody, other}) scene->place(side, Pose{});
  const auto found = scene->of_body(kBody.index, kEpsilon);
  REQUIRE(found.size() == 2);
  for (const FoundContact& contact : found) {
    CHECK(contact.key.a == kBody);
    CHECK(contact.key.b == (contact.n_W.x() < 0 ? kWorld : other));
  }
  CHECK(scene->of_tool(kEpsilon).size() == 1);
  CHECK(scene->of_body(99, kEpsilon).empty());
}

TEST_CASE("Two shapes touch if a group of either is in the other's mask") {
  struct Case {
    std::uint32_t group, mask, other_group, other_mask;
    bool touches;
  };
  const Case of =
      GENERATE(Case{1, 1, 1, 1, true}, Case{1, 2, 1, 2, false}, Case{1, 2, 2, 4, true},
               Case{2, 4, 1, 2, true}, Case{4, 0, 2, 0, false}, Case{0, ~0u, 1, 0, true},
               Case{0, ~0u, 0, ~0u, false}, Case{1u << 31, 0, 1, 1u << 31, true});
  Touching touching = ball_before_ball();
  touching.shapes[0].group = of.group;
  touching.shapes[0].mask = of.mask;
  touching.shapes[1].group = of.other_group;
  touching.shapes[1].mask = of.other_mask;
  INFO(of.group << ' ' << of.mask << ' ' << of.other_group << ' ' << of.other_mask);
  CHECK(touching.tool_touches() == of.touches);
}

TEST_CASE("Two coefficients of friction make that of the contact by their engine's rule") {
  using Rule = FrictionRule;
  struct Case {
    Friction one, other;
    double due;
  };
  const Case of =
      GENERATE(Case{{0.2}, {0.6}, 0.2}, Case{{0.2, Rule::kAverage}, {0.6, Rule::kAverage}, 0.4},
               Case{{0.2, Rule::kAverage}, {0.6}, 0.2}, Case{{0.2}, {0.6, Rule::kProduct}, 0.12},
               Case{{0.2, Rule::kMaximum}, {0.6, Rule::kProduct}, 0.6},
               Case{{0.2, Rule::kMaximum, 1}, {0.6, Rule::kMaximum}, 0.2},
               Case{{0.2}, {-1, Rule::kMaximum, 9}, 0.2}, Case{{-1}, {-1}, -1});
  Touching touching = ball_before_ball();
  touching.shapes[0].friction = of.one;
  touching.shapes[1].friction = of.other;
  const auto scene = touching.scene();
  scene->place(kTool, Pose{});
  const auto found = scene->of_tool(kEpsilon);
  REQUIRE(found.size() == 1);
  CHECK(found[0].friction == Approx(of.due));
}

TEST_CASE("A pair that is apart never touches, in whatever order it is named, and others do") {
  Touching touching = ball_before_ball();
  touching.shapes.push_back(placed(ball(), kWorld, at(-0.205)));
  CHECK(touching.scene()->shapes() == 3);
  touching.apart = {{1, 0}};
  CHECK(touching.tool_touches());
  touching.apart = {{1, 0}, {1, 2}};
  CHECK_FALSE(touching.tool_touches());
  touching.apart = {{2, 1}, {0, 1}};
  CHECK_FALSE(touching.tool_touches());
  touching.apart = {{0, 2}};
  CHECK(touching.tool_touches());
}

TEST_CASE("Links that a joint connects do not touch each other, and the next but one does") {
  const auto on_link = [](std::uint32_t link, const Pose& X_BS) {
    return placed(ball(), {SideKind::kToolLink, link}, X_BS);
  };
  CHECK_FALSE(Touching{{on_link(0, {}), on_link(1, at(0.205))}, {}, 3}.tool_touches());
  CHECK_FALSE(Touching{{on_link(1, {}), on_link(2, at(0.205))}, {}, 3}.tool_touches());
  CHECK(Touching{{on_link(0, {}), on_link(2, at(0.205))}, {}, 3}.tool_touches());
  CHECK_FALSE(Touching{{on_link(0, {}), on_link(0, at(0.205))}, {}, 3}.tool_touches());
  // Each such pair is found once: of the link behind.
  const Touching touching{{on_link(0, {}), on_link(2, at(0.205))}, {}, 3};
  const auto scene = touching.scene();
  for (std::uint32_t link : {0u, 2u}) scene->place({SideKind::kToolLink, link}, Pose{});
  const auto found = scene->of_tool(kEpsilon);
  REQUIRE(found.size() == 1);
  CHECK(found[0].key.a == ContactSide{SideKind::kToolLink, 2});
  CHECK(found[0].key.b == kTool);
}

TEST_CASE("What has no pose touches nothing until it has one, and no more when it is gone") {
  const Touching touching{{placed(ball(), kBody, at(0.205)), placed(ball(), kTool)}};
  const auto scene = touching.scene();
  const auto count = [&] {
    scene->forget();
    return scene->of_tool(kEpsilon).size() + scene->of_body(kBody.index, kEpsilon).size();
  };
  CHECK(count() == 0);
  scene->place(kTool, Pose{});
  CHECK(count() == 0);
  scene->place(kBody, Pose{});
  CHECK(count() == 1);
  scene->place(kBody, std::nullopt);
  CHECK(count() == 0);
  scene->place(kBody, Pose{});
  scene->place(kTool, std::nullopt);
  CHECK(count() == 0);
}

TEST_CASE("The world stays where it is, and sides without shapes do no harm") {
  const auto scene = ball_before_ball().scene();
  scene->place(kTool, Pose{});
  scene->place(kWorld, at(5));
  scene->place(kWorld, std::nullopt);
  scene->place({SideKind::kMovableBody, 99}, at(1));
  scene->place({SideKind::kToolLink, 15}, std::nullopt);
  CHECK(scene->of_tool(kEpsilon).size() == 1);
}

TEST_CASE("A scene without shapes, or without any of the tool, has no contacts") {
  CHECK_FALSE(Touching{}.tool_touches());
  CHECK_FALSE(Touching{{placed(box(), kWorld)}}.tool_touches());
  CHECK_FALSE(Touching{{placed(box(), kTool)}}.tool_touches());
}

TEST_CASE("A link's reach is that of its furthest shape, and 0 of what has none") {
  const Touching touching{{placed(ball(), kTool), placed(ball(), kTool, at(0, 2))}};
  const auto scene = touching.scene();
  CHECK(scene->reach(kTool) >= 2.1);
  CHECK(scene->reach(kTool) < 2.2);
  CHECK(scene->reach(kBody) == 0);
}

TEST_CASE("Contacts of several searches stay until they are forgotten") {
  const Touching touching{
      {placed(ball(), kTool), placed(ball(), kBody, at(0.205)), placed(ball(), kWorld, at(0.41))}};
  const auto scene = touching.scene();
  scene->place(kTool, Pose{});
  scene->place(kBody, Pose{});
  const auto of_tool = scene->of_tool(kEpsilon);
  const auto of_body = scene->of_body(kBody.index, kEpsilon);
  REQUIRE(of_tool.size() == 1);
  REQUIRE(of_body.size() == 1);
  CHECK(of_tool[0].key.a == kTool);
  CHECK(of_body[0].key.a == kBody);
}

TEST_CASE("More contacts than can be told are the most telling, and bodies beyond find none") {
  std::vector<PlacedShape> shapes;
  for (int i = 0; i < 100; ++i) {
    const double x = 0.3 * (i % 10);
    const double y = 0.3 * (i / 10);
    shapes.push_back(placed(ball(), kTool, at(x, y, 0.2)));
    shapes.push_back(placed(ball(), kBody, at(x, y, 0.2)));
    shapes.push_back(placed(ball(), kWorld, at(x, y)));
  }
  const Touching touching{shapes};
  const auto scene = touching.scene();
  scene->place(kTool, Pose{});
  scene->place(kBody, Pose{});
  const auto tells_most = [](std::size_t count) {
    return count <= geometry::kMaxSelected && count >= geometry::kMaxSelected / 4;
  };
  CHECK(tells_most(scene->of_tool(kEpsilon).size()));
  for (std::size_t i = 0; i < kMaxMovedBodies; ++i) {
    CHECK(tells_most(scene->of_body(kBody.index, kEpsilon).size()));
  }
  for (int i = 0; i < 100; ++i) scene->of_body(kBody.index, kEpsilon);
  CHECK(scene->of_body(kBody.index, kEpsilon).empty());
  scene->forget();
  CHECK_FALSE(scene->of_body(kBody.index, kEpsilon).empty());
}

/// A box of 1 x 2 x 3 m that is cut along its axes at random, each part at its place, in any order.
std::vector<PlacedShape> cut_box(test::Random& random, const Pose& X_WB) {
  const Vector3 size(1, 2, 3);
  std::array<std::vector<double>, 3> cuts;
  for (int axis = 0; axis < 3; ++axis) {
    auto& at = cuts[static_cast<std::size_t>(axis)];
    at = {-size[axis] / 2, size[axis] / 2};
    for (int i = random.integer(0, 4); i > 0; --i) at.push_back(random.uniform(at[0], at[1]));
    std::ranges::sort(at);
  }
  std::vector<PlacedShape> parts;
  for (std::size_t i = 1; i < cuts[0].size(); ++i) {
    for (std::size_t j = 1; j < cuts[1].size(); ++j) {
      for (std::size_t k = 1; k < cuts[2].size(); ++k) {
        const Vector3 from(cuts[0][i - 1], cuts[1][j - 1], cuts[2][k - 1]);
        const Vector3 to(cuts[0][i], cuts[1][j], cuts[2][k]);
        const AnyShape part = geometry::Shape(geometry::Box{to - from});
        parts.push_back(placed(part, kWorld, {X_WB * Vector3((from + to) / 2), X_WB.R}));
      }
    }
  }
  std::ranges::shuffle(parts, random.engine());
  return parts;
}

TEST_CASE("Boxes that make one box together are one, wherever it lies and however it is cut") {
  test::Random random;
  for (int i = 0; i < 50; ++i) {
    const Pose X_WB = random.pose(1);
    const Touching touching{cut_box(random, X_WB)};
    INFO(touching.shapes.size() << " parts");
    const auto scene = touching.scene();
    CHECK(scene->pieces() == 1);
    CHECK(scene->shapes() == touching.shapes.size());
    Touching with_tool = touching;
    with_tool.shapes.push_back(placed(ball(), kTool));
    const auto touched = with_tool.scene();
    touched->place(kTool, X_WB * at(random.uniform(-0.4, 0.4), random.uniform(-0.8, 0.8), 1.595));
    const auto found = touched->of_tool(kEpsilon);
    REQUIRE(found.size() == 1);
    CHECK(found[0].separation == Approx(-0.005).margin(1e-9));
    CHECK((found[0].n_W - X_WB.R * Vector3::UnitZ()).norm() < 1e-9);
  }
}

TEST_CASE("Boxes stay apart that differ in more than their place, or leave a gap or a step") {
  const PlacedShape first = placed(box(), kWorld);
  const auto pieces = [&](PlacedShape other,
                          std::vector<std::pair<unsigned, unsigned>> apart = {}) {
    return Touching{{first, std::move(other)}, std::move(apart)}.scene()->pieces();
  };
  PlacedShape other = placed(box(), kWorld, at(0.2));
  CHECK(pieces(other) == 1);
  CHECK(pieces(placed(box(), kWorld, at(0.1))) == 1);
  CHECK(pieces(first) == 1);
  CHECK(pieces(placed(box(), kWorld, at(0.20001))) == 2);
  CHECK(pieces(placed(box(), kWorld, at(0.2, 0, 1e-5))) == 2);
  CHECK(pieces(placed(box(), kBody, at(0.2))) == 2);
  CHECK(pieces(placed(ball(), kWorld, at(0.2))) == 2);
  CHECK(pieces(other, {{0, 1}}) == 2);
  other.friction = {0.3};
  CHECK(pieces(other) == 2);
  other = placed(box(), kWorld, at(0.2));
  other.group = 2;
  CHECK(pieces(other) == 2);
  other = placed(box(), kWorld, at(0.2));
  other.mask = 1;
  CHECK(pieces(other) == 2);
}

TEST_CASE("Placing and finding allocate nothing") {
  const Touching touching{{placed(box(), kTool), placed(box(), kBody, at(0.205)),
                           placed(skin(), kWorld, at(0.1, 0.1, -1.1)),
                           placed(half_space(), kWorld, at(0, 0, -0.105))}};
  const auto scene = touching.scene();
  const test::NoMalloc guard;
  std::size_t found = 0;
  for (int i = 0; i < 50; ++i) {
    scene->place(kTool, at(0, 1e-4 * i));
    scene->place(kBody, i % 10 == 9 ? std::nullopt : std::optional(at(0, 0, 1e-4 * i)));
    scene->forget();
    found += scene->of_tool(kEpsilon).size();
    found += scene->of_body(kBody.index, kEpsilon).size();
  }
  CHECK(guard.allocations() == 0);
  CHECK(found > 200);
}

TEST_CASE("Shapes that cannot be where they are said to be are refused") {
  const ToolDescription tool = tool_of(2);
  const auto why = [&](const PlacedShape& shape) -> std::string {
    try {
      require_place(shape, tool);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  CHECK(why(placed(half_space(), kBody)) == "a half-space must be the world's");
  CHECK(why(placed(half_space(), kTool)) == "a half-space must be the world's");
  CHECK(why(placed(ball(), {SideKind::kToolLink, 2})) == "link 2 must be one of the tool's 2");
  CHECK_THAT(why(placed(skin(), kTool)), ContainsSubstring("must be convex"));
  CHECK(why(placed(half_space(), kWorld)).empty());
  CHECK(why(placed(skin(), kWorld)).empty());
  CHECK(why(placed(skin(), kBody)).empty());
  CHECK(why(placed(ball(), {SideKind::kToolLink, 1})).empty());
}

}  // namespace
}  // namespace hlm::server
