// What of the physics can change during a session, and within which ranges.
#pragma once

#include <array>

#include "hlm/common/range.h"
#include "hlm/common/vocabulary.h"

namespace hlm {

struct Tuning {
  UpdateRule update_rule = UpdateRule::kRetain;
  ControllerKind controller = ControllerKind::kFourChannel;
  double stiffness = 4000;                 ///< k_lc of each contact, N/m.
  double damping = 30;                     ///< b_lc, N·s/m.
  double friction = 0.3;                   ///< μ_k, and μ_s where this is changed.
  double restitution = 0;                  ///< e.
  double coupling_stiffness = 1500;        ///< K_c, translation, N/m.
  double coupling_damping = 30;            ///< B_c, translation, N·s/m.
  double coupling_angular_stiffness = 1;   ///< K_c, rotation, N·m/rad.
  double coupling_angular_damping = 0.03;  ///< B_c, rotation, N·m·s/rad.

  bool operator==(const Tuning&) const = default;
};

/// A number of the tuning and what it can be set to. Its name is a key of the page's messages.
struct TuningRange : Range {
  const char* name;
  double Tuning::*number;
};
inline constexpr std::array<TuningRange, 8> kTuningRanges{{
    {{1, 1e6, "N/m"}, "stiffness", &Tuning::stiffness},
    {{0, 1e4, "N·s/m"}, "damping", &Tuning::damping},
    {{0, 10}, "friction", &Tuning::friction},
    {{0, 1}, "restitution", &Tuning::restitution},
    {{0, 1e5, "N/m"}, "coupling_stiffness", &Tuning::coupling_stiffness},
    {{0, 1e3, "N·s/m"}, "coupling_damping", &Tuning::coupling_damping},
    {{0, 1e3, "N·m/rad"}, "coupling_angular_stiffness", &Tuning::coupling_angular_stiffness},
    {{0, 10, "N·m·s/rad"}, "coupling_angular_damping", &Tuning::coupling_angular_damping},
}};

/// The range of one number: what starts a server outside it could not be sent to a client, nor set
/// back by one.
constexpr Range range_of(double Tuning::*number) noexcept {
  for (const TuningRange& range : kTuningRanges) {
    if (range.number == number) return range;
  }
  return {};
}

/// Whether all numbers are in their ranges.
constexpr bool is_in_range(const Tuning& tuning) noexcept {
  for (const TuningRange& range : kTuningRanges) {
    if (!range.contains(tuning.*range.number)) return false;
  }
  return true;
}

}  // namespace hlm
