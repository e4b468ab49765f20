#include "tests/experiments/method.h"

#include <stdexcept>

namespace hlm::experiments {

const std::vector<Method>& methods() {
  constexpr auto kIr = UpdateRule::kIntermediateRepresentation;
  constexpr auto kRetain = UpdateRule::kRetain;
  static const std::vector<Method> all{
      // The paper's three, as the paper has them: its baseline couples directly.
      {"ir", "IR", kIr, ControllerKind::kDirect},
      {"lm0", "LM₀", kRetain, ControllerKind::kFourChannel},
      {"lm5", "LM₅", kRetain, ControllerKind::kFourChannel, 0.005},
      {"lm-adaptive", "LM adaptive ε", kRetain, ControllerKind::kFourChannel, 0.005, 0.08},
      // Deformation without, and the controller without deformation.
      {"lm0-direct", "LM₀ direct", kRetain, ControllerKind::kDirect},
      {"lm5-direct", "LM₅ direct", kRetain, ControllerKind::kDirect, 0.005},
      {"lm0-coupler", "LM₀ coupler", kRetain, ControllerKind::kVirtualCoupler},
      {"lm5-coupler", "LM₅ coupler", kRetain, ControllerKind::kVirtualCoupler, 0.005},
      {"lm5-paper", "LM₅ rule P", UpdateRule::kPaper, ControllerKind::kFourChannel, 0.005},
      {"lm0-paper", "LM₀ rule P", UpdateRule::kPaper, ControllerKind::kFourChannel},
      {"ir-four", "IR four-channel", kIr, ControllerKind::kFourChannel},
      {"ir-coupler", "IR coupler", kIr, ControllerKind::kVirtualCoupler},
      // The rivals.
      {"ir-rot", "IR-rot", kIr, ControllerKind::kRotationCoupler},
      {"vrpn", "VRPN recovery", UpdateRule::kPlaneRecovery, ControllerKind::kDirect},
      {"vrpn-four", "VRPN four-channel", UpdateRule::kPlaneRecovery, ControllerKind::kFourChannel},
      {"coupler", "virtual coupler", kRetain, ControllerKind::kEngineCoupler},
      {"engine", "direct to engine", kRetain, ControllerKind::kEngineForce},
  };
  return all;
}

const Method& method(std::string_view name) {
  std::string known;
  for (const Method& candidate : methods()) {
    if (candidate.name == name) return candidate;
    known += (known.empty() ? "" : ", ") + candidate.name;
  }
  throw std::runtime_error("method '" + std::string(name) + "' must be one of " + known);
}

}  // namespace hlm::experiments
