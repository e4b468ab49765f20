#include "hlm/geometry/mesh.h"

#include <algorithm>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <utility>

#include "hlm/common/one_line.h"
#include "hlm/common/range.h"
#include "hlm/geometry/index.h"
#include "hlm/geometry/interruption.h"
#include "hlm/geometry/mesh_edges.h"

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

void require_usable(const Mesh& mesh, const std::string& name, std::size_t most) {
  if (mesh.triangles.empty()) fail(name, "has no triangles");
  if (mesh.triangles.size() > most) {
    fail(name, std::to_string(mesh.triangles.size()) + " triangles; at most " +
                   std::to_string(most) +
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
  std::vector<std::size_t> order(mesh.points.size());
  std::iota(order.begin(), order.end(), 0);
  const auto place = [&](std::size_t i) {
    const Vector3& p = mesh.points[i];
    return std::array{p.x() + 0.0, p.y() + 0.0, p.z() + 0.0};
  };
  std::ranges::sort(order, [&](std::size_t i, std::size_t k) {
    return std::pair(place(i), i) < std::pair(place(k), k);
  });
  interruption_point();
  std::vector<std::size_t> same(order.size());  // The first point in each one's place.
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool is_new = i == 0 || place(order[i]) != place(order[i - 1]);
    same[order[i]] = is_new ? order[i] : same[order[i - 1]];
  }
  std::vector<int> number(mesh.points.size(), -1);
  std::vector<Vector3> points;
  for (Corners& triangle : mesh.triangles) {
    for (int& corner : triangle) {
      int& known = number[same[at(corner)]];
      if (known < 0) {
        known = static_cast<int>(points.size());
        points.push_back(mesh.points[at(corner)]);
      }
      corner = known;
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
  std::vector<std::pair<Corners, std::size_t>> known;
  known.reserve(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    known.emplace_back(mesh.triangles[t], t);
    std::ranges::sort(known.back().first);
  }
  std::ranges::sort(known);
  std::vector<bool> doubles(mesh.triangles.size(), false);
  for (std::size_t i = 1; i < known.size(); ++i) {
    doubles[known[i].second] = known[i].first == known[i - 1].first;
  }
  std::size_t next = 0;
  return std::erase_if(mesh.triangles, [&](const Corners&) { return doubles[next++]; });
}

/// Throws if so many triangles meet in a point that a contact there takes too long.
void require_no_fan(const Mesh& mesh, const std::string& name) {
  for (const auto& around : mesh.around) {
    if (around.size() <= kMostAtPoint) continue;
    fail(name, std::to_string(around.size()) + " triangles meet in one point; at most " +
                   std::to_string(kMostAtPoint) + " may: remesh it, or use simpler shapes");
  }
}

std::vector<MeshEdges::Corners> corners_of(const Mesh& mesh) {
  std::vector<MeshEdges::Corners> corners;
  corners.reserve(mesh.triangles.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    corners.push_back({static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b),
                       static_cast<std::uint32_t>(c)});
  }
  return corners;
}

/// Turns triangles until neighbours agree, as far as edges of two triangles reach. Returns how many
/// were turned: of each part the smaller share.
std::size_t turn_to_agree(Mesh& mesh, const std::vector<MeshEdges::Corners>& corners,
                          const MeshEdges& edges) {
  struct Neighbour {
    std::int32_t triangle = -1;
    bool agrees = true;
  };
  std::vector<std::array<Neighbour, 3>> across(corners.size());
  edges.for_each_pair([&](std::size_t t, std::size_t i, std::size_t u, std::size_t j) {
    const bool agrees = corners[t][i] != corners[u][j];
    across[t][i] = {static_cast<std::int32_t>(u), agrees};
    across[u][j] = {static_cast<std::int32_t>(t), agrees};
  });
  std::size_t turned = 0;
  std::vector<int> sign(corners.size());
  std::vector<std::size_t> part;
  for (std::size_t seed = 0; seed < sign.size(); ++seed) {
    if (sign[seed] != 0) continue;
    part.assign(1, seed);
    sign[seed] = 1;
    for (std::size_t next = 0; next < part.size(); ++next) {
      for (const auto& [other, agrees] : across[part[next]]) {
        if (other < 0 || sign[at(other)] != 0) continue;
        sign[at(other)] = agrees ? sign[part[next]] : -sign[part[next]];
        part.push_back(at(other));
      }
    }
    const auto wrong = static_cast<std::size_t>(
        std::count_if(part.begin(), part.end(), [&](std::size_t t) { return sign[t] < 0; }));
    const int keep = 2 * wrong > part.size() ? -1 : 1;
    for (const std::size_t t : part) {
      if (sign[t] == keep) continue;
      std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
      ++turned;
    }
  }
  return turned;
}

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

Mesh repaired(Mesh mesh, const std::string& name, std::vector<std::string>& repairs,
              std::size_t most) {
  const auto say = [&](const std::string& what) {
    repairs.push_back(one_line("mesh " + name + ": " + what));
  };
  require_usable(mesh, name, most);
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
  const std::vector<MeshEdges::Corners> corners = corners_of(mesh);
  const MeshEdges edges(corners);
  interruption_point();
  if (const std::size_t turned = turn_to_agree(mesh, corners, edges); turned > 0) {
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
