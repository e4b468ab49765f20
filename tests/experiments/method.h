// The methods side by side, by name: what stands between a haptic device and the environment.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "haptic_server/control/controller.h"
#include "haptic_server/local_model/parameters.h"

namespace hlm::experiments {

struct Method {
  std::string name;   ///< On the command line.
  std::string label;  ///< In figures.
  UpdateRule rule = UpdateRule::kRetain;
  ControllerKind controller = ControllerKind::kFourChannel;
  double epsilon = 0;          ///< m.
  double largest_epsilon = 0;  ///< m; above `epsilon`, ε adapts.
};

const std::vector<Method>& methods();

/// Throws std::runtime_error naming the methods there are.
const Method& method(std::string_view name);

}  // namespace hlm::experiments
