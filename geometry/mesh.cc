#include "hlm/geometry/mesh.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include "hlm/common/one_line.h"
#include "hlm/common/range.h"
#include "hlm/geometry/index.h"
#include "hlm/geometry/interruption.h"

namespace hlm::geometry {
namespace {

/// Most triangles that may meet in a point.
constexpr std::size_t kMostAtPoint = 1000;
/// Triangles whose height is less, m, have no area.
constexpr double kLeastHeight = 1e-9;
constexpr Range kCoordinates{-1000, 1000, "m"};

using Corners = std::array<int, 3>;

[[noreturn]] void fail(const std::string& name, const std::string& what) {
  throw std::runtime_error(one_line("mesh " + name + ": " + what));
}

std::string counted(std::size_t count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

void require_usable(const Mesh& mesh, const std::string& name) {
  if (mesh.triangles.empty()) fail(name, "has no triangles");
  if (mesh.triangles.size() > kMostTriangles) {
    fail(name, std::to_string(mesh.triangles.size()) + " triangles; at most " +
                   std::to_string(kMostTriangles) +
                   " are allowed: reduce it in a mesh editor, or use simpler shapes");
  }
  for (const Vector3& p : mesh.points) {
    for (const double value : p) {
      if (const auto error = find_error("coordinate", value, kCoordinates)) fail(name, *error);
    }
  }
}

/// Makes one point of those at the same place, and forgets those that no triangle uses.
void join_points(Mesh& mesh) {
  std::map<std::array<double, 3>, int> known;
  std::vector<Vector3> points;
  for (Corners& triangle : mesh.triangles) {
    for (int& corner : triangle) {
      const Vector3& p = mesh.points[at(corner)];
      const auto [entry, is_new] = known.try_emplace({p.x() + 0.0, p.y() + 0.0, p.z() + 0.0},
                                                     static_cast<int>(points.size()));
      if (is_new) points.push_back(p);
      corner = entry->second;
    }
  }
  mesh.points = std::move(points);
}

std::size_t drop_flat_triangles(Mesh& mesh) {
  const auto is_flat = [&](const Corners& t) {
    const Vector3 a = mesh.points[at(t[1])] - mesh.points[at(t[0])];
    const Vector3 b = mesh.points[at(t[2])] - mesh.points[at(t[0])];
    const double longest = std::max({a.norm(), b.norm(), (a - b).norm()});
    return !(a.cross(b).norm() > kLeastHeight * longest);
  };
  return std::erase_if(mesh.triangles, is_flat);
}

/// Leaves of triangles with the same corners the first: the other side of a sheet.
std::size_t drop_doubles(Mesh& mesh) {
  std::set<Corners> known;
  return std::erase_if(mesh.triangles, [&](Corners t) {
    std::ranges::sort(t);
    return !known.insert(t).second;
  });
}

/// Throws if so many triangles meet in a point that a contact there takes too long.
void require_no_fan(const Mesh& mesh, const std::string& name) {
  for (const auto& around : mesh.around) {
    if (around.size() <= kMostAtPoint) continue;
    fail(name, std::to_string(around.size()) + " triangles meet in one point; at most " +
                   std::to_string(kMostAtPoint) + " may: remesh it, or use simpler shapes");
  }
}

/// Which triangles have which edges.
class Edges {
 public:
  explicit Edges(Mesh& mesh) : mesh_(mesh) {
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      for (std::size_t i = 0; i < 3; ++i) triangles_[edge(t, i)].push_back(t);
    }
  }

  std::size_t open() const {
    return count([](std::size_t n) { return n == 1; });
  }
  std::size_t crowded() const {
    return count([](std::size_t n) { return n > 2; });
  }

  /// Turns triangles until neighbours agree, as far as edges of two triangles reach. Returns how
  /// many were turned: of each part the smaller share.
  std::size_t turn_to_agree() {
    std::size_t turned = 0;
    std::vector<int> sign(mesh_.triangles.size());
    for (std::size_t seed = 0; seed < sign.size(); ++seed) {
      if (sign[seed] != 0) continue;
      std::vector<std::size_t> part{seed};
      sign[seed] = 1;
      for (std::size_t next = 0; next < part.size(); ++next) spread(part[next], sign, part);
      const auto wrong = static_cast<std::size_t>(
          std::count_if(part.begin(), part.end(), [&](std::size_t t) { return sign[t] < 0; }));
      const int keep = 2 * wrong > part.size() ? -1 : 1;
      for (const std::size_t t : part) {
        if (sign[t] == keep) continue;
        std::swap(mesh_.triangles[t][1], mesh_.triangles[t][2]);
        ++turned;
      }
    }
    return turned;
  }

 private:
  std::pair<int, int> edge(std::size_t t, std::size_t i) const {
    const Corners& corners = mesh_.triangles[t];
    return std::minmax(corners[i], corners[(i + 1) % 3]);
  }
  template <class Wanted>
  std::size_t count(Wanted wanted) const {
    return static_cast<std::size_t>(
        std::count_if(triangles_.begin(), triangles_.end(),
                      [&](const auto& entry) { return wanted(entry.second.size()); }));
  }
  void spread(std::size_t from, std::vector<int>& sign, std::vector<std::size_t>& part) {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto& both = triangles_[edge(from, i)];
      if (both.size() != 2) continue;
      const std::size_t other = both[0] == from ? both[1] : both[0];
      if (sign[other] != 0) continue;
      sign[other] = runs_as(other, mesh_.triangles[from][i], mesh_.triangles[from][(i + 1) % 3])
                        ? -sign[from]
                        : sign[from];
      part.push_back(other);
    }
  }
  bool runs_as(std::size_t t, int first, int second) const {
    const Corners& c = mesh_.triangles[t];
    for (std::size_t i = 0; i < 3; ++i) {
      if (c[i] == first && c[(i + 1) % 3] == second) return true;
    }
    return false;
  }

