#include "haptic_proximity.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "hlm/geometry/convex.h"
#include "hlm/geometry/manifold.h"

namespace {

using namespace hlm;
using namespace hlm::geometry;

/// Most contacts of the tool; the others are left for the bodies' own.
constexpr std::size_t kMostOfTool = 128;

Shape shape_of(const haptic_shape& from) {
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
    case HAPTIC_HALF_SPACE:
      if (from.side != HAPTIC_WORLD)
        throw std::invalid_argument("a half-space must be the world's");
      return HalfSpace{};
    case HAPTIC_HULL: {
      Hull hull;
      if (from.vertices == nullptr) throw std::invalid_argument("a hull must have vertices");
      for (std::uint32_t i = 0; i < from.vertex_count; ++i) {
        hull.vertices.emplace_back(Eigen::Map<const Vector3>(from.vertices + std::size_t{3} * i));
      }
      return hull;
    }
    default:
      throw std::invalid_argument("kind " + std::to_string(from.kind) + " must be 0 to 6");
  }
}

struct Piece {
  explicit Piece(const haptic_shape& from)
      : convex(shape_of(from)),
        side{static_cast<SideKind>(from.side), from.index},
        group(from.group),
        mask(from.mask) {
    if (from.side < HAPTIC_WORLD || from.side > HAPTIC_MOVABLE_BODY) {
      throw std::invalid_argument("side " + std::to_string(from.side) + " must be 0 to 2");
    }
  }
  Convex convex;
  ContactSide side;
  std::uint32_t group;
  std::uint32_t mask;
};

/// Contacts of one pair.
using PairContacts = std::vector<haptic_contact>;

double separation(const PairContacts& pair) {
  return std::ranges::min(pair, {}, &haptic_contact::separation).separation;
}

/// Whole pairs, nearest first, as many as there is room for.
void append(std::vector<PairContacts>& pairs, std::size_t most, std::vector<haptic_contact>& to) {
  std::ranges::sort(pairs, {}, separation);
  for (const PairContacts& pair : pairs) {
    if (to.size() + pair.size() <= most) to.insert(to.end(), pair.begin(), pair.end());
  }
}

}  // namespace

struct haptic_proximity {
  using Index = std::uint32_t;

  haptic_proximity(const haptic_shape* shapes, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      try {
        pieces.emplace_back(shapes[i]);
      } catch (const std::exception& error) {
        throw std::invalid_argument("shape " + std::to_string(i) + ": " + error.what());
      }
    }
  }

  /// Side a takes the normal: the tool, else a body.
  bool may_touch(Index a, Index b) const {
    const Piece& A = pieces[a];
    const Piece& B = pieces[b];
    return A.side != B.side && B.side.kind != SideKind::kToolLink &&
           ((A.group & B.mask) != 0 || (B.group & A.mask) != 0) &&
           !excluded.contains(std::minmax(a, b));
  }

  PairContacts touch(Index a, Index b, double epsilon) {
    const Pose& X_WA = poses[a];
    const Pose& X_WB = poses[b];
    const bool of_tool = pieces[a].side.kind == SideKind::kToolLink;
    const bool keeps_side = of_tool && pieces[b].side.kind == SideKind::kMovableBody;
    std::optional<Vector3> before_B;
    if (const auto known = sides_before.find({a, b}); known != sides_before.end()) {
      before_B = known->second;
    }
    AxesManifold manifold;
    if (of_tool) {
      manifold =
          find_axes(pieces[a].convex, X_WA, pieces[b].convex, X_WB, epsilon, statistics, before_B);
    } else {
      const Manifold best =
          find_contacts(pieces[a].convex, X_WA, pieces[b].convex, X_WB, epsilon, statistics);
      manifold.assign(best.begin(), best.end());
    }
    if (keeps_side && !manifold.empty()) {
      sides[{a, b}] = X_WB.R.conjugate() * manifold.front().n_W;
    }
    PairContacts found;
    for (const ManifoldPoint& point : manifold) found.push_back(contact(a, b, point));
    return found;
  }

  haptic_contact contact(Index a, Index b, const ManifoldPoint& point) const {
    ContactKey key{pieces[a].side, point.tool_feature, pieces[b].side, point.body_feature,
                   point.face};
    key.a_feature.shape = a;
    key.b_feature.shape = b;
    haptic_contact made{};
    made.identity = identity_of(key);
    made.pair = a * static_cast<Index>(pieces.size()) + b;
    made.axis = point.axis;
    made.a_kind = static_cast<std::uint8_t>(pieces[a].side.kind);
    made.b_kind = static_cast<std::uint8_t>(pieces[b].side.kind);
    made.a_index = pieces[a].side.index;
    made.b_index = pieces[b].side.index;
    std::ranges::copy(point.p_WC, made.point);
    std::ranges::copy(point.n_W, made.normal);
    made.separation = point.separation;
    made.friction = -1;
    made.plane = static_cast<std::uint32_t>(plane_of(point.tool_feature, point.body_feature));
    return made;
  }

  /// Contacts of a side's shapes with all others that `takes` says.
  template <class Takes>
  std::vector<PairContacts> query(const ContactSide& side, double epsilon, Takes takes) {
    std::vector<PairContacts> found;
    for (Index a = 0; a < pieces.size(); ++a) {
      if (pieces[a].side != side) continue;
      Eigen::AlignedBox3d reach = bounds[a];
      reach.min().array() -= epsilon;
      reach.max().array() += epsilon;
      for (Index b = 0; b < pieces.size(); ++b) {
        if (!may_touch(a, b) || !takes(pieces[b].side) || !reach.intersects(bounds[b])) continue;
        PairContacts pair = touch(a, b, epsilon);
        if (!pair.empty()) found.push_back(std::move(pair));
      }
    }
    return found;
  }

  std::vector<Piece> pieces;
  std::set<std::pair<Index, Index>> excluded;
  std::vector<Pose> poses;                                  ///< Poses of the pieces, world.
  std::vector<Eigen::AlignedBox3d> bounds;                  ///< Bounds of the pieces, world.
  std::map<std::pair<Index, Index>, Vector3> sides_before;  ///< Normals, frame of b, a step ago;
  std::map<std::pair<Index, Index>, Vector3> sides;         ///< now. Of the tool with bodies.
  ProximityStatistics statistics;
};

