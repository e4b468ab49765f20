#include "ve_client/world/sdf_geometry.h"

#include <stdexcept>

#include <sdf/Box.hh>
#include <sdf/Capsule.hh>
#include <sdf/Cylinder.hh>
#include <sdf/Element.hh>
#include <sdf/Geometry.hh>
#include <sdf/Plane.hh>
#include <sdf/Sphere.hh>

#include "common/range.h"
#include "ve_client/world/sdf_messages.h"
#include "ve_client/world/sdf_places.h"

namespace hlm::ve {
namespace {

/// Throws std::runtime_error, for to_collision() to report.
double positive_size(double value, const std::string& what) {
  if (const auto error = find_error(what, value, above_zero("m"))) throw std::runtime_error(*error);
  return value;
}

Shape to_shape(const sdf::Geometry& geometry) {
  switch (geometry.Type()) {
    case sdf::GeometryType::SPHERE:
      return Sphere{positive_size(geometry.SphereShape()->Radius(), "radius")};
    case sdf::GeometryType::CAPSULE:
      return Capsule{positive_size(geometry.CapsuleShape()->Radius(), "radius"),
                     positive_size(geometry.CapsuleShape()->Length(), "length")};
    case sdf::GeometryType::CYLINDER:
      return Cylinder{positive_size(geometry.CylinderShape()->Radius(), "radius"),
                      positive_size(geometry.CylinderShape()->Length(), "length")};
    case sdf::GeometryType::BOX: {
      const ignition::math::Vector3d size = geometry.BoxShape()->Size();
      return Box{{positive_size(size.X(), "size x"), positive_size(size.Y(), "size y"),
                  positive_size(size.Z(), "size z")}};
    }
    case sdf::GeometryType::PLANE:
      return HalfSpace{};
    default:
      throw std::runtime_error("no geometry; allowed: box, sphere, cylinder, capsule, plane");
  }
}

std::optional<double> friction_of(const sdf::Collision& collision) {
  sdf::ElementPtr element = collision.Element();
  for (const char* child : {"surface", "friction", "ode", "mu"}) {
    if (!element->HasElement(child)) return std::nullopt;
    element = element->GetElement(child);
  }
  const auto mu = element->Get<double>();
  const auto error = find_error("friction mu", mu, from_zero(""));
  if (error) throw std::runtime_error(*error);
  return mu;
}

}  // namespace

Vector3 to_vector(const ignition::math::Vector3d& v) { return {v.X(), v.Y(), v.Z()}; }

Matrix3 to_matrix(const ignition::math::Matrix3d& m) {
  Matrix3 result;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      result(row, column) = m(static_cast<std::size_t>(row), static_cast<std::size_t>(column));
    }
  }
  return result;
}

Pose to_pose(const ignition::math::Pose3d& pose) {
  const ignition::math::Quaterniond& R = pose.Rot();
  return {to_vector(pose.Pos()), Quaternion(R.W(), R.X(), R.Y(), R.Z()).normalized()};
}

std::optional<CollisionDescription> to_collision(const sdf::Collision& collision,
                                                 const Vector3& p_BS, Diagnostics& diagnostics) {
  try {
    ignition::math::Pose3d X_SG;
    const sdf::Errors errors = collision.SemanticPose().Resolve(X_SG);
    if (diagnostics.usable()) require_none(errors);  // Otherwise the cause is reported already.
    CollisionDescription result;
    result.name = collision.Name();
    result.shape = to_shape(*collision.Geom());
    result.friction = friction_of(collision);
    result.X_BG = Pose{p_BS, Quaternion::Identity()} * to_pose(X_SG);
    if (const sdf::Plane* plane = collision.Geom()->PlaneShape()) {
      if (!(plane->Normal().Length() > 0)) throw std::runtime_error("normal must not be 0 0 0");
      result.X_BG.R =
          result.X_BG.R * Quaternion::FromTwoVectors(Vector3::UnitZ(), to_vector(plane->Normal()));
    }
    return result;
  } catch (const std::runtime_error& error) {
    diagnostics.refuse(place_of(collision.Element()), error.what());
    return std::nullopt;
  }
}

}  // namespace hlm::ve
