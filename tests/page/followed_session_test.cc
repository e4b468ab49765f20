// What a page is shown of another program's session, from what that tells.
#include "hlm/page/followed_session.h"

#include "hlm/protocol/scene_offer.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::ve {
namespace {

using page_wire::Kind;
using page_wire::Packet;
using protocol::SceneShapeKind;

struct Heard final : protocol::TelemetryObserver {
  void observe(const protocol::Ticks& /*ticks*/) override { ++ticks; }
  void observe(const protocol::LocalState& state) override { local = state; }
  int ticks = 0;
  protocol::LocalState local;
};

protocol::OfferedShape offered(SceneShapeKind kind, const Vector3& size, ContactSide side) {
  protocol::OfferedShape shape{.side = side};
  shape.shape.kind = kind;
  shape.shape.size = size;
  return shape;
}

/// A session with a free tool of 0.1 m.
struct Told {
  Told() {
    protocol::Hello hello;
    hello.nonce = 1;
    hello.tool.links.emplace_back().joint = JointType::kFree;
    hello.tool.length = 0.1;
    hello.q = Configuration::Zero(7);
    hello.q[2] = 0.3;
    hello.q[3] = 1;
    tell(hello);
  }

  template <class Message>
  void tell(const Message& message) {
    const std::uint64_t session = std::is_same_v<Message, protocol::Hello> ? 0 : 1;
    followed.take(page_wire::packet(message, {.session = session, .sequence = ++sequence}));
  }
  /// A ball as tool, a floor, and a box of body 7; or as many bytes less of that, and no end.
  void tell_scene(std::size_t missing = 0) {
    protocol::SceneOffer offer;
    offer.shapes = {offered(SceneShapeKind::kSphere, {0.02, 0, 0}, {SideKind::kToolLink, 0}),
                    offered(SceneShapeKind::kHalfSpace, {0, 0, 0}, {SideKind::kWorld, 0}),
                    offered(SceneShapeKind::kBox, {0.04, 0.08, 0.04}, {SideKind::kMovableBody, 7})};
    protocol::OfferedBefore nothing;
    const std::vector<std::uint8_t> records = protocol::scene_of(offer, 1, nothing);
    followed.take(page_wire::packet(Kind::kSceneBegin));
    const auto bytes = std::as_bytes(std::span(records));
    followed.take(page_wire::packet(Kind::kScene, bytes.first(bytes.size() - missing)));
    if (missing == 0) followed.take(page_wire::packet(Kind::kSceneEnd));
  }
  void tell_body_at(const Vector3& place) {
    protocol::ContactUpdate update;
    update.q_VE = Configuration::Zero(7);
    update.q_VE[0] = 0.5;
    update.q_VE[3] = 1;
    update.v_VE = Velocity::Zero(6);
    BodyPose& pose = update.poses.emplace_back();
    pose.body = 7;
    pose.X_WB.p = place;
    tell(update);
  }

  Heard heard;
  FollowedSession followed{heard};
  std::uint64_t sequence = 0;
};

TEST_CASE("Tool, world and bodies have the shapes that the session offered") {
  Told told;
  told.tell_scene();
  CHECK(told.followed.world_changed());
  const PageWorld world = told.followed.world();
  REQUIRE(world.bodies.size() == 2);
  CHECK(world.bodies[0].is_tool);
  CHECK(world.bodies[0].X_WB.p == Vector3(0, 0, 0.3));
  REQUIRE(world.bodies[0].shapes.size() == 1);
  CHECK(std::get<geometry::Sphere>(std::get<Shape>(world.bodies[0].shapes[0].geometry)).radius ==
        0.02);
  CHECK(world.bodies[1].fixed);
  REQUIRE(world.bodies[1].shapes.size() == 1);
  CHECK(std::holds_alternative<geometry::HalfSpace>(
      std::get<Shape>(world.bodies[1].shapes[0].geometry)));
  CHECK_FALSE(world.environment);
}

TEST_CASE("Of a scene that came in part nothing is left when it comes again") {
  Told told;
  told.tell_scene(10);
  told.tell_scene();
  const PageWorld world = told.followed.world();
  CHECK(world.bodies[0].shapes.size() == 1);
  CHECK(world.bodies[1].shapes.size() == 1);
}

TEST_CASE("A body is there once the session has said where, and then moves") {
  Told told;
  told.tell_scene();
  told.followed.world_changed();
  told.tell_body_at({0, 0.1, 0});
  CHECK(told.followed.world_changed());
  REQUIRE(told.followed.world().bodies.size() == 3);
  CHECK(told.followed.world().bodies[2].X_WB.p == Vector3(0, 0.1, 0));
  CHECK(told.followed.world().bodies[2].shapes.size() == 1);

  told.tell_body_at({0, 0.2, 0});
  CHECK_FALSE(told.followed.world_changed());
  const PageFrame frame = told.followed.frame();
  REQUIRE(frame.X_WB.size() == 2);  // The world is fixed.
  CHECK(frame.X_WB[0].p == Vector3(0.5, 0, 0));
  CHECK(frame.X_WB[1].p == Vector3(0, 0.2, 0));
}

TEST_CASE("Local contacts name bodies by their places on the page") {
  Told told;
  told.tell_scene();
  told.tell_body_at({0, 0.1, 0});
  protocol::LocalState state;
  for (const std::uint32_t body : {7u, 9u}) {
    protocol::LocalContactReport& contact = state.contacts.emplace_back();
    contact.a = {SideKind::kToolLink, 0};
    contact.b = {SideKind::kMovableBody, body};
    contact.n_W = Vector3::UnitZ();
  }
  told.tell(state);
  REQUIRE(told.heard.local.contacts.size() == 2);
  CHECK(told.heard.local.contacts[0].b == ContactSide{SideKind::kMovableBody, 2});
  CHECK(told.heard.local.contacts[1].b == ContactSide{});  // No page has such a body.
}

TEST_CASE("A session that offers no shapes has a ball of the tool's size") {
  const Told told;
  const PageWorld world = told.followed.world();
  REQUIRE(world.bodies.size() == 2);
  REQUIRE(world.bodies[0].shapes.size() == 1);
  CHECK(std::get<geometry::Sphere>(std::get<Shape>(world.bodies[0].shapes[0].geometry)).radius ==
        0.05);
  CHECK(world.bodies[1].shapes.empty());
}

TEST_CASE("Packets that are cut or changed are left out") {
  Told told;
  const std::uint64_t seed = test::random_seed();
  CAPTURE(seed);
  std::mt19937_64 engine(seed);
  protocol::ContactUpdate update;
  update.q_VE = Configuration::Zero(7);
  update.v_VE = Velocity::Zero(6);
  const Packet whole = page_wire::packet(update, {.session = 1, .sequence = 9});
  for (int i = 0; i < 20000; ++i) {
    Packet packet = whole;
    packet.resize(std::uniform_int_distribution<std::size_t>(0, whole.size())(engine));
    for (int changes = 0; changes < 3 && !packet.empty(); ++changes) {
      packet[std::uniform_int_distribution<std::size_t>(0, packet.size() - 1)(engine)] =
          static_cast<std::byte>(engine());
    }
    told.followed.take(packet);
  }
  CHECK(told.followed.world().bodies.size() >= 2);
}

}  // namespace
}  // namespace hlm::ve
