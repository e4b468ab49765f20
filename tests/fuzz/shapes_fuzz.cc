// Shapes and poses of any kind, as an engine's adapter or a client may give them: without an
// engine.
#include <cmath>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "hlm/client/shape_contacts.h"
#include "tests/fuzz/fuzz.h"

namespace hlm::fuzz {
namespace {

using namespace geometry;

constexpr double kLargest = 0.2;  // m: shapes are near each other.

/// Mostly a length of shapes and places that meet; now and then any number.
double length(Input& input) {
  const std::uint16_t word = input.u16();
  if (word % 251 == 0) return std::exp2(word % 2047 - 1023.0);
  if (word % 257 == 0) return std::nan("");
  return kLargest * (word / 65535.0);
}

Vector3 vector(Input& input) {
  Vector3 v;
  for (double& x : v) x = length(input) - kLargest / 2;
  return v;
}

std::vector<Vector3> points(Input& input, std::size_t most) {
  std::vector<Vector3> points(input.u8() % (most + 1));
  for (Vector3& point : points) point = vector(input);
  return points;
}

Mesh mesh(Input& input) {
  Mesh mesh;
  mesh.points = points(input, 12);
  const std::size_t count = mesh.points.empty() ? 0 : input.u8() % 24;
  for (std::size_t i = 0; i < count; ++i) {
    auto& triangle = mesh.triangles.emplace_back();
    for (int& corner : triangle) corner = static_cast<int>(input.u8() % mesh.points.size());
  }
  return mesh;
}

BodyShape shape(Input& input) {
  const std::uint8_t kind = input.u8();
  const ContactSide side{static_cast<SideKind>(kind / 8 % 3), kind / 24u % 3};
  const auto size = [&] { return length(input); };
  switch (kind % 8) {
    case 0:
      return {Sphere{size()}, side};
    case 1:
      return {Capsule{size(), size()}, side};
    case 2:
      return {Cylinder{size(), size()}, side};
    case 3:
      return {Box{vector(input).cwiseAbs()}, side};
    case 4:
      return {Ellipsoid{vector(input).cwiseAbs()}, side};
    case 5:
      return {Hull{points(input, 12)}, side};
    case 6:
      return {HalfSpace{}, side};
    default:
      return {mesh(input), side};
  }
}

Pose pose(Input& input) {
  const Vector3 axis = vector(input);
  const Vector3 p = vector(input);
  return {p, Quaternion(length(input), axis.x(), axis.y(), axis.z())};
}

void check(std::span<const ShapeContacts::Found> found, std::size_t shapes) {
  demand(found.size() <= kMaxContacts, "contacts fit an update");
  std::set<std::uint64_t> identities;
  for (const auto& [contact, a, b] : found) {
    demand(a < shapes && b < shapes, "shapes are those of the list");
    demand(contact.p_WC.allFinite() && std::isfinite(contact.separation), "a contact is finite");
    demand(std::abs(contact.n_W.norm() - 1) < 1e-6, "a normal is of unit length");
    demand(identities.insert(contact.identity).second, "identities are distinct");
  }
}

}  // namespace
}  // namespace hlm::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace hlm;
  using namespace hlm::fuzz;
  Input input(data, size);
  std::vector<BodyShape> shapes(1 + input.u8() % 6);
  for (BodyShape& one : shapes) one = shape(input);
  const std::size_t count = shapes.size();
  try {
    ShapeContacts contacts(std::move(shapes));
    std::vector<Pose> X_WS(count);
    for (Pose& X : X_WS) X = pose(input);
    for (int call = 0; call < 4; ++call) {
      check(contacts.find(X_WS, length(input)), count);
      X_WS[input.u8() % count] = pose(input);
    }
    ++accepted;
  } catch (const std::invalid_argument& error) {
    demand(is_one_line_about("shape ", error.what()), "an error is one line that names the shape");
  }
  return 0;
}
