// What the motion of bodies tells of their friction.
#include "hlm/haptic_server/local_model/body_friction.h"

#include "tests/support/catch.h"

namespace hlm::server {
namespace {

constexpr double kMass = 0.375;   // kg
constexpr double kWeight = 3.68;  // N
constexpr double kAhead = 0.9;
constexpr double kFrame = 0.02;  // s

/// A brick of friction 0.4 that slides along x at 50 mm/s, on the world.
struct Sliding {
  MovableBody reported;
  ReportedContacts contacts;

  Sliding() {
    reported.W.diagonal() << Vector3::Constant(1 / kMass), Vector3::Constant(1 / 1e-3);
    reported.V_W[0] = 0.05;
    for (std::uint64_t i = 0; i < 4; ++i) {
      ReportedContact& contact = contacts.emplace_back();
      contact.identity = i;
      contact.a = {SideKind::kMovableBody, 0};
      contact.p_WC = {i & 1 ? 0.05 : -0.05, i & 2 ? 0.05 : -0.05, -0.025};
      contact.load = kWeight / 4;
      contact.friction = 0.4;
    }
  }

  /// The scale after some updates that found the velocity wrong as friction of `truth` times the
  /// reported would make it.
  double learnt(double truth, int updates = 50) const {
    LocalBody body(reported);
    for (int i = 0; i < updates; ++i) {
      const double slowing = 0.4 * kWeight / kMass;
      body.correction_steps = 1;
      body.correction[0] = -slowing * kFrame * (truth - kAhead * body.friction_scale);
      learn_friction(body, body.X_WB, reported.V_W,
                     {.contacts = contacts,
                      .kinetic_friction = 0.3,
                      .ahead = kAhead,
                      .elapsed = kFrame,
                      .late = kFrame});
    }
    return body.friction_scale;
  }
};

TEST_CASE("Friction of a sliding body is learnt within a fifth of a second") {
  const Sliding brick;
  for (const double truth : {0.7, 0.85, 1.0, 1.15}) {
    CHECK(brick.learnt(truth, 10) == Approx(truth).margin(0.02));
    CHECK(brick.learnt(truth) == Approx(truth).margin(1e-3));
  }
}

TEST_CASE("A belt that drives the body tells of friction as the floor does") {
  Sliding brick;
  for (ReportedContact& contact : brick.contacts) contact.v_WC[0] = 0.2;  // m/s
  // The force is the other way, and so is what it does to the velocity.
  LocalBody body(brick.reported);
  for (int i = 0; i < 50; ++i) {
    body.correction_steps = 1;
    body.correction[0] = 0.4 * kWeight / kMass * kFrame * (1.1 - kAhead * body.friction_scale);
    learn_friction(body, body.X_WB, brick.reported.V_W,
                   {.contacts = brick.contacts,
                    .kinetic_friction = 0.3,
                    .ahead = kAhead,
                    .elapsed = kFrame,
                    .late = 0});
  }
  CHECK(body.friction_scale == Approx(1.1).margin(1e-3));
}

TEST_CASE("Bodies that are carried, roll, carry others or stand tell nothing of their friction") {
  Sliding brick;
  SECTION("on a platform that moves along") {
    for (ReportedContact& contact : brick.contacts) contact.v_WC = brick.reported.V_W.head<3>();
  }
  SECTION("on a platform that rises") {
    brick.reported.V_W << 0, 0, 0.05, 0, 0, 0;
    for (ReportedContact& contact : brick.contacts) contact.v_WC[2] = 0.05;
  }
  SECTION("rolling") {
    brick.contacts.resize(1);
    brick.contacts[0].p_WC = {0, 0, -0.025};
    brick.reported.V_W << 0.05, 0, 0, 0, 2, 0;
  }
  SECTION("with another on top") {
    ReportedContact& contact = brick.contacts.emplace_back(brick.contacts[0]);
    contact.a.index = 1;
    contact.b = {SideKind::kMovableBody, 0};
  }
  SECTION("on another") {
    for (ReportedContact& contact : brick.contacts) contact.b = {SideKind::kMovableBody, 1};
  }
  SECTION("standing") { brick.reported.V_W.setZero(); }
  SECTION("floating") { brick.contacts.clear(); }
  CHECK(brick.learnt(0.5) == 1);
  CHECK(brick.learnt(1.5) == 1);
}

}  // namespace
}  // namespace hlm::server
