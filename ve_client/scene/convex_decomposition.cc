#include "hlm/scene/convex_decomposition.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <limits>
#include <optional>
#include <sstream>
#include <stdexcept>

#include <bullet/HACD/hacdHACD.h>
#include <unistd.h>

#include "hlm/geometry/hull.h"
#include "hlm/geometry/mesh_pieces.h"

namespace hlm::ve {
namespace {

namespace fs = std::filesystem;

/// How far a piece may bridge a hollow, in thousandths of the mesh's size. A tenth of it gives half
/// as many pieces again on a cup and nine times as many on rolling ground.
constexpr double kConcavity = 10;
/// Weight of compact pieces against few.
constexpr double kCompactness = 0.1;
/// More triangles take minutes.
constexpr std::size_t kMostToDecompose = 5000;

/// FNV-1a over everything that the answer depends on.
std::uint64_t fingerprint(const Mesh& mesh) {
  std::uint64_t hash = 0xCBF29CE484222325u;
  const auto add = [&](const void* data, std::size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < size; ++i) hash = (hash ^ bytes[i]) * 0x100000001B3u;
  };
  const double parameters[] = {kConcavity, kCompactness};
  add(parameters, sizeof parameters);
  for (const Vector3& p : mesh.points) add(p.data(), 3 * sizeof(double));
  for (const auto& triangle : mesh.triangles) add(triangle.data(), sizeof triangle);
  return hash;
}

/// Empty if there is no place for it.
fs::path cache_file(const Mesh& mesh) {
  const char* cache = std::getenv("XDG_CACHE_HOME");
  const char* home = std::getenv("HOME");
  if ((cache == nullptr || *cache == 0) && (home == nullptr || *home == 0)) return {};
  const fs::path folder =
      cache != nullptr && *cache != 0 ? fs::path(cache) : fs::path(home) / ".cache";
  std::ostringstream name;
  name << std::hex << fingerprint(mesh) << ".hulls";
  return folder / "haptic_local_model" / name.str();
}

/// Each piece: the number of its vertices, and these. None if the file does not hold such.
std::optional<std::vector<Hull>> read_pieces(const fs::path& file) {
  std::ifstream in(file);
  std::size_t pieces = 0;
  if (!(in >> pieces) || pieces == 0 || pieces > kMostToDecompose) return {};
  std::vector<Hull> hulls(pieces);
  for (Hull& hull : hulls) {
    std::size_t count = 0;
    if (!(in >> count) || count > kMaxHullVertices) return {};
    hull.vertices.resize(count);
    for (Vector3& p : hull.vertices) {
      if (!(in >> p.x() >> p.y() >> p.z())) return {};
    }
  }
  const auto is_solid = [](const Hull& hull) { return has_inside(hull.vertices); };
  if (!std::ranges::all_of(hulls, is_solid)) return {};
  return hulls;
}

/// Best effort: what cannot be kept is computed again.
void write_pieces(const fs::path& file, const std::vector<Hull>& hulls) {
  std::error_code ignored;
  fs::create_directories(file.parent_path(), ignored);
  const fs::path part = file.string() + "." + std::to_string(::getpid());
  std::ofstream out(part);
  out << std::setprecision(std::numeric_limits<double>::max_digits10) << hulls.size() << "\n";
  for (const Hull& hull : hulls) {
    out << hull.vertices.size() << "\n";
    for (const Vector3& p : hull.vertices) out << p.x() << " " << p.y() << " " << p.z() << "\n";
  }
  out.close();
  if (out) fs::rename(part, file, ignored);
  if (!out || ignored) fs::remove(part, ignored);
}

/// Parts of the surface that are flat get the skin behind it.
void give_inside(const Mesh& mesh, const long* partition, std::vector<Hull>& hulls) {
  const std::vector<Hull> skin = skin_of(mesh);
  std::vector<bool> is_flat;
  for (const Hull& hull : hulls) is_flat.push_back(!has_inside(hull.vertices));
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto part = static_cast<std::size_t>(partition[t]);
    if (!is_flat[part]) continue;
    auto& vertices = hulls[part].vertices;
    vertices.insert(vertices.end(), skin[t].vertices.begin(), skin[t].vertices.end());
  }
}

std::vector<Hull> decompose(const Mesh& mesh) {
  std::vector<HACD::Vec3<HACD::Real>> points;
  std::vector<HACD::Vec3<long>> triangles;
  for (const Vector3& p : mesh.points) points.emplace_back(p.x(), p.y(), p.z());
  for (const auto& t : mesh.triangles) triangles.emplace_back(t[0], t[1], t[2]);
  HACD::HACD hacd;
  hacd.SetPoints(points.data());
  hacd.SetNPoints(points.size());
  hacd.SetTriangles(triangles.data());
  hacd.SetNTriangles(triangles.size());
  hacd.SetCompacityWeight(kCompactness);
  hacd.SetVolumeWeight(0);
  hacd.SetNClusters(1);
  hacd.SetConcavity(kConcavity);
  hacd.SetAddExtraDistPoints(true);
  hacd.SetAddNeighboursDistPoints(true);
  hacd.SetAddFacesPoints(true);
  if (!hacd.Compute()) throw std::runtime_error("no convex decomposition was found");
  std::vector<Hull> hulls(hacd.GetNClusters());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    Hull& hull = hulls[static_cast<std::size_t>(hacd.GetPartition()[t])];
    for (std::size_t i = 0; i < 3; ++i) hull.vertices.push_back(mesh.corner(t, i));
  }
  give_inside(mesh, hacd.GetPartition(), hulls);
  for (Hull& hull : hulls) hull.vertices = convex_hull(hull.vertices).vertices;
  return hulls;
}

}  // namespace

std::vector<Hull> decomposed(const Mesh& mesh) {
  if (mesh.triangles.size() > kMostToDecompose) {
    throw std::runtime_error(std::to_string(mesh.triangles.size()) + " triangles; at most " +
                             std::to_string(kMostToDecompose) +
                             " are allowed for a concave mesh that moves");
  }
  const fs::path file = cache_file(mesh);
  if (auto known = read_pieces(file)) return *known;
  std::vector<Hull> hulls = decompose(mesh);
  if (!file.empty()) write_pieces(file, hulls);
  return hulls;
}

}  // namespace hlm::ve
