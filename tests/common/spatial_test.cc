#include "hlm/common/spatial.h"

#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm {
namespace {

TEST_CASE("A pose times its inverse is the identity") {
  test::Random random;
  for (int i = 0; i < 100; ++i) {
    const Pose X_AB = random.pose(1.0);
    const Pose identity = X_AB * X_AB.inverse();
    CHECK(identity.p.norm() < 1e-14);
    CHECK(rotation_vector(identity.R).norm() < 1e-14);
  }
}

TEST_CASE("Rotation vectors come back, from none at all to half a turn") {
  test::Random random;
  for (const double angle : {0.0, 1e-15, 1e-10, 1e-8, 1e-3, 1.0, 3.0, 3.14159}) {
    const Vector3 r = angle * random.direction();
    CHECK((rotation_vector(rotation_from_vector(r)) - r).norm() <= 1e-9 * angle);
  }
}

TEST_CASE("A rotation vector takes the shorter way round") {
  Quaternion R = rotation_from_vector(Vector3(0, 0, 0.1));
  R.coeffs() = -R.coeffs();
  CHECK((rotation_vector(R) - Vector3(0, 0, 0.1)).norm() < 1e-12);
}

TEST_CASE("A displacement moves one pose onto the other") {
  test::Random random;
  for (int i = 0; i < 100; ++i) {
    const Pose X_WA = random.pose(1.0);
    const Pose X_WB = random.pose(1.0);
    const Vector6 e = displacement(X_WA, X_WB);
    CHECK((X_WA.p + e.head<3>() - X_WB.p).norm() < 1e-14);
    const Quaternion R = rotation_from_vector(e.tail<3>()) * X_WA.R;
    CHECK(R.angularDistance(X_WB.R) < 1e-7);
  }
}

}  // namespace
}  // namespace hlm
