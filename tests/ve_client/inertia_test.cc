// Mass, centre of mass and inertia that a link takes from its shapes.
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include <Eigen/Eigenvalues>

#include "hlm/geometry/hull.h"
#include "hlm/ve_client/scene/solid.h"
#include "tests/support/catch.h"
#include "tests/support/worlds.h"

namespace hlm::ve {
namespace {

using std::numbers::pi;
using Approx = Catch::Detail::Approx;

/// By 400,000 random points of a box around the origin with these half sides.
Solid sampled(const Vector3& half, const std::function<bool(const Vector3&)>& is_inside) {
  std::mt19937 engine(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  constexpr int kPoints = 400'000;
  int inside = 0;
  Vector3 first = Vector3::Zero();
  Matrix3 second = Matrix3::Zero();
  for (int i = 0; i < kPoints; ++i) {
    const Vector3 p = half.cwiseProduct(Vector3(unit(engine), unit(engine), unit(engine)));
    if (!is_inside(p)) continue;
    ++inside;
    first += p;
    second += p * p.transpose();
  }
  const double share = 8 * half.prod() / kPoints;
  const Vector3 centre = first / inside;
  second = share * (second - inside * centre * centre.transpose());
  return {share * inside, centre, second.trace() * Matrix3::Identity() - second};
}

/// To 1 %, which the samples are good for.
void check_equal(const Solid& found, const Solid& due) {
  CHECK(found.volume == Approx(due.volume).epsilon(0.01));
  CHECK((found.centre - due.centre).norm() < 0.01 * std::cbrt(due.volume));
  CHECK((found.moments - due.moments).norm() < 0.01 * due.moments.norm());
}

TEST_CASE("Volume and moments of each shape are those of points spread evenly in it") {
  const auto radius = [](const Vector3& p) { return p.head<2>().norm(); };
  check_equal(*solid_of(Sphere{0.2}),
              sampled(Vector3::Constant(0.2), [](const Vector3& p) { return p.norm() < 0.2; }));
  check_equal(*solid_of(Box{{0.1, 0.2, 0.4}}),
              sampled({0.05, 0.1, 0.2}, [](const Vector3&) { return true; }));
  check_equal(*solid_of(Cylinder{0.1, 0.5}),
              sampled({0.1, 0.1, 0.25}, [&](const Vector3& p) { return radius(p) < 0.1; }));
  check_equal(*solid_of(Capsule{0.1, 0.3}), sampled({0.1, 0.1, 0.25}, [&](const Vector3& p) {
    const double beyond = std::max(std::abs(p.z()) - 0.15, 0.0);
    return std::hypot(radius(p), beyond) < 0.1;
  }));
  const Vector3 radii(0.1, 0.2, 0.3);
  check_equal(*solid_of(Ellipsoid{radii}),
              sampled(radii, [&](const Vector3& p) { return p.cwiseQuotient(radii).norm() < 1; }));
  // A corner cut off a box: ∫x² = V a²/10 and ∫xy = V ab/20 about its tip.
  const Vector3 edges(0.3, 0.2, 0.1);
  const Solid corner =
      *solid_of(Hull{{Vector3::Zero(), {edges.x(), 0, 0}, {0, edges.y(), 0}, {0, 0, edges.z()}}});
  CHECK(corner.volume == Approx(edges.prod() / 6));
  CHECK(corner.centre.isApprox(edges / 4, 1e-9));
  const Matrix3 second =
      corner.volume * ((edges * edges.transpose() + Matrix3(edges.cwiseAbs2().asDiagonal())) / 20 -
                       edges * edges.transpose() / 16);
  CHECK(corner.moments.isApprox(second.trace() * Matrix3::Identity() - second, 1e-9));
  CHECK_FALSE(solid_of(HalfSpace{}));
}

TEST_CASE("Two halves that are put together are the whole, wherever they stand") {
  const Solid half = *solid_of(Box{{0.15, 0.2, 0.4}});
  const Quaternion R(Eigen::AngleAxisd(0.7, Vector3(1, 2, 3).normalized()));
  const Pose X{{3, -2, 1}, R};
  const auto at = [&](double x) {
    return moved(X * Pose{{x, 0, 0}, Quaternion::Identity()}, half);
  };
  const Solid whole = moved(X, *solid_of(Box{{0.3, 0.2, 0.4}}));
  const Solid both = together(at(-0.075), at(0.075));
  CHECK(both.volume == Approx(whole.volume));
  CHECK((both.centre - whole.centre).norm() < 1e-12);
  CHECK((both.moments - whole.moments).norm() < 1e-12 * whole.moments.norm());
}

TEST_CASE("A closed mesh is what it encloses, without its hollows, and an open one its box") {
  // A box of 2 x 2 x 1 m with a hollow of 1 x 1 x 1 m all through it, as four walls.
  Mesh mesh;
  const auto add = [&](const Vector3& a, const Vector3& b, const Vector3& c, const Vector3& d) {
    const auto first = static_cast<int>(mesh.points.size());
    for (const Vector3& p : {a, b, c, d}) mesh.points.push_back(p);
    mesh.triangles.push_back({first, first + 1, first + 2});
    mesh.triangles.push_back({first, first + 2, first + 3});
  };
  const Vector3 up = Vector3::UnitZ();
  for (int i = 0; i < 4; ++i) {
    const Quaternion R(Eigen::AngleAxisd(i * pi / 2, up));
    const Vector3 a = R * Vector3(1, -1, 0);
    const Vector3 b = R * Vector3(1, 1, 0);
    const auto round = [](const Vector3& p) { return Vector3(p.array().round()); };
    const auto inner = [&](const Vector3& p) { return Vector3(round(p) / 2); };
    add(round(a), round(b), round(b) + up, round(a) + up);
    add(inner(b), inner(a), inner(a) + up, inner(b) + up);
    add(round(a) + up, round(b) + up, inner(b) + up, inner(a) + up);
    add(round(b), round(a), inner(a), inner(b));
  }
  std::vector<std::string> repairs;
  const Mesh frame = repaired(mesh, "frame", repairs);
  REQUIRE(frame.closed);
  const Solid solid = solid_of(frame);
  CHECK(solid.volume == Approx(3));
  CHECK((solid.centre - Vector3(0, 0, 0.5)).norm() < 1e-12);
  CHECK(solid.moments(2, 2) == Approx(4 * (4 + 4) / 12.0 - (1 + 1) / 12.0));
  CHECK(solid.moments(0, 0) == Approx(4 * (4 + 1) / 12.0 - (1 + 1) / 12.0));

  Mesh sheet;
  sheet.points = {{0, 0, 0}, {2, 0, 0}, {2, 1, 0}};
  sheet.triangles = {{0, 1, 2}};
  const Solid plate = solid_of(repaired(sheet, "sheet", repairs));
  CHECK(plate.volume == Approx(2 * 1 * 1e-3));
  CHECK(plate.centre.isApprox(Vector3(1, 0.5, 0)));
}

const std::string kBar =
    "<collision name='a'><pose>0.35 0 0 0 0 0</pose><geometry><box><size>0.3 0.1 0.1</size></box>"
    "</geometry></collision><collision name='b'><pose>0.65 0 0 0 0 0</pose><geometry><box>"
    "<size>0.3 0.1 0.1</size></box></geometry></collision>";

BodyDescription bar_with(const std::string& inertial) {
  return test::world_of("<model name='m'><pose>0 0 1 0 0 0</pose><link name='l'>" + inertial +
                        kBar + "</link></model>")
      .bodies.at(0);
}

const Vector3 kBarMoments = Vector3(0.01 + 0.01, 0.36 + 0.01, 0.36 + 0.01) / 12;

TEST_CASE(
    "A link whose inertia no body has keeps its mass and its centre, and turns as its shapes") {
  for (const char* moments :
       {"<ixx>0</ixx><iyy>0</iyy><izz>0</izz>", "<ixx>1</ixx><iyy>1</iyy><izz>3</izz>",
        "<ixx>-1</ixx><iyy>1</iyy><izz>1</izz>", "<ixx>1e-9</ixx><iyy>1e-9</iyy><izz>1e-9</izz>",
        "<iyy>0.1</iyy><izz>0.1</izz>", ""}) {
    CAPTURE(moments);
    const BodyDescription body =
        bar_with("<inertial><pose>0.4 0 0 0 0 0</pose><mass>2</mass><inertia>" +
                 std::string(moments) + "</inertia></inertial>");
    CHECK(body.mass == 2);
    CHECK(body.X_WB.p.isApprox(Vector3(0.4, 0, 1)));
    CHECK(body.I_B.isApprox(Matrix3((2 * kBarMoments).asDiagonal()), 1e-9));
  }
}

TEST_CASE("A link whose mass is none, or of nothing, is of water, and its shapes stay in place") {
  for (const char* mass : {"0", "-1", "1e-7", "1e-10"}) {
    CAPTURE(mass);
    const BodyDescription body =
        bar_with("<inertial><mass>" + std::string(mass) +
                 "</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>");
    CHECK(body.mass == Approx(6));
    CHECK(body.X_WB.p.isApprox(Vector3(0.5, 0, 1)));
    CHECK(body.p_BS.isApprox(Vector3(-0.5, 0, 0)));
    CHECK(body.I_B.isApprox(Matrix3((6 * kBarMoments).asDiagonal()), 1e-9));
    CHECK((body.X_WB * body.collisions.at(0).X_BG).p.isApprox(Vector3(0.35, 0, 1)));
    CHECK((body.X_WB * body.collisions.at(1).X_BG).p.isApprox(Vector3(0.65, 0, 1)));
  }
}

TEST_CASE("A link without <inertial> has 1 kg, and the rest from its shapes") {
  const BodyDescription body = bar_with("");
  CHECK(body.mass == 1);
  CHECK(body.X_WB.p.isApprox(Vector3(0.5, 0, 1)));
  CHECK(body.I_B.isApprox(Matrix3(kBarMoments.asDiagonal()), 1e-9));
}

TEST_CASE("What a file says of mass and inertia is used as it stands where a body can have it") {
  const BodyDescription body = bar_with(
      "<inertial><pose>0.1 0 0 0 0 0</pose><mass>0.001</mass><inertia><ixx>1e-4</ixx>"
      "<iyy>2e-4</iyy><izz>2.5e-4</izz></inertia></inertial>");
  CHECK(body.mass == 0.001);
  CHECK(body.X_WB.p.isApprox(Vector3(0.1, 0, 1)));
  CHECK(body.I_B.isApprox(Matrix3(Vector3(1e-4, 2e-4, 2.5e-4).asDiagonal()), 1e-12));
}

}  // namespace
}  // namespace hlm::ve
