#include "ve_client/world/sdf_geometry.h"

#include <algorithm>
#include <array>
#include <filesystem>
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

namespace hlm::ve {
namespace {

double positive_size(double value, const std::string& what) {
  if (const auto error = find_error(what, value, above_zero("m"))) throw std::runtime_error(*error);
  return value;
}

Shape to_shape(const sdf::Geometry& geometry, const std::string& where) {
  switch (geometry.Type()) {
    case sdf::GeometryType::SPHERE:
      return Sphere{positive_size(geometry.SphereShape()->Radius(), where + " radius")};
    case sdf::GeometryType::CAPSULE:
      return Capsule{positive_size(geometry.CapsuleShape()->Radius(), where + " radius"),
                     positive_size(geometry.CapsuleShape()->Length(), where + " length")};
    case sdf::GeometryType::CYLINDER:
      return Cylinder{positive_size(geometry.CylinderShape()->Radius(), where + " radius"),
                      positive_size(geometry.CylinderShape()->Length(), where + " length")};
    case sdf::GeometryType::BOX: {
      const ignition::math::Vector3d size = geometry.BoxShape()->Size();
      return Box{{positive_size(size.X(), where + " size x"),
                  positive_size(size.Y(), where + " size y"),
                  positive_size(size.Z(), where + " size z")}};
    }
    case sdf::GeometryType::ELLIPSOID: {
      const ignition::math::Vector3d radii = geometry.EllipsoidShape()->Radii();
      return Ellipsoid{{positive_size(radii.X(), where + " radius x"),
                        positive_size(radii.Y(), where + " radius y"),
                        positive_size(radii.Z(), where + " radius z")}};
    }
    case sdf::GeometryType::PLANE:
      return HalfSpace{};
    default:
      throw std::runtime_error(where +
                               ": no geometry; allowed: box, sphere, cylinder, capsule, "
                               "ellipsoid, mesh, plane");
  }
}

/// A file name, or a file: URI; relative to the file that it stands in.
std::filesystem::path mesh_file(const sdf::Mesh& mesh, const std::string& where) {
  std::string name = mesh.Uri();
  if (name.starts_with("file://")) name = name.substr(7);
  std::filesystem::path file(name);
  if (file.is_relative()) file = std::filesystem::path(mesh.FilePath()).parent_path() / file;
  if (!std::filesystem::is_regular_file(file)) {
    throw std::runtime_error(where + ": mesh '" + mesh.Uri() + "' is not a file (" + file.string() +
                             ")");
  }
  return file;
}

/// What a mesh becomes.
enum class Pieces { kHull, kTriangles, kParts };

Pieces pieces_of(const sdf::Mesh& source, const Mesh& mesh, bool fixed, const std::string& where) {
  if (source.Element()->HasElement("haptic:pieces")) {
    const auto word = source.Element()->Get<std::string>("haptic:pieces");
    if (word == "hull") return Pieces::kHull;
    if (word == "parts") return Pieces::kParts;
    if (word == "triangles" && fixed) return Pieces::kTriangles;
    throw std::runtime_error(where + ": <haptic:pieces> '" + word +
                             "' must be hull, parts or, in static models, triangles");
  }
  if (is_convex(mesh)) return Pieces::kHull;
  return fixed ? Pieces::kTriangles : Pieces::kParts;
}

/// A copy of `common` for each piece of the mesh.
std::vector<CollisionDescription> to_pieces(const sdf::Mesh& source, CollisionDescription common,
                                            const std::string& where, bool fixed,
                                            std::vector<std::string>& repairs) {
  const Vector3 scale = to_vector(source.Scale());
  if (!scale.allFinite() || (scale.array() == 0).any()) {
    throw std::runtime_error(where + ": mesh scale must be finite and not 0");
  }
  const auto mesh = std::make_shared<const Mesh>(read_mesh(
      {mesh_file(source, where), source.Submesh(), source.CenterSubmesh(), scale}, repairs));
  std::vector<Hull> hulls;
  try {
    switch (pieces_of(source, *mesh, fixed, where)) {
      case Pieces::kHull:
        hulls = {Hull{convex_hull(mesh->points).vertices}};
        break;
      case Pieces::kTriangles:
        hulls = skin_of(*mesh);
        common.mesh = mesh;
        break;
      case Pieces::kParts:
        hulls = decomposed(*mesh);
        break;
    }
  } catch (const std::exception& error) {
    throw std::runtime_error(where + ": mesh '" + source.Uri() + "': " + error.what());
  }
  std::vector<CollisionDescription> pieces;
  for (Hull& hull : hulls) {
    common.shape = std::move(hull);
    pieces.push_back(common);
  }
  return pieces;
}

std::optional<double> friction_of(const sdf::Collision& collision, const std::string& where) {
  sdf::ElementPtr element = collision.Element();
  for (const char* child : {"surface", "friction", "ode", "mu"}) {
    if (!element->HasElement(child)) return std::nullopt;
    element = element->GetElement(child);
  }
  const auto mu = element->Get<double>();
  const auto error = find_error(where + ": friction mu", mu, from_zero(""));
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
                                                const Vector3& p_BS, const std::string& where,
                                                bool fixed, std::vector<std::string>& repairs) {
  ignition::math::Pose3d X_SG;
  if (const sdf::Errors errors = collision.SemanticPose().Resolve(X_SG); !errors.empty()) {
    throw std::runtime_error(where + ": " + errors.front().Message());
  }
  CollisionDescription result;
  result.name = collision.Name();
  result.friction = friction_of(collision, where);
  result.X_BG = Pose{p_BS, Quaternion::Identity()} * to_pose(X_SG);
  if (const sdf::Mesh* mesh = collision.Geom()->MeshShape()) {
    return to_pieces(*mesh, std::move(result), where, fixed, repairs);
  }
  result.shape = to_shape(*collision.Geom(), where);
  if (const sdf::Plane* plane = collision.Geom()->PlaneShape()) {
    result.X_BG.R =
        result.X_BG.R * Quaternion::FromTwoVectors(Vector3::UnitZ(), to_vector(plane->Normal()));
  }
  return {result};
}

}  // namespace hlm::ve
