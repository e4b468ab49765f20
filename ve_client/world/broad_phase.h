// Which shapes may touch, by their bounding boxes?
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include <ode/ode.h>

#include "hlm/geometry/convex.h"
#include "hlm/ve_client/scene/world_description.h"

namespace hlm::ve {

/// Shapes of bodies other than the tool's, in two of the engine's spaces: of those that move, which
/// are sorted in each step, and of those that stand still, which cost nothing until they are met.
class BroadPhase {
 public:
  /// `bodies`: the engine's, null for fixed ones, in their initial poses. `shapes`: [body][shape].
  /// All bodies that are not fixed move at first.
  BroadPhase(const WorldDescription& description, std::span<const dBodyID> bodies,
             const std::vector<std::vector<Convex>>& shapes, const std::vector<bool>& is_tool);

  using Meet = std::function<void(const CollisionId& first, const CollisionId& second)>;

  /// Says that a body that is not fixed stands still or moves from here on. Not from within a Meet.
  void set_still(int body, bool still);
  /// All pairs of shapes that move.
  void for_moving_pairs(const Meet& meet) const;
  /// All pairs of a shape of the body, which moves, and one that stands still.
  void for_still_near(int body, const Meet& meet) const;

 private:
  template <class T, void (*destroy)(T*)>
  struct Destroy {
    void operator()(T* handle) const { destroy(handle); }
  };
  using Space = std::unique_ptr<dxSpace, Destroy<dxSpace, dSpaceDestroy>>;
  using Geometry = std::unique_ptr<dxGeom, Destroy<dxGeom, dGeomDestroy>>;

  Space moving_;
  Space still_;
  std::vector<CollisionId> ids_;                  ///< Each geometry points to its own.
  std::vector<std::vector<dGeomID>> geometries_;  ///< Geometries of each body that is not fixed.
};

}  // namespace hlm::ve
