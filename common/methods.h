// The methods side by side: what stands between a haptic device and the environment. The live page
// offers some of them, the experiments compare all.
#pragma once

#include <array>
#include <string_view>

#include "hlm/common/vocabulary.h"

namespace hlm {

struct Method {
  std::string_view name;   ///< Name on the command line and in the page's messages.
  std::string_view label;  ///< Label in figures and on buttons.
  std::string_view help;   ///< One phrase for a person.
  UpdateRule update_rule = UpdateRule::kRetain;
  ControllerKind controller = ControllerKind::kFourChannel;
  double epsilon = 0;    ///< m.
  bool on_page = false;  ///< The live page has a button for it.
  bool shapes = false;   ///< The server has the shapes; otherwise contacts are sent.
};

inline constexpr std::array<Method, 18> kMethods{{
    // The paper's three, as the paper has them: its baseline couples directly.
    {.name = "ir",
     .label = "IR",
     .help = "Intermediate representation: planes that stay until the next update",
     .update_rule = UpdateRule::kIntermediateRepresentation,
     .controller = ControllerKind::kDirect,
     .on_page = true},
    {.name = "lm0",
     .label = "LM₀",
     .help = "Local model without prediction: only touching contacts are sent",
     .on_page = true},
    {.name = "lm5",
     .label = "LM₅",
     .help = "Local model; contacts are sent up to 5 mm before they are touched",
     .epsilon = 0.005,
     .on_page = true},
    // No planes at all.
    {.name = "shapes",
     .label = "LM shapes",
     .help = "Local model; the server has the shapes and finds contacts at every tick",
     .on_page = true,
     .shapes = true},
    {.name = "shapes-direct",
     .label = "LM shapes direct",
     .help = "The same, the device in the proxy's place",
     .controller = ControllerKind::kDirect,
     .shapes = true},
    // Deformation without, and the controller without deformation.
    {.name = "lm0-direct",
     .label = "LM₀ direct",
     .help = "LM₀, the device in the proxy's place",
     .controller = ControllerKind::kDirect},
    {.name = "lm5-direct",
     .label = "LM₅ direct",
     .help = "LM₅, the device in the proxy's place",
     .controller = ControllerKind::kDirect,
     .epsilon = 0.005},
    {.name = "lm0-coupler",
     .label = "LM₀ coupler",
     .help = "LM₀, a virtual coupler to the proxy",
     .controller = ControllerKind::kVirtualCoupler},
    {.name = "lm5-coupler",
     .label = "LM₅ coupler",
     .help = "LM₅, a virtual coupler to the proxy",
     .controller = ControllerKind::kVirtualCoupler,
     .epsilon = 0.005},
    {.name = "lm5-paper",
     .label = "LM₅ rule P",
     .help = "LM₅ with the paper's update rule",
     .update_rule = UpdateRule::kPaper,
     .epsilon = 0.005},
    {.name = "lm0-paper",
     .label = "LM₀ rule P",
     .help = "LM₀ with the paper's update rule",
     .update_rule = UpdateRule::kPaper},
    {.name = "ir-four",
     .label = "IR four-channel",
     .help = "IR with the four-channel controller",
     .update_rule = UpdateRule::kIntermediateRepresentation},
    {.name = "ir-coupler",
     .label = "IR coupler",
     .help = "IR, a virtual coupler to the proxy",
     .update_rule = UpdateRule::kIntermediateRepresentation,
     .controller = ControllerKind::kVirtualCoupler},
    // The rivals.
    {.name = "ir-rot",
     .label = "IR-rot",
     .help = "IR for translation, a coupler to the engine's tool for rotation",
     .update_rule = UpdateRule::kIntermediateRepresentation,
     .controller = ControllerKind::kRotationCoupler},
    {.name = "vrpn",
     .label = "VRPN recovery",
     .help = "Planes that move to their reported place over some steps",
     .update_rule = UpdateRule::kPlaneRecovery,
     .controller = ControllerKind::kDirect},
    {.name = "vrpn-four",
     .label = "VRPN four-channel",
     .help = "VRPN recovery with the four-channel controller",
     .update_rule = UpdateRule::kPlaneRecovery},
    {.name = "coupler",
     .label = "coupler to engine",
     .help = "A spring and damper to the engine's tool",
     .controller = ControllerKind::kEngineCoupler,
     .on_page = true},
    {.name = "engine",
     .label = "direct to engine",
     .help = "The engine's contact force, held between frames",
     .controller = ControllerKind::kEngineForce,
     .on_page = true},
}};

}  // namespace hlm
