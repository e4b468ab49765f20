#include "hlm/haptic_server/scene/scene.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "hlm/geometry/work.h"
#include "hlm/haptic_server/scene/join_boxes.h"
#include "hlm/haptic_server/scene/thin_out.h"

namespace hlm::server {
namespace {

using namespace geometry;

std::size_t at(int index) { return static_cast<std::size_t>(index); }

/// Most pairs and contacts that are found at once. What is beyond is left out, and counted.
constexpr FinderRoom kRoom{.pairs = 4096, .contacts = 2048};

/// Of a search's work what is left to choose the most telling contacts: one part in so many.
constexpr std::uint64_t kToThinOut = 10;

/// Pieces that may adjoin or overlap one, on the mean. In a mesh they are some twelve; of thousands
/// in one place the loader would take minutes and gigabytes.
constexpr std::size_t kMostAdjoining = 200;

/// Where what is not there is, m: the search for what is near passes it by.
const Pose kNowhere{Vector3::Constant(1e8), Quaternion::Identity()};

/// Normal of the plane in which a planar tool moves.
std::optional<Vector3> planar_normal(const ToolDescription& tool) {
  if (tool.links[0].joint != JointType::kPlanar) return std::nullopt;
  return tool.links[0].X_PJ.R * Vector3::UnitZ();
}

}  // namespace

void require_place(const PlacedShape& shape, const ToolDescription& tool) {
  const bool half_space =
      !shape.shape->pieces.empty() && shape.shape->pieces.front().is_half_space();
  if (half_space && shape.side.kind != SideKind::kWorld) {
    throw std::invalid_argument("a half-space must be the world's");
  }
  if (shape.side.kind == SideKind::kMovableBody && !shape.shape->solids.empty()) {
    throw std::invalid_argument("solids must be the world's");
  }
  if (shape.side.kind != SideKind::kToolLink) return;
  if (shape.side.index >= tool.links.size()) {
    throw std::invalid_argument("link " + std::to_string(shape.side.index) +
                                " must be one of the tool's " + std::to_string(tool.links.size()));
  }
  if (shape.shape->is_mesh()) {
    throw std::invalid_argument("a mesh of the tool must be convex: divide it into hulls");
  }
}

Scene::Scene(std::vector<PlacedShape> shapes,
             std::span<const std::pair<std::uint32_t, std::uint32_t>> apart,
             const ToolDescription& tool, std::span<const BodyInertia> inertias,
             std::span<const BodyJoint> joints)
    : shapes_(std::move(shapes)),
      tool_(tool),
      inertias_(inertias.begin(), inertias.end()),
      planar_normal_W_(planar_normal(tool)) {
  std::ranges::sort(inertias_, {}, &BodyInertia::body);
  mechanisms_ = mechanisms_of(inertias_, joints);
  for (PlacedShape& shape : shapes_) {
    if (shape.side.kind == SideKind::kWorld) shape.side.index = 0;  // All of it is one surface.
  }
  for (const auto& [a, b] : apart) apart_.push_back(std::minmax(a, b));
  std::ranges::sort(apart_);
  join_boxes(shapes_, apart_);
  gather_bodies();
  make_finder();
}

/// The world, the links and bodies that have shapes, by side.
void Scene::gather_bodies() {
  std::vector<ContactSide> sides{{SideKind::kWorld, 0}};
  for (const PlacedShape& shape : shapes_) sides.push_back(shape.side);
  std::ranges::sort(sides);
  sides.erase(std::unique(sides.begin(), sides.end()), sides.end());
  for (const ContactSide& side : sides) bodies_.push_back({.side = side});
  bodies_.front().is_placed = true;
}

void Scene::make_finder() {
  std::vector<PieceSource> sources;
  for (std::size_t i = 0; i < shapes_.size(); ++i) {
    const PlacedShape& shape = shapes_[i];
    if (!shape.shape) continue;  // Another box includes it.
    const std::size_t index = *find_body(shape.side);
    Body& body = bodies_[index];
    const bool is_skin = shape.shape->is_skin();
    const auto add = [&](PieceSource source) {
      source.id = {static_cast<int>(index), static_cast<int>(body.shape_of.size())};
      source.X_FG = shape.X_BS;
      source.fixed = shape.side.kind == SideKind::kWorld;
      source.friction = shape.friction;
      sources.push_back(source);
      body.shape_of.push_back(static_cast<std::uint32_t>(i));
    };
    for (const MeshSolid& solid : shape.shape->solids) add({.id = {}, .X_FG = {}, .solid = &solid});
    for (std::size_t k = 0; k < shape.shape->pieces.size(); ++k) {
      add({.id = {},
           .convex = &shape.shape->pieces[k],
           .X_FG = {},
           .mesh = is_skin ? shape.shape->skins[k] : nullptr,
           .triangle = is_skin ? shape.shape->triangles[k] : 0});
      const Eigen::AlignedBox3d box = shape.shape->pieces[k].bounds(shape.X_BS);
      body.reach = std::max(body.reach, box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).norm());
    }
  }
  piece_count_ = sources.size();
  // Touched once, so that the loop meets no page for the first time.
  found_.resize((1 + kMaxMovedBodies) * kMaxSelected);
  found_.clear();
  telling_.resize(kRoom.contacts);
  telling_.clear();
  std::ranges::stable_sort(sources, {}, &PieceSource::id);
  pieces_ = std::make_unique<Pieces>(sources, kMostAdjoining);

