// The geoms of a MuJoCo model as a server takes them, and where bodies are.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <mujoco/mujoco.h>

#include "hlm/client/mujoco/bodies.h"
#include "hlm/common/contact.h"
#include "hlm/protocol/scene_offer.h"

namespace hlm::mujoco {

/// Throws std::invalid_argument that names the geom if it is none that a server takes.
inline protocol::SceneShape shape_of(const mjModel& model, int geom) {
  using Kind = protocol::SceneShapeKind;
  const Vector3 size = row3(model.geom_size, geom);
  const auto along_z = [&](Kind kind) {
    return protocol::SceneShape{.kind = kind, .size = {size.x(), 2 * size.y(), 0}};
  };
  switch (model.geom_type[geom]) {
    case mjGEOM_PLANE:
      return {.kind = Kind::kHalfSpace};
    case mjGEOM_SPHERE:
      return {.kind = Kind::kSphere, .size = {size.x(), 0, 0}};
    case mjGEOM_CAPSULE:
      return along_z(Kind::kCapsule);
    case mjGEOM_CYLINDER:
      return along_z(Kind::kCylinder);
    case mjGEOM_ELLIPSOID:
      return {.kind = Kind::kEllipsoid, .size = size};
    case mjGEOM_BOX:
      return {.kind = Kind::kBox, .size = 2 * size};
    case mjGEOM_MESH: {  // MuJoCo collides its convex hull.
      protocol::SceneShape hull{.kind = Kind::kHull};
      const int mesh = model.geom_dataid[geom];
      for (int i = 0; i < model.mesh_vertnum[mesh]; ++i) {
        const float* vertex = model.mesh_vert + 3 * (model.mesh_vertadr[mesh] + i);
        hull.vertices.emplace_back(vertex[0], vertex[1], vertex[2]);
      }
      return hull;
    }
    default:
      throw std::invalid_argument("geom " + std::to_string(geom) + " is of type " +
                                  std::to_string(model.geom_type[geom]) +
                                  ", must be a plane, mesh or basic shape");
  }
}

/// The geoms of one model, with a tool.
class WorldShapes {
 public:
  /// A body that moves.
  struct Moving {
    int body;
    double gap;  ///< How far it is from the tool at least, m; by balls around the geoms.
  };

  /// The model must outlive this. Throws std::invalid_argument that names a geom that cannot be
  /// given.
  WorldShapes(const mjModel& model, int tool) : model_(model), tool_(tool) {
    for (int geom = 0; geom < model.ngeom; ++geom) {
      if (model.geom_contype[geom] == 0 && model.geom_conaffinity[geom] == 0) continue;
      const int body = body_of(model, geom);
      const int welded = model.body_weldid[model.geom_bodyid[geom]];
      const bool is_mocap = body == 0 && model.body_mocapid[welded] >= 0;
      geoms_.push_back({geom, is_mocap ? welded : body});
      priorities_.insert(model.geom_priority[geom]);
    }
    for (int pair = 0; pair < model.npair; ++pair) {
      require_filtered(model.pair_geom1[pair]);
      require_filtered(model.pair_geom2[pair]);
    }
  }

  /// With bodies where they are now.
  protocol::SceneOffer offer(const mjData& data) const {
    protocol::SceneOffer offer;
    for (const auto& [geom, carrier] : geoms_) {
      protocol::OfferedShape& shape = offer.shapes.emplace_back();
      shape.shape = shape_of(model_, geom);
      shape.X_BS = {row3(data.geom_xpos, geom), turn_of(data.geom_xmat + 9 * geom)};
      if (carrier != 0) {
        shape.X_BS = pose_of(data, carrier).inverse() * shape.X_BS;
        shape.side = carrier == tool_
                         ? ContactSide{SideKind::kToolLink, 0}
                         : ContactSide{SideKind::kMovableBody, static_cast<std::uint32_t>(carrier)};
      }
      const auto rank =
          std::distance(priorities_.begin(), priorities_.find(model_.geom_priority[geom]));
      shape.friction = {row3(model_.geom_friction, geom).x(), FrictionRule::kMaximum,
                        static_cast<std::uint8_t>(std::min<std::ptrdiff_t>(rank, 255))};
      shape.group = static_cast<std::uint32_t>(model_.geom_contype[geom]);
      shape.mask = static_cast<std::uint32_t>(model_.geom_conaffinity[geom]);
    }
    for (std::uint32_t i = 0; i < geoms_.size(); ++i) {
      for (std::uint32_t j = 0; j < i; ++j) {
        if (are_apart(geoms_[i].number, geoms_[j].number)) offer.apart.emplace_back(j, i);
      }
    }
    return offer;
  }