  Mesh& mesh_;
  std::map<std::pair<int, int>, std::vector<std::size_t>> triangles_;
};

/// Turns all triangles.
void turn(Mesh& mesh) {
  for (Corners& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
}

}  // namespace

Vector3 Mesh::area(std::size_t triangle) const {
  return (corner(triangle, 1) - corner(triangle, 0))
      .cross(corner(triangle, 2) - corner(triangle, 0));
}

double Mesh::volume() const {
  double six = 0;
  for (std::size_t t = 0; t < triangles.size(); ++t) six += area(t).dot(corner(t, 0) - points[0]);
  return six / 6;
}

void Mesh::find_around() {
  around.assign(points.size(), {});
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (const int corner : triangles[t]) around[at(corner)].push_back(t);
  }
}

Mesh repaired(Mesh mesh, const std::string& name, std::vector<std::string>& repairs) {
  const auto say = [&](const std::string& what) {
    repairs.push_back(one_line("mesh " + name + ": " + what));
  };
  require_usable(mesh, name);
  interruption_point();
  join_points(mesh);
  interruption_point();
  const std::size_t flat = drop_flat_triangles(mesh);
  if (mesh.triangles.empty()) fail(name, "none of its triangles has an area");
  if (flat > 0) say(counted(flat, "triangle") + " without area left out");
  if (const std::size_t doubles = drop_doubles(mesh); doubles > 0) {
    say(counted(doubles, "triangle") + " left out that other triangles lie on");
  }
  join_points(mesh);
  interruption_point();
  Edges edges(mesh);
  interruption_point();
  if (const std::size_t turned = edges.turn_to_agree(); turned > 0) {
    say(counted(turned, "triangle") + " turned to agree with the others");
  }
  if (edges.crowded() > 0) say(counted(edges.crowded(), "edge") + " with more than two triangles");
  mesh.closed = edges.open() == 0 && edges.crowded() == 0;
  if (mesh.closed && mesh.volume() < 0) {
    turn(mesh);
    say("turned, as it was inside out");
  }
  mesh.find_around();
  require_no_fan(mesh, name);
  if (edges.open() > 0) {
    const auto back = std::make_shared<Mesh>(mesh);
    turn(*back);
    back->sheet = mesh.sheet = back.get();
    mesh.back = back;
  }
  return mesh;
}

}  // namespace hlm::geometry
