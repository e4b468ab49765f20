#include "hlm/ve_client/scene/sdf_geometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <numbers>
#include <stdexcept>

#include <sdf/Box.hh>
#include <sdf/Capsule.hh>
#include <sdf/Cylinder.hh>
#include <sdf/Element.hh>
#include <sdf/Ellipsoid.hh>
#include <sdf/Geometry.hh>
#include <sdf/Heightmap.hh>
#include <sdf/Mesh.hh>
#include <sdf/Plane.hh>
#include <sdf/Sphere.hh>

#include "hlm/common/friction_limit.h"
#include "hlm/common/range.h"
#include "hlm/geometry/hull.h"
#include "hlm/geometry/mesh_pieces.h"
#include "hlm/ve_client/scene/convex_decomposition.h"
#include "hlm/ve_client/scene/heightmap.h"
#include "hlm/ve_client/scene/mesh_file.h"
#include "hlm/ve_client/scene/resources.h"
#include "hlm/ve_client/scene/sdf_messages.h"
#include "hlm/ve_client/scene/sdf_places.h"

namespace hlm::ve {
namespace {

/// Sizes of shapes. Thinner ones have no inside that a contact could be found in, and larger ones
/// carry the engine to infinity.
constexpr Range kSizes{1e-6, 1e6, "m"};
/// Sizes of a cone, whose corners are those of a hull.
constexpr Range kConeSizes{1e-6, 1000, "m"};
/// Sides of a heightmap: smaller ones leave cells no larger than what a contact is exact to.
constexpr Range kMapSide{1e-3, 1000, "m"};
constexpr Range kMapHeight{1e-6, 1000, "m"};

/// Why a collision has no shape although nothing in the file is wrong: it alone is left out.
struct NoShape : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Throws std::runtime_error, for to_collision() to report. What has no extent is no mistake: files
/// have spheres of radius 0 as points.
double ranged_size(double value, const std::string& what, const Range& range) {
  const auto error = find_error(what, value, range);
  if (error && value >= 0 && value < range.least) throw NoShape(*error);
  if (error) throw std::runtime_error(*error);
  return value;
}

double size_of_shape(double value, const std::string& what) {
  return ranged_size(value, what, kSizes);
}

/// Corners of a cone's base: its sides lie up to half a per cent of its radius further in.
constexpr int kConeCorners = 32;

/// Centred, with the tip along z, as in SDFormat 1.11.
Hull to_cone(const sdf::ElementPtr& cone) {
  const double radius = ranged_size(cone->Get<double>("radius", 1).first, "radius", kConeSizes);
  const double half = ranged_size(cone->Get<double>("length", 1).first, "length", kConeSizes) / 2;
  Hull hull{{{0, 0, half}}};
  for (int i = 0; i < kConeCorners; ++i) {
    const double angle = 2 * std::numbers::pi * i / kConeCorners;
    hull.vertices.emplace_back(radius * std::cos(angle), radius * std::sin(angle), -half);
  }
  return hull;
}

Shape to_shape(const sdf::Geometry& geometry) {
  if (const sdf::ElementPtr cone = cone_of(geometry)) return to_cone(cone);
  switch (geometry.Type()) {
    case sdf::GeometryType::SPHERE:
      return Sphere{size_of_shape(geometry.SphereShape()->Radius(), "radius")};
    case sdf::GeometryType::CAPSULE:
      return Capsule{size_of_shape(geometry.CapsuleShape()->Radius(), "radius"),
                     size_of_shape(geometry.CapsuleShape()->Length(), "length")};
    case sdf::GeometryType::CYLINDER:
      return Cylinder{size_of_shape(geometry.CylinderShape()->Radius(), "radius"),
                      size_of_shape(geometry.CylinderShape()->Length(), "length")};
    case sdf::GeometryType::BOX: {
      const ignition::math::Vector3d size = geometry.BoxShape()->Size();
      return Box{{size_of_shape(size.X(), "size x"), size_of_shape(size.Y(), "size y"),
                  size_of_shape(size.Z(), "size z")}};
    }
    case sdf::GeometryType::ELLIPSOID: {
      const ignition::math::Vector3d radii = geometry.EllipsoidShape()->Radii();
      return Ellipsoid{{size_of_shape(radii.X(), "radius x"), size_of_shape(radii.Y(), "radius y"),
                        size_of_shape(radii.Z(), "radius z")}};
    }
    case sdf::GeometryType::PLANE:
      return HalfSpace{};
    default:
      throw std::runtime_error(
          "no geometry; allowed: box, sphere, cylinder, cone, capsule, ellipsoid, mesh, "
          "heightmap, plane");
  }
}

/// The file that a mesh or heightmap names.
template <class Source>
std::filesystem::path file_of(const Source& source) {
  if (source.Uri() == "__default__") throw std::runtime_error("<uri> is not given");
  const auto found = find_resource(source.Uri(), place_of(source.Element()).file);
  const std::string name = source.Element()->GetName() + " '" + source.Uri() + "'";
  if (!found) {
    throw std::runtime_error(name + " is not found; " +
                             resource_remedy(source.Uri(), place_of(source.Element()).file));
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

std::vector<Hull> to_hulls(const Mesh& mesh, Pieces pieces, const std::string& name,
                           const Progress& progress) {
  switch (pieces) {
    case Pieces::kHull:
      return {Hull{convex_hull(mesh.points).vertices}};
    case Pieces::kTriangles:
      return skin_of(mesh);
    case Pieces::kParts:
      return decomposed(mesh, name, progress);
  }
  return {};
}

/// A copy of `common` for each of the hulls that has an inside. `name`: of what they are pieces.
std::vector<CollisionDescription> with_shapes(CollisionDescription common, std::vector<Hull> hulls,
                                              const std::string& name, const Place& place,
                                              Diagnostics& diagnostics) {
  std::vector<CollisionDescription> collisions;
  std::size_t thin = 0;
  std::size_t number = 0;
  for (Hull& hull : hulls) {
    common.triangle = number++;
    if (!has_inside(hull.vertices)) {
      ++thin;
      continue;
    }
    common.shape = std::move(hull);
    collisions.push_back(common);
  }
  if (thin > 0) {
    diagnostics.approximate(
        place, name + ": " + std::to_string(thin) + " of its pieces thinner than 1 µm left out");
  }
  if (collisions.empty()) throw std::runtime_error("it is thinner than 1 µm everywhere");
  return collisions;
}

FileCollision to_pieces(const sdf::Mesh& source, CollisionDescription common, bool fixed,
                        Diagnostics& diagnostics) {
  const Vector3 scale = to_vector(source.Scale());
  if (!scale.allFinite() || (scale.array() == 0).any()) {
    throw std::runtime_error("mesh scale must be finite and not 0");
  }
  const std::filesystem::path file = file_of(source);
  const std::string name = "mesh " + file.string();
  const Place place = place_of(source.Element());
  std::vector<std::string> repairs;
  std::shared_ptr<const Mesh> mesh;
  try {
    mesh = std::make_shared<const Mesh>(
        read_mesh({file, source.Submesh(), source.CenterSubmesh(), scale}, repairs));
  } catch (const std::exception& error) {
    throw NoShape(error.what());
  }
  for (const std::string& repair : repairs) diagnostics.approximate(place, repair);
  const Pieces pieces = pieces_of(source, *mesh, fixed);
  try {
    if (pieces == Pieces::kTriangles) common.mesh = mesh;
    if (pieces == Pieces::kTriangles && mesh->is_sheet()) {
      diagnostics.approximate(
          place, name + ": an open sheet, without an inside: it is thin, and felt from both sides");
    }
    FileCollision read;
    if (!fixed) read.solid_B = moved(common.X_BG, solid_of(*mesh));
    read.pieces = with_shapes(common, to_hulls(*mesh, pieces, name, diagnostics.progress()), name,
                              place, diagnostics);
    if (pieces == Pieces::kTriangles && mesh->is_sheet()) {
      common.mesh = mesh->back;
      std::ranges::move(with_shapes(common, skin_of(*mesh->back), name, place, diagnostics),
                        std::back_inserter(read.pieces));
    }
    return read;
  } catch (const std::exception& error) {
    throw NoShape(name + ": " + error.what());
  }
}

FileCollision to_pieces(const sdf::Heightmap& source, CollisionDescription common, bool fixed,
                        Diagnostics& diagnostics) {
  if (!fixed) {
    throw NoShape("a heightmap cannot move: put it into a model with <static>true");
  }
  const Vector3 size{ranged_size(source.Size().X(), "size x", kMapSide),
                     ranged_size(source.Size().Y(), "size y", kMapSide),
                     ranged_size(source.Size().Z(), "size z", kMapHeight)};
  const std::filesystem::path file = file_of(source);
  try {
    common.mesh = std::make_shared<const Mesh>(read_heightmap(file, size));
  } catch (const std::exception& error) {
    throw NoShape(error.what());
  }
  common.X_BG = common.X_BG * Pose{to_vector(source.Position()), Quaternion::Identity()};
  std::vector<Hull> skin = skin_of(*common.mesh);
  return {with_shapes(std::move(common), std::move(skin), "heightmap " + file.string(),
                      place_of(source.Element()), diagnostics),
          std::nullopt};
}

std::optional<double> friction_of(const sdf::Collision& collision, Diagnostics& diagnostics) {
  sdf::ElementPtr element = collision.Element();
  for (const char* child : {"surface", "friction", "ode", "mu"}) {
    if (!element->HasElement(child)) return std::nullopt;
    element = element->GetElement(child);
  }
  const auto mu = element->Get<double>();
  const auto error = find_error("friction mu", mu, from_zero(""));
  if (error) throw std::runtime_error(*error);
  if (mu > kLargestFriction) {
    diagnostics.approximate(place_of(element),
                            "friction mu " + shortest_text(mu) + ": it counts as " +
                                shortest_text(kLargestFriction) + ", the most that is felt");
  }
  return usable_friction(mu);
}

}  // namespace

sdf::ElementPtr cone_of(const sdf::Geometry& geometry) {
  return geometry.Element() ? geometry.Element()->FindElement("cone") : nullptr;
}

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

FileCollision to_collision(const sdf::Collision& collision, const Vector3& p_BS, bool fixed,
                           Diagnostics& diagnostics) {
  const sdf::Mesh* const mesh = collision.Geom()->MeshShape();
  const sdf::Heightmap* const heightmap = collision.Geom()->HeightmapShape();
  try {
    ignition::math::Pose3d X_SG;
    const sdf::Errors errors = collision.SemanticPose().Resolve(X_SG);
    if (diagnostics.usable()) require_none(errors);  // Otherwise the cause is reported already.
    CollisionDescription result;
    result.name = collision.Name();
    result.friction = friction_of(collision, diagnostics);
    result.X_BG = Pose{p_BS, Quaternion::Identity()} * to_pose(X_SG);
    if (mesh != nullptr) return to_pieces(*mesh, std::move(result), fixed, diagnostics);
    if (heightmap != nullptr) return to_pieces(*heightmap, std::move(result), fixed, diagnostics);
    result.shape = to_shape(*collision.Geom());
    if (const sdf::Plane* plane = collision.Geom()->PlaneShape()) {
      if (!fixed) throw NoShape("a plane is allowed in static models only");
      if (!(plane->Normal().Length() > 0)) throw std::runtime_error("normal must not be 0 0 0");
      const sdf::ElementPtr size = plane->Element()->FindElement("size");
      if (size && size->GetExplicitlySetInFile()) {
        diagnostics.ignore(place_of(size), "<size>: planes have no end");
      }
      result.X_BG.R =
          result.X_BG.R * Quaternion::FromTwoVectors(Vector3::UnitZ(), to_vector(plane->Normal()));
    }
    std::optional<Solid> solid = fixed ? std::nullopt : solid_of(result.shape);
    if (solid) solid = moved(result.X_BG, *solid);
    return {{std::move(result)}, solid};
  } catch (const std::runtime_error& error) {
    const sdf::ElementPtr element = mesh != nullptr        ? mesh->Element()
                                    : heightmap != nullptr ? heightmap->Element()
                                                           : collision.Element();
    if (dynamic_cast<const NoShape*>(&error) != nullptr) {
      diagnostics.approximate(place_of(element),
                              error.what() + std::string("; the collision is left out"));
    } else {
      diagnostics.refuse(place_of(element), error.what());
    }
    return {};
  }
}

}  // namespace hlm::ve