  /// All but the tool, the nearest to it first.
  std::vector<Moving> moving(const mjData& data) const {
    std::map<int, double> gaps;
    for (const auto& [geom, carrier] : geoms_) {
      if (carrier == 0 || carrier == tool_) continue;
      const auto known = gaps.try_emplace(carrier, std::numeric_limits<double>::infinity()).first;
      for (const auto& [own, of] : geoms_) {
        if (of != tool_) continue;
        const double away = (row3(data.geom_xpos, geom) - row3(data.geom_xpos, own)).norm();
        const double gap = away - model_.geom_rbound[geom] - model_.geom_rbound[own];
        known->second = std::min(known->second, gap);
      }
    }
    std::vector<Moving> found;
    for (const auto& [body, gap] : gaps) found.push_back({body, gap});
    std::ranges::stable_sort(found, {}, &Moving::gap);
    return found;
  }

  /// Adds what touches one of the bodies, and what touches that, and so on, but for the tool: what
  /// lies on a body moves with it.
  void add_touching(const mjData& data, std::vector<int>& bodies) const {
    for (std::size_t known = 0; known < bodies.size(); ++known) {
      for (int i = 0; i < data.ncon; ++i) {
        const int geom1 = data.contact[i].geom1;
        const int geom2 = data.contact[i].geom2;
        if (geom1 < 0 || geom2 < 0) continue;  // A flex.
        const int first = body_of(model_, geom1);
        const int second = body_of(model_, geom2);
        if (first != bodies[known] && second != bodies[known]) continue;
        const int other = first == bodies[known] ? second : first;
        if (other == 0 || other == tool_) continue;
        if (std::ranges::find(bodies, other) == bodies.end()) bodies.push_back(other);
      }
    }
  }

  bool is_mocap(int body) const { return model_.body_mocapid[body] >= 0; }

  /// Where they are, and how they move. period: since the frame before, s.
  BodyPoses poses_of(const mjData& data, const std::vector<Moving>& bodies, double period) {
    BodyPoses poses;
    for (const auto& [body, gap] : bodies) {
      if (poses.size() == poses.capacity()) break;
      BodyPose& pose = poses.emplace_back();
      pose.body = static_cast<std::uint32_t>(body);
      pose.X_WB = pose_of(data, body);
      if (is_mocap(body)) {  // MuJoCo knows no velocity of it.
        const auto before = mocap_before_.try_emplace(body, pose.X_WB.p).first;
        pose.V_W.head<3>() = (pose.X_WB.p - before->second) / period;
        before->second = pose.X_WB.p;
        continue;
      }
      mjtNum velocity[6];  // The angular part first.
      mj_objectVelocity(&model_, &data, mjOBJ_XBODY, body, velocity, 0);
      pose.V_W << row3(velocity, 1), row3(velocity, 0);
    }
    return poses;
  }

 private:
  struct Geom {
    int number;
    int carrier;  ///< The body that it moves with; 0: it stands still.
  };

  static Quaternion turn_of(const mjtNum* matrix) {
    return Quaternion(
               Matrix3(Eigen::Map<const Eigen::Matrix<mjtNum, 3, 3, Eigen::RowMajor>>(matrix)))
        .normalized();
  }
  static Pose pose_of(const mjData& data, int body) {
    return {row3(data.xpos, body), rotation_of(data.xquat + 4 * body)};
  }

  void require_filtered(int geom) const {
    const bool is_known = std::ranges::find(geoms_, geom, &Geom::number) != geoms_.end();
    if (is_known) return;
    throw std::invalid_argument("geom " + std::to_string(geom) +
                                " collides by <pair> alone; give it a contype");
  }

  /// Bodies and their parents, and what the model excludes, which it names by the bodies before
  /// welding.
  bool are_apart(int a, int b) const {
    const int own_a = model_.geom_bodyid[a];
    const int own_b = model_.geom_bodyid[b];
    const int body_a = model_.body_weldid[own_a];
    const int body_b = model_.body_weldid[own_b];
    const auto parent = [&](int body) { return model_.body_weldid[model_.body_parentid[body]]; };
    const bool moves = body_a != 0 && body_b != 0;
    if (moves && (body_a == parent(body_b) || body_b == parent(body_a))) return true;
    const int base = is_since(3, 0) ? 0 : 1;
    for (int i = 0; i < model_.nexclude; ++i) {
      const int first = (model_.exclude_signature[i] >> 16) - base;
      const int second = (model_.exclude_signature[i] & 0xffff) - base;
      if (std::minmax(first, second) == std::minmax(own_a, own_b)) return true;
    }
    return false;
  }

  const mjModel& model_;
  int tool_;
  std::vector<Geom> geoms_;
  std::set<int> priorities_;
  std::map<int, Vector3> mocap_before_;  ///< Where they were in the frame before, m.
};

}  // namespace hlm::mujoco
