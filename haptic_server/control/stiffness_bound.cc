#include "hlm/control/stiffness_bound.h"

#include <algorithm>
#include <cmath>

#include <spdlog/fmt/fmt.h>

namespace hlm::server {
namespace {

/// Period at which vendors rate a stiffness, s.
constexpr double kRatedPeriod = 1e-3;

/// Share of the damping that lowered stiffness leaves. Less rings for seconds after each blow, more
/// makes walls softer than need be.
constexpr double kLeftOver = 0.3;

/// Contacts that press on one side of the tool at once, where no limit says less.
constexpr double kMostContacts = 64;

bool feels_contacts(ControllerKind kind) noexcept {
  return traits(kind).uses_contacts && !traits(kind).couples_translation;
}

}  // namespace

double lag_of(const DeviceRatings& device, double period) noexcept {
  return std::max(period, 1 / device.exchange_rate) / 2 + device.delay;
}

double physical_damping(const DeviceRatings& device) noexcept {
  if (device.damping > 0) return device.damping;
  return std::isfinite(device.max_stiffness) ? device.max_stiffness * kRatedPeriod / 2 : 0;
}

double bearable_share(const DeviceRatings& device, const Impedance& felt, double period,
                      double rest) noexcept {
  const double lag = lag_of(device, period);
  const double own = physical_damping(device);
  if (own <= 0) return 1;
  const double late = device.mass > 0 ? felt.damping * lag / (2 * device.mass) : 0;
  const auto holds = [&](double share) {
    return share * felt.stiffness * lag <=
           (1 - rest) * (own + share * felt.damping) * (1 - share * late);
  };
  if (holds(1)) return 1;
  // It holds at 0 and, a parabola, ceases to hold once.
  double share = 0;
  double above = 1;
  for (int i = 0; i < 50; ++i) {
    const double middle = (share + above) / 2;
    (holds(middle) ? share : above) = middle;
  }
  return share;
}

Impedance felt_impedance(ControllerKind kind, const ControllerGains& gains,
                         const LocalModelParameters& contacts) noexcept {
  if (feels_contacts(kind)) {
    const double summed = contacts.stiffness * std::min(contacts.max_stiffness_sum, kMostContacts);
    const double k = std::min(summed, contacts.max_hand_stiffness);
    return {k, contacts.damping * k / contacts.stiffness};
  }
  const bool fed_back = traits(kind).uses_contacts && kind != ControllerKind::kVirtualCoupler;
  const double times = fed_back ? 2 : 1;
  return {times * gains.stiffness, times * gains.damping};
}

double bound_stiffness(ControllerKind kind, const DeviceRatings& device, double period,
                       ControllerGains& gains, LocalModelParameters& contacts) noexcept {
  const Impedance felt = felt_impedance(kind, gains, contacts);
  const double share = bearable_share(device, felt, period, kLeftOver);
  if (share == 1) return 1;
  if (feels_contacts(kind)) {
    contacts.max_hand_stiffness = share * felt.stiffness;
  } else {
    for (const NumberOf<ControllerGains>& gain : kGainNumbers) gains.*gain.number *= share;
  }
  return share;
}

std::optional<std::string> lower_stiffness(ControllerKind kind, const DeviceRatings& device,
                                           double period, ControllerGains& gains,
                                           LocalModelParameters& contacts) {
  const Impedance felt = felt_impedance(kind, gains, contacts);
  const ControllerGains asked = gains;
  if (bound_stiffness(kind, device, period, gains, contacts) == 1) return std::nullopt;
  const std::string cause = fmt::format(
      "too stiff for this device, whose force comes {:.3g} ms after its motion: it would shake",
      1e3 * lag_of(device, period));
  constexpr const char* kOtherwise = "--keep-stiffness leaves it as asked for";
  if (feels_contacts(kind)) {
    return fmt::format(
        "contacts of {:.5g} N/m together are {}; max hand stiffness {:.5g} N/m is in "
        "effect; {}",
        felt.stiffness, cause, contacts.max_hand_stiffness, kOtherwise);
  }
  return fmt::format(
      "a coupling of {:.5g} N/m and {:.5g} N·s/m is {}; {:.5g} N/m and {:.5g} N·s/m are in effect; "
      "{}",
      asked.stiffness, asked.damping, cause, gains.stiffness, gains.damping, kOtherwise);
}

}  // namespace hlm::server
