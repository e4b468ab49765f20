#include "hlm/protocol/scene_store.h"

#include <string>

#include "hlm/protocol/text.h"

namespace hlm::protocol {
namespace {

/// Bytes that a shape takes, with what manages it.
std::size_t bytes_of(const SceneShape& shape) noexcept {
  constexpr std::size_t kManagement = 64;
  return sizeof shape + kManagement + shape.vertices.size() * sizeof(shape.vertices[0]) +
         shape.triangles.size() * sizeof(shape.triangles[0]);
}

std::string placement_name(std::uint32_t id) { return "placement " + std::to_string(id); }

SceneFault over_limit(const char* what, std::size_t count, std::size_t most,
                      std::uint32_t item = 0) {
  return {
      SceneError::kLimit, item,
      std::string(what) + " " + std::to_string(count) + " must be at most " + std::to_string(most)};
}

}  // namespace

bool SceneStore::apply(SceneRecord record) {
  if (fault_) return false;
  std::visit([this](auto& one) { take(std::move(one)); }, record);
  return !fault_;
}

void SceneStore::refuse(SceneFault fault) {
  if (!fault_) fault_ = std::move(fault);
}

void SceneStore::take(SceneShape&& shape) {
  if (shapes_.contains(shape.hash)) return;
  const std::size_t bytes = bytes_ + bytes_of(shape);
  if (bytes > limits_.shape_bytes) {
    return refuse(over_limit("bytes of all shapes", bytes, limits_.shape_bytes));
  }
  bytes_ = bytes;
  const std::uint64_t hash = shape.hash;
  shapes_[hash].shape = std::make_shared<const SceneShape>(std::move(shape));
}

void SceneStore::take(const ScenePlacement& placement) {
  if (!may_be_placed(placement)) return;
  ++shapes_.at(placement.shape).uses;
  placements_.emplace(placement.id, placement);
}

bool SceneStore::may_be_placed(const ScenePlacement& placement) {
  const std::uint32_t id = placement.id;
  const auto wrong = [&](SceneError error, const std::string& why) {
    refuse({error, id, placement_name(id) + why});
    return false;
  };
  if (placements_.contains(id)) {
    return wrong(SceneError::kDuplicate, " is there already; it must be removed first");
  }
  const auto held = shapes_.find(placement.shape);
  if (held == shapes_.end()) {
    return wrong(SceneError::kUnknownShape, " has a shape that is not there; it must come before");
  }
  if (placements_.size() >= limits_.placements) {
    refuse(over_limit("placements", placements_.size() + 1, limits_.placements, id));
    return false;
  }
  const ContactSide& side = placement.side;
  if (side.kind == SideKind::kToolLink && side.index >= tool_links_) {
    return wrong(SceneError::kSide, " is on link " + std::to_string(side.index) +
                                        " of the tool; it must be below " +
                                        std::to_string(tool_links_));
  }
  const bool is_half_space = held->second.shape->kind == SceneShapeKind::kHalfSpace;
  if (is_half_space && side.kind != SideKind::kWorld) {
    return wrong(SceneError::kGeometry, " is a half space of " + std::string(name_of(side.kind)) +
                                            "; it must be of the world");
  }
  return true;
}

void SceneStore::take(const SceneRemoval& removal) {
  const auto found = placements_.find(removal.id);
  if (found == placements_.end()) {
    return refuse({SceneError::kUnknownPlacement, removal.id,
                   placement_name(removal.id) + " is to be removed; it must be there"});
  }
  --shapes_.at(found->second.shape).uses;
  const ContactSide side = found->second.side;
  if (side.kind == SideKind::kMovableBody) {
    inertias_.erase(side.index);
    joints_.erase(side.index);
  }
  placements_.erase(found);
  std::vector<std::pair<std::uint32_t, std::uint32_t>> reversed;
  auto pair = apart_.lower_bound({removal.id, 0});
  while (pair != apart_.end() && pair->first == removal.id) {
    reversed.push_back({pair->second, pair->first});
    pair = apart_.erase(pair);
  }
  for (const auto& each : reversed) apart_.erase(each);
}

void SceneStore::take(const SceneApart& apart) {
  for (const std::uint32_t id : {apart.a, apart.b}) {
    if (placements_.contains(id)) continue;
    return refuse({SceneError::kUnknownPlacement, id,
                   placement_name(id) + " is to be apart from another; it must be there"});
  }
  if (apart.a == apart.b) {
    return refuse({SceneError::kMalformed, apart.a,
                   placement_name(apart.a) + " is to be apart from itself; it must be another"});
  }
  if (are_apart(apart.a, apart.b)) return;
  const std::size_t pairs = apart_.size() / 2 + 1;
  if (pairs > limits_.apart) return refuse(over_limit("pairs apart", pairs, limits_.apart));
  apart_.insert({apart.a, apart.b});
  apart_.insert({apart.b, apart.a});
}

void SceneStore::take(const SceneCommit& commit) {
  if (commit.scene <= scene_) {
    return refuse({SceneError::kOrder, 0,
                   "commit " + std::to_string(commit.scene) + " must be above the one before, " +
                       std::to_string(scene_)});
  }
  scene_ = commit.scene;
  for (auto held = shapes_.begin(); held != shapes_.end();) {
    if (held->second.uses > 0) {
      ++held;
      continue;
    }
    bytes_ -= bytes_of(*held->second.shape);
    held = shapes_.erase(held);
  }
}

void SceneStore::take(const BodyInertia& inertia) {
  if (!inertias_.contains(inertia.body) && inertias_.size() >= limits_.placements) {
    return refuse(over_limit("inertias", inertias_.size() + 1, limits_.placements, inertia.body));
  }
  inertias_[inertia.body] = inertia;
}

void SceneStore::take(const BodyJoint& joint) {
  if (!joints_.contains(joint.body) && joints_.size() >= limits_.placements) {
    return refuse(over_limit("joints", joints_.size() + 1, limits_.placements, joint.body));
  }
  joints_[joint.body] = joint;
}

std::shared_ptr<const SceneShape> SceneStore::shape(std::uint64_t hash) const {
  const auto held = shapes_.find(hash);
  return held == shapes_.end() ? nullptr : held->second.shape;
}

std::vector<SceneApart> SceneStore::apart() const {
  std::vector<SceneApart> pairs;
  for (const auto& [a, b] : apart_) {
    if (a < b) pairs.push_back({a, b});
  }
  return pairs;
}

void SceneStore::describe(SceneState& state) const noexcept {
  state.received_scene = scene_;
  state.shapes = static_cast<std::uint32_t>(shapes_.size());
  state.placements = static_cast<std::uint32_t>(placements_.size());
  state.bytes = bytes_;
  state.error = fault_ ? fault_->error : SceneError::kNone;
  state.item = fault_ ? fault_->item : 0;
  state.text = fault_ ? to_text(fault_->text) : Text{};
}

}  // namespace hlm::protocol