  std::vector<ContactFinder::Body> bodies;
  for (const Body& body : bodies_) {
    const bool is_link = body.side.kind == SideKind::kToolLink;
    if (is_link) links_.push_back(static_cast<int>(bodies.size()));
    bodies.push_back({.link = is_link ? static_cast<int>(body.side.index) : -1,
                      .movable = body.side.kind == SideKind::kMovableBody});
  }
  finder_ = std::make_unique<ContactFinder>(
      *pieces_, std::move(bodies),
      [this](const CollisionId& a, const CollisionId& b) { return may_touch(a, b); },
      planar_normal_W_, kRoom);
  for (std::size_t i = 1; i < bodies_.size(); ++i) finder_->place(static_cast<int>(i), kNowhere);
}

std::optional<std::size_t> Scene::find_body(const ContactSide& side) const noexcept {
  const auto found = std::ranges::lower_bound(bodies_, side, {}, &Body::side);
  if (found == bodies_.end() || found->side != side) return std::nullopt;
  return static_cast<std::size_t>(found - bodies_.begin());
}

void Scene::place(const ContactSide& side, const std::optional<Pose>& X_WB) noexcept {
  const auto index = find_body(side);
  if (!index || side.kind == SideKind::kWorld) return;
  bodies_[*index].is_placed = X_WB.has_value();
  finder_->place(static_cast<int>(*index), X_WB.value_or(kNowhere));
}

bool Scene::may_touch(const CollisionId& a, const CollisionId& b) const noexcept {
  const Body& body_a = bodies_[at(a.body)];
  const Body& body_b = bodies_[at(b.body)];
  if (!body_a.is_placed || !body_b.is_placed) return false;
  if (body_b.side.kind == SideKind::kToolLink) {
    const auto link_a = static_cast<int>(body_a.side.index);
    const auto link_b = static_cast<int>(body_b.side.index);
    if (body_a.side.kind != SideKind::kToolLink || link_b >= link_a) return false;
    if (are_joined(tool_, link_a, link_b)) return false;
  }
  const std::uint32_t shape_a = body_a.shape_of[at(a.shape)];
  const std::uint32_t shape_b = body_b.shape_of[at(b.shape)];
  const PlacedShape& one = shapes_[shape_a];
  const PlacedShape& other = shapes_[shape_b];
  if ((one.group & other.mask) == 0 && (other.group & one.mask) == 0) return false;
  return !std::ranges::binary_search(
      apart_, std::pair{std::min(shape_a, shape_b), std::max(shape_a, shape_b)});
}

const BodyInertia* Scene::inertia(std::uint32_t body) const noexcept {
  const auto found = std::ranges::lower_bound(inertias_, body, {}, &BodyInertia::body);
  return found == inertias_.end() || found->body != body ? nullptr : &*found;
}

const Mechanism* Scene::mechanism(std::uint32_t body) const noexcept {
  for (const Mechanism& mechanism : mechanisms_) {
    for (std::size_t i = 0; i < mechanism.size(); ++i) {
      if (mechanism.body(i) == body) return &mechanism;
    }
  }
  return nullptr;
}

double Scene::reach(const ContactSide& side) const noexcept {
  const auto index = find_body(side);
  return index ? bodies_[*index].reach : 0;
}

std::span<const FoundContact> Scene::of_tool(double epsilon, std::uint64_t work) noexcept {
  return find(links_, {.epsilon = epsilon, .of_tool = true, .work = work});
}

std::span<const FoundContact> Scene::of_tool_ahead(double epsilon, std::uint64_t work) noexcept {
  return find(links_, {.epsilon = epsilon, .of_tool = true, .remembers = false, .work = work});
}

std::span<const FoundContact> Scene::of_body(std::uint32_t id, double epsilon,
                                             std::uint64_t work) noexcept {
  const auto index = find_body({SideKind::kMovableBody, id});
  if (!index || !bodies_[*index].is_placed) return {};
  const auto body = static_cast<int>(*index);
  return find({&body, 1}, {.epsilon = epsilon, .work = work});
}

std::span<const FoundContact> Scene::find(std::span<const int> bodies,
                                          const ContactFinder::Search& search) noexcept {
  const Work::Allowance allowance(search.work);
  ContactFinder::Search of_pairs = search;
  of_pairs.keeps_all_sides = true;
  of_pairs.work -= search.work / kToThinOut;
  const auto found = finder_->find(bodies, of_pairs);
  telling_.assign(found.begin(), found.end());
  for (FoundContact& contact : telling_) {
    contact.key.a = bodies_[at(contact.own.body)].side;
    contact.key.b = bodies_[at(contact.other.body)].side;
  }
  thin_out(telling_, search.of_tool ? planar_normal_W_ : std::nullopt, kMaxSelected);
  if (found_.size() + telling_.size() > found_.capacity()) return {};
  const std::size_t first = found_.size();
  found_.insert(found_.end(), telling_.begin(), telling_.end());
  return std::span(found_).subspan(first);
}

}  // namespace hlm::server
