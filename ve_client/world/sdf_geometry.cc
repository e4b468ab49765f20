#include "ve_client/world/sdf_geometry.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <stdexcept>

#include <sdf/Box.hh>
#include <sdf/Capsule.hh>
#include <sdf/Cylinder.hh>
#include <sdf/Element.hh>
#include <sdf/Ellipsoid.hh>
#include <sdf/Geometry.hh>
#include <sdf/Mesh.hh>
#include <sdf/Plane.hh>
#include <sdf/Sphere.hh>

#include "common/range.h"
#include "ve_client/contacts/hull.h"
#include "ve_client/world/mesh_pieces.h"
#include "ve_client/world/resources.h"
#include "ve_client/world/sdf_messages.h"
#include "ve_client/world/sdf_places.h"

namespace hlm::ve {
namespace {

/// Throws std::runtime_error, for to_collisions() to report.
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
    case sdf::GeometryType::ELLIPSOID: {
      const ignition::math::Vector3d radii = geometry.EllipsoidShape()->Radii();
      return Ellipsoid{{positive_size(radii.X(), "radius x"), positive_size(radii.Y(), "radius y"),
                        positive_size(radii.Z(), "radius z")}};
    }
    case sdf::GeometryType::PLANE:
      return HalfSpace{};
    default:
      throw std::runtime_error(
          "no geometry; allowed: box, sphere, cylinder, capsule, ellipsoid, mesh, plane");
  }
}

std::filesystem::path mesh_file(const sdf::Mesh& mesh) {
  const auto found = find_resource(mesh.Uri(), place_of(mesh.Element()).file);
  const std::string name = "mesh '" + mesh.Uri() + "'";
  if (!found) {
    throw std::runtime_error(name + " is not found; " + resource_remedy(mesh.Uri()));
  }
  if (!std::filesystem::is_regular_file(*found)) {
    throw std::runtime_error(name + " is not a file (" + found->string() + ")");
  }
  return *found;
}

/// What a mesh becomes.
enum class Pieces { kHull, kTriangles, kParts };

Pieces pieces_of(const sdf::Mesh& source, const Mesh& mesh, bool fixed) {
  if (source.Element()->HasElement("haptic:pieces")) {
    const auto word = source.Element()->Get<std::string>("haptic:pieces");
    if (word == "hull") return Pieces::kHull;
    if (word == "parts") return Pieces::kParts;
    if (word == "triangles" && fixed) return Pieces::kTriangles;
    throw std::runtime_error("<haptic:pieces> '" + word +
                             "' must be hull, parts or, in static models, triangles");
  }
  if (is_convex(mesh)) return Pieces::kHull;
  return fixed ? Pieces::kTriangles : Pieces::kParts;
}

std::vector<Hull> to_hulls(const Mesh& mesh, Pieces pieces) {
  switch (pieces) {
    case Pieces::kHull:
      return {Hull{convex_hull(mesh.points).vertices}};
    case Pieces::kTriangles:
      return skin_of(mesh);
    case Pieces::kParts:
      return decomposed(mesh);
  }
  return {};
}

/// A copy of `common` for each piece of the mesh.
std::vector<CollisionDescription> to_pieces(const sdf::Mesh& source, CollisionDescription common,
                                            bool fixed, Diagnostics& diagnostics) {
  const Vector3 scale = to_vector(source.Scale());
  if (!scale.allFinite() || (scale.array() == 0).any()) {
    throw std::runtime_error("mesh scale must be finite and not 0");
  }
  const std::filesystem::path file = mesh_file(source);
  std::vector<std::string> repairs;
  const auto mesh = std::make_shared<const Mesh>(
      read_mesh({file, source.Submesh(), source.CenterSubmesh(), scale}, repairs));
  for (const std::string& repair : repairs) {
    diagnostics.approximate(place_of(source.Element()), repair);
  }
  std::vector<CollisionDescription> collisions;
  try {
    const Pieces pieces = pieces_of(source, *mesh, fixed);
    if (pieces == Pieces::kTriangles) common.mesh = mesh;
    std::size_t thin = 0;
    std::size_t number = 0;
    for (Hull& hull : to_hulls(*mesh, pieces)) {
      common.triangle = number++;
      if (!has_inside(hull.vertices)) {
        ++thin;
        continue;
      }
      common.shape = std::move(hull);
      collisions.push_back(common);
    }
    if (thin > 0) {
      diagnostics.approximate(place_of(source.Element()),
                              "mesh " + file.string() + ": " + std::to_string(thin) +
                                  " of its pieces thinner than 1 µm left out");
    }
    if (collisions.empty()) throw std::runtime_error("it is thinner than 1 µm everywhere");
  } catch (const std::exception& error) {
    throw std::runtime_error("mesh " + file.string() + ": " + error.what());
  }
  return collisions;
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

std::vector<CollisionDescription> to_collisions(const sdf::Collision& collision,
                                                const Vector3& p_BS, bool fixed,
                                                Diagnostics& diagnostics) {
  const sdf::Mesh* const mesh = collision.Geom()->MeshShape();
  try {
    ignition::math::Pose3d X_SG;
    const sdf::Errors errors = collision.SemanticPose().Resolve(X_SG);
    if (diagnostics.usable()) require_none(errors);  // Otherwise the cause is reported already.
    CollisionDescription result;
    result.name = collision.Name();
    result.friction = friction_of(collision);
    result.X_BG = Pose{p_BS, Quaternion::Identity()} * to_pose(X_SG);
    if (mesh != nullptr) return to_pieces(*mesh, std::move(result), fixed, diagnostics);
    result.shape = to_shape(*collision.Geom());
    if (const sdf::Plane* plane = collision.Geom()->PlaneShape()) {
      if (!(plane->Normal().Length() > 0)) throw std::runtime_error("normal must not be 0 0 0");
      result.X_BG.R =
          result.X_BG.R * Quaternion::FromTwoVectors(Vector3::UnitZ(), to_vector(plane->Normal()));
    }
    return {result};
  } catch (const std::runtime_error& error) {
    diagnostics.refuse(place_of(mesh != nullptr ? mesh->Element() : collision.Element()),
                       error.what());
    return {};
  }
}

}  // namespace hlm::ve
