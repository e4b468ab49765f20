// What haptic_doctor concludes from movements and pushes, on movements and pushes that are known.
#include <cmath>
#include <numbers>

#include "hlm/haptic_server/device/simulated_device.h"
#include "hlm/tools/doctor/frame_fit.h"
#include "hlm/tools/doctor/push_fit.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::server {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

/// 5 cm along each of the first axes of the world, as a device whose frame is R_WB reports them
/// when the hand is off by up to `tremor` m in each direction.
std::vector<ToldMove> moves_of(const Matrix3& R_WB, int axes, double tremor, test::Random& random) {
  std::vector<ToldMove> moves;
  for (int i = 0; i < axes; ++i) {
    const Vector3 told = Vector3::Unit(i);
    moves.push_back({told, R_WB.transpose() * (0.05 * told + random.vector(tremor))});
  }
  return moves;
}

TEST_CASE(
    "Each of the 24 frames along the axes is named as its key takes it, with a hand off by 5°") {
  test::Random random;
  const std::array<Vector3, 6> axes{Vector3::UnitX(),  Vector3::UnitY(),  Vector3::UnitZ(),
                                    -Vector3::UnitX(), -Vector3::UnitY(), -Vector3::UnitZ()};
  const std::array<std::string, 6> names{"x", "y", "z", "-x", "-y", "-z"};
  int frames = 0;
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < 6; ++j) {
      const Vector3 third = axes[i].cross(axes[j]);
      if (third.isZero()) continue;
      ++frames;
      const auto k =
          static_cast<std::size_t>(std::find(axes.begin(), axes.end(), third) - axes.begin());
      Matrix3 R;
      R << axes[i], axes[j], third;
      for (const int count : {2, 3}) {
        const auto moves = moves_of(R, count, 0.003, random);
        CHECK_FALSE(mirrors(moves));
        const auto fit = fit_frame(moves);
        REQUIRE(fit);
        CHECK(fit->deviation < 10 * kDegree);
        CHECK(frame_text(fit->R_WB) == names[i] + ' ' + names[j] + ' ' + names[k]);
      }
    }
  }
  CHECK(frames == 24);
}

TEST_CASE("A device that stands askew is named by its angles, within 5°") {
  test::Random random;
  const Matrix3 R = (Eigen::AngleAxisd(40 * kDegree, Vector3::UnitZ()) *
                     Eigen::AngleAxisd(-35 * kDegree, Vector3::UnitY()) *
                     Eigen::AngleAxisd(45 * kDegree, Vector3::UnitX()))
                        .toRotationMatrix();
  const auto fit = fit_frame(moves_of(R, 3, 1e-3, random));
  REQUIRE(fit);
  CHECK(angle_between(fit->R_WB, R) < 3 * kDegree);
  CHECK(frame_text(R) == "45 -35 40");
}

TEST_CASE(
    "A mirror is one, however it is turned, and two movements of one direction tell nothing") {
  test::Random random;
  for (int i = 0; i < 20; ++i) {
    Matrix3 mirror = random.rotation().toRotationMatrix();
    mirror.col(i % 3) *= -1;
    CHECK(mirrors(moves_of(mirror, 3, 0.003, random)));
  }
  CHECK_FALSE(
      fit_frame({{Vector3::UnitX(), Vector3::UnitX()}, {Vector3::UnitY(), Vector3::UnitX()}}));
  CHECK_FALSE(fit_frame({{Vector3::UnitX(), Vector3::UnitX()}}));
}

/// A push of `force` N along x for 0.1 s on a simulated handle that nobody holds, seen for 0.4 s.
std::vector<HandleSample> pushed(const SimulatedDeviceOptions& options, double force) {
  constexpr double kPeriod = 1e-3;  // s
  SimulatedDevice device(options, {}, kPeriod);
  device.enable();
  std::vector<HandleSample> samples;
  for (int tick = 0; tick < 400; ++tick) {
    HandleSample sample;
    sample.time = kPeriod * tick;
    sample.p = device.read()->X_WD.p;
    if (tick >= 20 && tick < 120) sample.force.x() = force;
    samples.push_back(sample);
    Wrench F = Wrench::Zero();
    F.head<3>() = sample.force;
    device.write(F);
  }
  return samples;
}

TEST_CASE("A push tells mass and friction within 5 %, damping within 10 %, delay within 0.5 ms") {
  SimulatedDeviceOptions options;
  options.mass = GENERATE(0.1, 0.5, 2.0);     // kg
  options.dry_friction = GENERATE(0.0, 0.1);  // N
  options.damping = GENERATE(2.0, 8.0);       // N·s/m
  options.delay = GENERATE(0, 7, 40);         // ms
  INFO(options.mass << " kg, " << options.dry_friction << " N, " << options.damping << " N·s/m, "
                    << options.delay << " ms");
  const double force = 0.6;  // N
  const auto fit = fit_push(pushed(options, force), Vector3::UnitX());
  REQUIRE(fit);
  CHECK(fit->unexplained < 0.01);
  CHECK(fit->mass == Approx(options.mass).epsilon(0.05));
  CHECK(fit->friction == Approx(options.dry_friction).margin(0.005));
  CHECK(fit->damping == Approx(options.damping).epsilon(0.1));
  CHECK(1e3 * fit->delay == Approx(options.delay).margin(0.5));
}

TEST_CASE("With encoder steps of 0.02 mm mass is found within 10 % and delay within 2 ms") {
  SimulatedDeviceOptions options{.mass = 0.3, .damping = 2, .dry_friction = 0.05};
  options.position_step = 2e-5;  // m
  options.delay = 3;             // ms
  const auto fit = fit_push(pushed(options, 0.6), Vector3::UnitX());
  REQUIRE(fit);
  CHECK(fit->mass == Approx(0.3).epsilon(0.1));
  CHECK(1e3 * fit->delay == Approx(3).margin(2));
}

TEST_CASE("A handle that does not move, or goes the other way, gives no fit") {
  SimulatedDeviceOptions options;
  options.dry_friction = 1;  // N
  CHECK_FALSE(fit_push(pushed(options, 0.6), Vector3::UnitX()));
  options.dry_friction = 0;
  CHECK_FALSE(fit_push(pushed(options, 0.6), -Vector3::UnitX()));
}

}  // namespace
}  // namespace hlm::server
