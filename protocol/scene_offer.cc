#include "hlm/protocol/scene_offer.h"

#include <span>
#include <stdexcept>
#include <string>

#include "hlm/common/friction_limit.h"
#include "hlm/protocol/scene_store.h"

namespace hlm::protocol {
namespace {

/// Reads what a server will read, so that what it would refuse is said here.
class Check {
 public:
  explicit Check(std::size_t tool_links) : store_(tool_links) {}

  void take(const SceneRecord& record) {
    std::vector<std::uint8_t> bytes;
    append(record, bytes);
    reader_.feed(std::as_bytes(std::span(bytes)));
    while (auto read = reader_.next()) store_.apply(std::move(*read));
    if (reader_.fault()) throw std::invalid_argument(reader_.fault()->text);
    if (store_.fault()) throw std::invalid_argument(store_.fault()->text);
  }

 private:
  SceneRecordReader reader_;
  SceneStore store_;
};

ScenePlacement placement_of(std::uint32_t id, const OfferedShape& offered, std::uint64_t hash) {
  Friction friction = offered.friction;
  friction.coefficient = usable_friction(friction.coefficient);
  return {.id = id,
          .shape = hash,
          .side = offered.side,
          .X_BS = offered.X_BS,
          .friction = friction,
          .group = offered.group,
          .mask = offered.mask};
}

}  // namespace

std::vector<std::uint8_t> scene_of(const SceneOffer& offer, std::size_t tool_links,
                                   OfferedBefore& before, bool inertias) {
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 0; i < before.shapes; ++i) {
    append(SceneRemoval{static_cast<std::uint32_t>(i)}, bytes);
  }
  Check check(tool_links);
  OfferedBefore now{.scene = before.scene + 1, .shapes = offer.shapes.size()};
  const auto add = [&](const SceneRecord& record) {
    check.take(record);
    append(record, bytes);
  };
  for (std::size_t i = 0; i < offer.shapes.size(); ++i) {
    const OfferedShape& offered = offer.shapes[i];
    try {
      const std::uint64_t hash = hash_of(offered.shape);
      if (now.hashes.insert(hash).second) {
        check.take(offered.shape);
        if (!before.hashes.contains(hash)) append(offered.shape, bytes);
      }
      add(placement_of(static_cast<std::uint32_t>(i), offered, hash));
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument("shape " + std::to_string(i) + ": " + error.what());
    }
  }
  for (const auto& [a, b] : offer.apart) add(SceneApart{.a = a, .b = b});
  for (const BodyInertia& inertia : offer.inertias) {
    check.take(inertia);
    if (inertias) append(inertia, bytes);
  }
  for (const BodyJoint& joint : offer.joints) {
    check.take(joint);
    if (inertias) append(joint, bytes);
  }
  append(SceneCommit{.scene = now.scene}, bytes);
  before = std::move(now);
  return bytes;
}

}  // namespace hlm::protocol
