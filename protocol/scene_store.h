// What the scene stream has brought so far: shapes by their hash, placements by their id.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "hlm/protocol/scene_records.h"

namespace hlm::protocol {

/// The holder of one session's records. Plain: no threads. After a fault nothing is taken any more,
/// and what is held stays as it was.
class SceneStore {
 public:
  /// `tool_links`: how many the tool has, which placements are on.
  explicit SceneStore(std::size_t tool_links, const SceneLimits& limits = {})
      : tool_links_(tool_links), limits_(limits) {}

  /// Takes one record. False if it cannot be used, or one before could not: fault() says why. A
  /// shape that is there already is ignored. A commit drops the shapes that no placement has.
  bool apply(SceneRecord record);
  /// Somebody else found a fault, for example the reader, or who makes surfaces of the shapes. The
  /// first one stays.
  void refuse(SceneFault fault);

  const std::optional<SceneFault>& fault() const noexcept { return fault_; }
  /// Number of the latest commit; 0 before the first.
  std::uint32_t scene() const noexcept { return scene_; }
  const std::map<std::uint32_t, ScenePlacement>& placements() const noexcept { return placements_; }
  /// Of those bodies that the server may move.
  const std::map<std::uint32_t, BodyInertia>& inertias() const noexcept { return inertias_; }
  /// By the body that hangs on them.
  const std::map<std::uint32_t, BodyJoint>& joints() const noexcept { return joints_; }
  /// The shape of that hash, which outlives the store for whoever keeps it; null if there is none.
  std::shared_ptr<const SceneShape> shape(std::uint64_t hash) const;
  std::size_t shapes() const noexcept { return shapes_.size(); }
  /// Bytes that the shapes take.
  std::size_t bytes() const noexcept { return bytes_; }
  /// Pairs of placements that never touch, the smaller id first.
  std::vector<SceneApart> apart() const;
  bool are_apart(std::uint32_t a, std::uint32_t b) const { return apart_.contains({a, b}); }

  /// Fills in received_scene, shapes, placements, bytes, and of a fault error, item and text.
  void describe(SceneState& state) const noexcept;

 private:
  struct Held {
    std::shared_ptr<const SceneShape> shape;
    std::size_t uses = 0;  ///< Placements that have it.
  };

  void take(SceneShape&& shape);
  void take(const ScenePlacement& placement);
  void take(const SceneRemoval& removal);
  void take(const SceneApart& apart);
  void take(const SceneCommit& commit);
  void take(const BodyInertia& inertia);
  void take(const BodyJoint& joint);
  bool may_be_placed(const ScenePlacement& placement);

  std::size_t tool_links_;
  SceneLimits limits_;
  std::map<std::uint64_t, Held> shapes_;
  std::map<std::uint32_t, ScenePlacement> placements_;
  std::map<std::uint32_t, BodyInertia> inertias_;
  std::map<std::uint32_t, BodyJoint> joints_;
  std::set<std::pair<std::uint32_t, std::uint32_t>> apart_;  ///< Each pair in both orders.
  std::size_t bytes_ = 0;
  std::uint32_t scene_ = 0;
  std::optional<SceneFault> fault_;
};

}  // namespace hlm::protocol
