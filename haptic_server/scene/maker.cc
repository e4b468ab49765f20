#include "hlm/haptic_server/scene/maker.h"

#include <stdexcept>
#include <string>
#include <utility>

#include "hlm/geometry/interruption.h"
#include "hlm/haptic_server/scene/scene_shapes.h"

namespace hlm::server {
namespace {

using protocol::SceneError;
using protocol::SceneFault;

/// Why no scene can be made.
struct Unusable : std::runtime_error {
  explicit Unusable(const SceneFault& what)
      : std::runtime_error(what.text), error(what.error), item(what.item) {}
  SceneError error;
  std::uint32_t item;
};

Unusable unusable(std::uint32_t placement, const std::string& why) {
  return Unusable(
      {SceneError::kGeometry, placement, "placement " + std::to_string(placement) + ": " + why});
}

Unusable too_many(std::size_t pieces) {
  return Unusable({SceneError::kLimit, 0,
                   std::to_string(pieces) +
                       " pieces (each triangle of a mesh that moves is one) must be at most " +
                       std::to_string(SceneMaker::kMostPieces)});
}

Unusable too_many_triangles(std::size_t triangles) {
  return Unusable({SceneError::kLimit, 0,
                   std::to_string(triangles) + " triangles of the world's meshes must be at most " +
                       std::to_string(SceneMaker::kMostTriangles)});
}

}  // namespace

SceneOutcome SceneMaker::make(const SceneOrder& order) {
  if (std::exchange(session_, order.session) != order.session) parts_.clear();
  SceneOutcome outcome{.session = order.session, .made = nullptr, .fault = std::nullopt};
  try {
    auto made = std::make_unique<MadeScene>();
    made->session = order.session;
    made->number = order.number;
    made->scene = scene_of(order);
    outcome.made = std::move(made);
    std::erase_if(parts_, [](const auto& known) { return known.second.use_count() == 1; });
  } catch (const Unusable& what) {
    outcome.fault = SceneFault{what.error, what.item, what.what()};
  } catch (const std::exception& error) {  // Out of memory, above all.
    parts_.clear();
    outcome.fault =
        SceneFault{SceneError::kLimit, 0, std::string("no scene of it: ") + error.what()};
  }
  return outcome;
}

std::unique_ptr<Scene> SceneMaker::scene_of(const SceneOrder& order) {
  std::vector<PlacedShape> shapes;
  std::map<std::uint32_t, std::uint32_t> place_of;  // By id.
  std::size_t pieces = 0;
  std::size_t triangles = 0;
  for (const protocol::ScenePlacement& placement : order.placements) {
    geometry::interruption_point();
    try {
      PlacedShape shape{.shape = parts_of(order, placement),
                        .side = placement.side,
                        .X_BS = placement.X_BS,
                        .friction = placement.friction,
                        .group = placement.group,
                        .mask = placement.mask};
      require_place(shape, order.tool);
      pieces += shape.shape->pieces.size();
      place_of[placement.id] = static_cast<std::uint32_t>(shapes.size());
      shapes.push_back(std::move(shape));
    } catch (const std::exception& error) {
      throw unusable(placement.id, error.what());
    }
    triangles += shapes.back().shape->solid_triangles();
    if (pieces > kMostPieces) throw too_many(pieces);
    if (triangles > kMostTriangles) throw too_many_triangles(triangles);
  }
  std::vector<std::pair<std::uint32_t, std::uint32_t>> apart;
  for (const protocol::SceneApart& pair : order.apart) {
    apart.emplace_back(place_of.at(pair.a), place_of.at(pair.b));
  }
  try {
    return std::make_unique<Scene>(std::move(shapes), apart, order.tool, order.inertias,
                                   order.joints);
  } catch (const std::logic_error& error) {  // Most pieces lie in one place, or joints make a loop.
    throw Unusable({SceneError::kGeometry, 0, error.what()});
  }
}

const SceneMaker::Parts& SceneMaker::parts_of(const SceneOrder& order,
                                              const protocol::ScenePlacement& placement) {
  const geometry::MeshUse use = placement.side.kind == SideKind::kWorld
                                    ? geometry::MeshUse::kSolids
                                    : geometry::MeshUse::kPieces;
  Parts& parts = parts_[{placement.shape, use}];
  if (!parts) {
    parts = std::make_shared<const geometry::ShapeParts>(
        geometry::parts_of(any_shape(*order.shapes.at(placement.shape)), "of it", use));
  }
  return parts;
}

}  // namespace hlm::server
