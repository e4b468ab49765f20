#include "hlm/ve_client/scene/world_description.h"

#include <algorithm>
#include <span>
#include <stdexcept>

namespace hlm::ve {
namespace {

/// More would hide what a message is about.
constexpr std::size_t kMostNames = 20;

template <class Named>
std::string names_of(const std::vector<Named>& all) {
  std::string names;
  for (const Named& one : std::span(all).first(std::min(all.size(), kMostNames))) {
    names.append(names.empty() ? "" : ", ").append(one.name);
  }
  if (all.size() > kMostNames) {
    names.append(" and ").append(std::to_string(all.size() - kMostNames)).append(" more");
  }
  return names.empty() ? "none" : names;
}

template <class Named>
const Named& find(const std::vector<Named>& all, const std::string& name, const std::string& what) {
  const auto found = std::ranges::find(all, name, &Named::name);
  if (found != all.end()) return *found;
  throw std::runtime_error(what + "; it has: " + names_of(all));
}

}  // namespace

std::string model_names(const WorldDescription& world) { return names_of(world.models); }

const ModelDescription& find_model(const WorldDescription& world, const std::string& name) {
  return find(world.models, name, "tool '" + name + "' is not a model of the world");
}

WorldDescription with_model_at(WorldDescription world, const std::string& model, const Pose& X_WM) {
  const ModelDescription moved = find_model(world, model);
  const Pose X = X_WM * moved.X_WM.inverse();
  const auto is_part = [&](int body) {
    return body >= moved.first_body && body < moved.first_body + moved.body_count;
  };
  for (int i = moved.first_body; is_part(i); ++i) {
    Pose& X_WB = world.bodies[static_cast<std::size_t>(i)].X_WB;
    X_WB = X * X_WB;
  }
  for (JointDescription& joint : world.joints) {
    if (is_part(joint.child)) joint.X_WJ = X * joint.X_WJ;
  }
  std::ranges::find(world.models, model, &ModelDescription::name)->X_WM = X_WM;
  return world;
}

WorldDescription with_start(WorldDescription world, const std::string& model,
                            const std::string& start) {
  const ModelDescription& moved = find_model(world, model);
  if (start.empty()) return world;
  const Pose X_WM =
      find(moved.starts, start, "start '" + start + "' is not one of tool '" + model + "'").X_WM;
  return with_model_at(std::move(world), model, X_WM);
}

}  // namespace hlm::ve
