#include "haptic_proximity.h"

#include <algorithm>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "hlm/client/shape_contacts.h"

namespace {

using namespace hlm;
using namespace hlm::geometry;

std::vector<Vector3> vertices_of(const haptic_shape& from) {
  if (from.vertices == nullptr) throw std::invalid_argument("it must have vertices");
  std::vector<Vector3> vertices;
  for (std::size_t i = 0; i < from.vertex_count; ++i) {
    vertices.emplace_back(Eigen::Map<const Vector3>(from.vertices + 3 * i));
  }
  return vertices;
}

Mesh mesh_of(const haptic_shape& from) {
  Mesh mesh;
  mesh.points = vertices_of(from);
  if (from.triangles == nullptr) throw std::invalid_argument("a mesh must have triangles");
  for (std::size_t t = 0; t < from.triangle_count; ++t) {
    auto& corners = mesh.triangles.emplace_back();
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t corner = from.triangles[3 * t + i];
      if (corner >= from.vertex_count) {
        throw std::invalid_argument("corner " + std::to_string(corner) + " of triangle " +
                                    std::to_string(t) + " must be less than vertex_count, " +
                                    std::to_string(from.vertex_count));
      }
      corners[i] = static_cast<int>(corner);
    }
  }
  return mesh;
}

std::variant<Shape, Mesh> shape_of(const haptic_shape& from) {
  const double* size = from.size;
  switch (from.kind) {
    case HAPTIC_SPHERE:
      return Sphere{size[0]};
    case HAPTIC_CAPSULE:
      return Capsule{size[0], size[1]};
    case HAPTIC_CYLINDER:
      return Cylinder{size[0], size[1]};
    case HAPTIC_BOX:
      return Box{{size[0], size[1], size[2]}};
    case HAPTIC_ELLIPSOID:
      return Ellipsoid{{size[0], size[1], size[2]}};
    case HAPTIC_HULL:
      return Hull{vertices_of(from)};
    case HAPTIC_HALF_SPACE:
      return HalfSpace{};
    case HAPTIC_MESH:
      return mesh_of(from);
    default:
      throw std::invalid_argument("kind " + std::to_string(from.kind) + " must be 0 to 7");
  }
}

BodyShape body_shape_of(const haptic_shape& from) {
  if (from.side < HAPTIC_WORLD || from.side > HAPTIC_MOVABLE_BODY) {
    throw std::invalid_argument("side " + std::to_string(from.side) + " must be 0 to 2");
  }
  return {shape_of(from), {static_cast<SideKind>(from.side), from.index}};
}

haptic_contact contact_of(const ReportedContact& from) {
  haptic_contact made{};
  made.identity = from.identity;
  made.pair = from.pair;
  made.axis = from.axis;
  made.a_kind = static_cast<std::uint8_t>(from.a.kind);
  made.b_kind = static_cast<std::uint8_t>(from.b.kind);
  made.a_index = from.a.index;
  made.b_index = from.b.index;
  std::ranges::copy(from.p_WC, made.point);
  std::ranges::copy(from.n_W, made.normal);
  made.separation = from.separation;
  made.friction = from.friction;
  made.plane = static_cast<std::uint32_t>(from.plane);
  return made;
}

/// Which shapes may touch, by their groups and masks and what is excluded.
class Filter {
 public:
  Filter(const haptic_shape* shapes, std::size_t count, const std::uint32_t* excluded,
         std::size_t excluded_count) {
    for (std::size_t i = 0; i < count; ++i) groups_.push_back({shapes[i].group, shapes[i].mask});
    for (std::size_t i = 0; i < excluded_count; ++i) {
      if (std::max(excluded[2 * i], excluded[2 * i + 1]) >= count) {
        throw std::invalid_argument("excluded pair " + std::to_string(i) + " of shapes " +
                                    std::to_string(excluded[2 * i]) + " and " +
                                    std::to_string(excluded[2 * i + 1]) + " must be below " +
                                    std::to_string(count) + ", their count");
      }
      excluded_.insert(std::minmax(excluded[2 * i], excluded[2 * i + 1]));
    }
  }
  bool operator()(std::size_t a, std::size_t b) const {
    const std::pair<std::uint32_t, std::uint32_t> pair =
        std::minmax(static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(b));
    return ((groups_[a].group & groups_[b].mask) != 0 ||
            (groups_[b].group & groups_[a].mask) != 0) &&
           !excluded_.contains(pair);
  }

 private:
  struct Groups {
    std::uint32_t group;
    std::uint32_t mask;
  };
  std::vector<Groups> groups_;
  std::set<std::pair<std::uint32_t, std::uint32_t>> excluded_;
};

}  // namespace

struct haptic_proximity {
  ShapeContacts contacts;
  std::vector<Pose> poses;  ///< One for each shape.
};

haptic_proximity* haptic_proximity_open(const haptic_shape* shapes, std::size_t count,
                                        const std::uint32_t* excluded, std::size_t excluded_count,
                                        char* error, std::size_t error_size) {
  try {
    if (shapes == nullptr && count > 0) throw std::invalid_argument("shapes must not be NULL");
    if (excluded == nullptr && excluded_count > 0) {
      throw std::invalid_argument("excluded must not be NULL");
    }
    std::vector<BodyShape> made;
    for (std::size_t i = 0; i < count; ++i) {
      try {
        made.push_back(body_shape_of(shapes[i]));
      } catch (const std::exception& failure) {
        throw std::invalid_argument("shape " + std::to_string(i) + ": " + failure.what());
      }
    }
    const Filter filter(shapes, count, excluded, excluded_count);
    return new haptic_proximity{ShapeContacts(std::move(made), filter), std::vector<Pose>(count)};
  } catch (const std::exception& failure) {
    if (error != nullptr && error_size > 0) {
      const std::string text = failure.what();
      error[text.copy(error, error_size - 1)] = '\0';
    }
    return nullptr;
  }
}

void haptic_proximity_close(haptic_proximity* proximity) { delete proximity; }

std::size_t haptic_proximity_find(haptic_proximity* proximity, const haptic_pose* poses,
                                  double epsilon, haptic_contact* contacts, std::uint32_t* shapes) {
  if (proximity == nullptr || poses == nullptr || contacts == nullptr) return 0;
  for (std::size_t i = 0; i < proximity->poses.size(); ++i) {
    const double* R = poses[i].rotation;
    proximity->poses[i] = {Eigen::Map<const Vector3>(poses[i].position),
                           Quaternion(R[0], R[1], R[2], R[3])};
  }
  std::size_t count = 0;
  for (const auto& [contact, a, b] : proximity->contacts.find(proximity->poses, epsilon)) {
    contacts[count] = contact_of(contact);
    if (shapes != nullptr) {
      shapes[2 * count] = static_cast<std::uint32_t>(a);
      shapes[2 * count + 1] = static_cast<std::uint32_t>(b);
    }
    ++count;
  }
  return count;
}