haptic_proximity* haptic_proximity_open(const haptic_shape* shapes, std::size_t count,
                                        const std::uint32_t* excluded, std::size_t excluded_count,
                                        char* error, std::size_t error_size) {
  try {
    auto made = std::make_unique<haptic_proximity>(shapes, count);
    for (std::size_t i = 0; i < excluded_count; ++i) {
      made->excluded.insert(std::minmax(excluded[2 * i], excluded[2 * i + 1]));
    }
    return made.release();
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
                                  double epsilon, haptic_contact* contacts) {
  haptic_proximity& all = *proximity;
  all.poses.clear();
  all.bounds.clear();
  for (std::size_t i = 0; i < all.pieces.size(); ++i) {
    const double* R = poses[i].rotation;
    const Pose X_WS{Eigen::Map<const Vector3>(poses[i].position),
                    Quaternion(R[0], R[1], R[2], R[3])};
    const bool usable =
        X_WS.p.allFinite() && X_WS.R.coeffs().allFinite() && X_WS.R.squaredNorm() > 0;
    all.poses.push_back({X_WS.p, X_WS.R.normalized()});
    all.bounds.push_back(usable ? all.pieces[i].convex.bounds(all.poses.back())
                                : Eigen::AlignedBox3d());
  }
  all.sides_before = std::exchange(all.sides, {});

  std::vector<haptic_contact> found;
  std::set<ContactSide> links, bodies;
  for (const Piece& piece : all.pieces) {
    if (piece.side.kind == SideKind::kToolLink) links.insert(piece.side);
  }
  std::vector<PairContacts> of_tool;
  for (const ContactSide& link : links) {
    for (PairContacts& pair : all.query(link, epsilon, [](const ContactSide&) { return true; })) {
      of_tool.push_back(std::move(pair));
    }
  }
  append(of_tool, kMostOfTool, found);
  const auto add_body = [&](std::uint8_t kind, std::uint32_t index) {
    if (kind == HAPTIC_MOVABLE_BODY) bodies.insert({SideKind::kMovableBody, index});
  };
  for (const haptic_contact& contact : found) add_body(contact.b_kind, contact.b_index);
  std::set<ContactSide> done;
  std::vector<PairContacts> of_bodies;
  for (int hop = 0; hop < 2; ++hop) {
    for (const ContactSide& body : std::set(bodies)) {
      if (done.contains(body)) continue;
      const auto is_new = [&](const ContactSide& other) { return !done.contains(other); };
      for (PairContacts& pair : all.query(body, epsilon, is_new)) {
        add_body(pair.front().b_kind, pair.front().b_index);
        of_bodies.push_back(std::move(pair));
      }
      done.insert(body);
    }
  }
  append(of_bodies, HAPTIC_MAX_CONTACTS, found);
  std::ranges::copy(found, contacts);
  return found.size();
}
