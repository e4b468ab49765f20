#include "hlm/haptic_server/control/stiffness_bound.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include <spdlog/fmt/fmt.h>
#include <spdlog/fmt/ranges.h>

namespace hlm::server {
namespace {

/// Period at which vendors rate a stiffness, s.
constexpr double kRatedPeriod = 1e-3;

/// Share that is left of the largest stable spring and damper. More rings for seconds after each
/// blow, and a handle that a hand presses bounces for ever, because a late wall still pushes when
/// it was left; less makes walls softer than need be.
constexpr double kMargin = 0.5;
/// The same where a proxy's coupling and the contact that balances it are felt: the proxy's blows
/// come late, too.
constexpr double kMarginOfChannels = 0.35;

/// Three and four channels.
bool feeds_back(ControllerKind kind) noexcept {
  return kind == ControllerKind::kFourChannel || kind == ControllerKind::kThreeChannel;
}

double margin_of(ControllerKind kind) noexcept {
  return feeds_back(kind) ? kMarginOfChannels : kMargin;
}

/// How often the device feels the coupling: again in the contact force that balances it.
double times_felt(ControllerKind kind) noexcept { return feeds_back(kind) ? 2 : 1; }

/// Mass of a handle whose driver knows its encoders but not its mass, kg: less than any has. Less
/// makes walls softer than need be, more lets a light handle shake.
constexpr double kUsualMass = 0.1;

/// Contacts that press on one side of the tool at once, where no limit says less.
constexpr double kMostContacts = 64;

/// Longest lever of a contact about the hand, m: beyond it no stiffness in rotation is expected.
constexpr double kLongestLever = 0.1;

bool feels_contacts(ControllerKind kind) noexcept {
  return traits(kind).uses_contacts && !traits(kind).couples_translation;
}

/// Of what exchanges least often, s.
double exchange_period(const DeviceRatings& device, double period) noexcept {
  return std::max(period, 1 / device.exchange_rate);
}

/// What damps where nothing is rated: what the rated stiffness needs at 1 kHz; 0 if none is.
double damping_of(double rated_stiffness) noexcept {
  return std::isfinite(rated_stiffness) ? rated_stiffness * kRatedPeriod / 2 : 0;
}

/// Largest change of the coupling's force at one encoder step, N and N·m: what is left below 0.1 N,
/// which a hand does not feel, for the observer of the hand. Less makes devices with coarse
/// encoders soft; more lets them hum at rest.
constexpr double kQuietKick = 0.09;
constexpr double kQuietTurningKick = kQuietKick * kLongestLever;

/// Lowers gains from what is felt of them now to what is borne; the share of the spring that is
/// left.
double lower(const Impedance& felt, const Impedance& borne, double& stiffness,
             double& damping) noexcept {
  const double left = felt.stiffness > 0 ? borne.stiffness / felt.stiffness : 1;
  stiffness *= left;
  if (felt.damping > 0) damping *= borne.damping / felt.damping;
  return left;
}

/// The open loop at one frequency: force that comes back over force, of a handle that nobody holds.
/// The sampled handle moves as one with 2/Δt sin(ωΔt/2) in the place of ω.
std::complex<double> open_loop(const Handle& handle, const Impedance& felt, double w) noexcept {
  const auto late = [w](double lag) { return std::polar(1.0, -w * lag); };
  const std::complex<double> jw(0, 2 / handle.period * std::sin(w * handle.period / 2));
  const std::complex<double> spring_and_damper =
      felt.stiffness + jw * felt.damping * late(handle.velocity_lag);
  return spring_and_damper * late(handle.lag) / (jw * (jw * handle.mass + handle.damping));
}

/// The largest share that is stable, by Nyquist's criterion: where the open loop crosses the
/// negative real axis. It does so between the frequency at which all lags without the damper would
/// bring it there, and half a wave per lag or half the sampling's frequency.
double critical_share(const Handle& handle, const Impedance& felt) noexcept {
  constexpr double kStep = 1.05;  // Between two frequencies: finds the share within 1 %.
  const double lags = handle.lag + handle.velocity_lag;
  const double lowest = 0.5 * std::min(std::sqrt(handle.damping / (handle.mass * lags)), 1 / lags);
  const double highest = std::numbers::pi / std::max(handle.lag, handle.period);
  double most = 0;  // Where it crosses, to the left of the imaginary axis.
  std::complex<double> before = open_loop(handle, felt, lowest);
  for (double w = lowest; w < highest;) {
    w = std::min(kStep * w, highest);
    const std::complex<double> now = open_loop(handle, felt, w);
    if ((before.imag() < 0) != (now.imag() < 0)) {
      const double part = before.imag() / (before.imag() - now.imag());
      most = std::max(most, -(before.real() + part * (now.real() - before.real())));
    }
    before = now;
  }
  most = std::max(most, -before.real());
  return most > 0 ? 1 / most : Range::kInfinite;
}

}  // namespace

double lag_of(const DeviceRatings& device, double period) noexcept {
  return exchange_period(device, period) / 2 + device.delay;
}

Handle translation_of(const DeviceRatings& device, double period) noexcept {
  const double damping = device.damping > 0 ? device.damping : damping_of(device.max_stiffness);
  const bool is_modelled = device.position_step > 0;
  const double mass = device.mass > 0 || !is_modelled ? device.mass : kUsualMass;
  return {mass, damping, lag_of(device, period), device.velocity_lag,
          exchange_period(device, period)};
}

Handle rotation_of(const DeviceRatings& device, double period) noexcept {
  return {device.inertia, damping_of(device.max_angular_stiffness), lag_of(device, period),
          device.velocity_lag, exchange_period(device, period)};
}

double bearable_share(const Handle& handle, const Impedance& felt, double margin) noexcept {
  if (handle.damping <= 0 || felt.stiffness <= 0) return 1;
  if (handle.mass <= 0) {
    // The limit of a large mass: no frequency at which the damper alone is too late is known.
    const double missing = felt.stiffness * handle.lag - felt.damping;
    return missing <= 0 ? 1 : std::min(1.0, margin * handle.damping / missing);
  }
  // What was lowered to it before is borne, but for rounding.
  constexpr double kRounding = 1e-9;
  const double share = margin * critical_share(handle, felt);
  return share > 1 - kRounding ? 1 : share;
}

Impedance felt_impedance(ControllerKind kind, const ControllerGains& gains,
                         const LocalModelParameters& contacts) noexcept {
  if (feels_contacts(kind)) {
    const double summed = contacts.stiffness * std::min(contacts.max_stiffness_sum, kMostContacts);
    const double k = std::min(summed, contacts.max_hand_stiffness);
    return {k, contacts.damping * k / contacts.stiffness};
  }
  const double times = times_felt(kind);
  return {times * gains.stiffness, times * gains.damping};
}

Impedance felt_in_rotation(ControllerKind kind, const ControllerGains& gains,
                           const LocalModelParameters& contacts) noexcept {
  if (kind == ControllerKind::kDirect) {
    const Impedance felt = felt_impedance(kind, gains, contacts);
    constexpr double kSquare = kLongestLever * kLongestLever;
    const double k = std::min(kSquare * felt.stiffness, contacts.max_hand_angular_stiffness);
    return {k, contacts.damping * k / contacts.stiffness};
  }
  const double times = times_felt(kind);
  return {times * gains.angular_stiffness, times * gains.angular_damping};
}

Impedance bearable_coupling(const Handle& handle, const Impedance& felt, const EncoderStep& step,
                            double margin) noexcept {
  const double share = bearable_share(handle, felt, margin);
  Impedance borne{share * felt.stiffness, share * felt.damping};
  const double most_damping = step.quiet / step.speed;
  if (borne.damping > most_damping) {
    // The damper becomes one that is quiet, the spring the stiffest that rests with it.
    const auto rests = [&](double stiffness) {
      return bearable_share(handle, {stiffness, most_damping}, margin) >= 1;
    };
    constexpr double kSoftest = 1e-3;  // Of what was asked for.
    constexpr int kHalvings = 9;       // Of its three decades: within 1.4 %.
    double stiffer = borne.stiffness;
    double softer = rests(stiffer) ? stiffer : kSoftest * stiffer;
    for (int i = 0; i < kHalvings && softer < stiffer; ++i) {
      const double middle = std::sqrt(softer * stiffer);
      (rests(middle) ? softer : stiffer) = middle;
    }
    borne = {softer, most_damping};
  }
  const double kick = borne.damping * step.speed + borne.stiffness * step.pose;
  const double less = kick > step.quiet ? step.quiet / kick : 1;
  return {less * borne.stiffness, less * borne.damping};
}

double bound_stiffness(ControllerKind kind, const DeviceRatings& device, double period,
                       ControllerGains& gains, LocalModelParameters& contacts) noexcept {
  const Impedance felt = felt_impedance(kind, gains, contacts);
  const Impedance turned = felt_in_rotation(kind, gains, contacts);
  const double margin = margin_of(kind);
  const Handle translation = translation_of(device, period);
  double left = 1;
  if (feels_contacts(kind)) {
    left = bearable_share(translation, felt, margin);
    if (left < 1) contacts.max_hand_stiffness = left * felt.stiffness;
  } else {
    const Impedance borne = bearable_coupling(
        translation, felt, {device.position_step, device.speed_step, kQuietKick}, margin);
    left = lower(felt, borne, gains.stiffness, gains.damping);
  }
  if (!(device.max_torque > 0)) return left;
  const Handle rotation = rotation_of(device, period);
  if (kind == ControllerKind::kDirect) {
    const double turning = bearable_share(rotation, turned, margin);
    if (turning < 1) contacts.max_hand_angular_stiffness = turning * turned.stiffness;
    return left;
  }
  const Impedance borne =
      bearable_coupling(rotation, turned, {0, device.turn_step, kQuietTurningKick}, margin);
  const double turning = lower(turned, borne, gains.angular_stiffness, gains.angular_damping);
  return feels_contacts(kind) ? left : std::min(left, turning);
}

std::optional<std::string> lower_stiffness(ControllerKind kind, const DeviceRatings& device,
                                           double period, ControllerGains& gains,
                                           LocalModelParameters& contacts) {
  const Impedance felt = felt_impedance(kind, gains, contacts);
  const ControllerGains asked = gains;
  const LocalModelParameters before = contacts;
  bound_stiffness(kind, device, period, gains, contacts);
  std::vector<std::string> lowered;
  if (contacts.max_hand_stiffness < before.max_hand_stiffness) {
    lowered.push_back(fmt::format("contacts of {:.5g} N/m together, {:.5g} N/m are in effect",
                                  felt.stiffness, contacts.max_hand_stiffness));
  }
  if (contacts.max_hand_angular_stiffness < before.max_hand_angular_stiffness) {
    lowered.push_back(fmt::format("contacts on a lever, {:.3g} N·m/rad together are in effect",
                                  contacts.max_hand_angular_stiffness));
  }
  if (gains.stiffness < asked.stiffness || gains.damping < asked.damping) {
    lowered.push_back(fmt::format(
        "a coupling of {:.5g} N/m and {:.5g} N·s/m, {:.5g} N/m and {:.5g} N·s/m are in effect",
        asked.stiffness, asked.damping, gains.stiffness, gains.damping));
  }
  if (gains.angular_stiffness < asked.angular_stiffness ||
      gains.angular_damping < asked.angular_damping) {
    lowered.push_back(fmt::format(
        "a coupling of {:.3g} N·m/rad and {:.3g} N·m·s/rad, {:.3g} N·m/rad and {:.3g} N·m·s/rad "
        "are in effect",
        asked.angular_stiffness, asked.angular_damping, gains.angular_stiffness,
        gains.angular_damping));
  }
  if (lowered.empty()) return std::nullopt;
  const std::string slower = device.velocity_lag > 0 ? fmt::format(", its velocity {:.3g} ms later",
                                                                   1e3 * device.velocity_lag)
                                                     : "";
  const std::string steps =
      gains.damping < asked.damping && device.speed_step > 0
          ? fmt::format(", one encoder step {:.3g} mm/s", 1e3 * device.speed_step)
          : "";
  return fmt::format(
      "too stiff for this device, whose force comes {:.3g} ms after its motion{}{}, so that it "
      "would shake: {}; --keep-stiffness leaves it as asked for",
      1e3 * lag_of(device, period), slower, steps, fmt::join(lowered, "; "));
}

std::vector<std::string> check_against_device(ControllerKind kind, const ControllerGains& gains,
                                              const LocalModelParameters& contacts,
                                              const DeviceRatings& device,
                                              bool measures_hand_wrench, double period) {
  std::vector<std::string> doubts;
  const bool coordinates = traits(kind).couples_translation;
  if (kind == ControllerKind::kFourChannel && !measures_hand_wrench) {
    doubts.push_back(
        "four_channel without the hand's wrench works as three_channel: this device does not "
        "measure it, and an observer needs its mass, --device-option apparent-mass=KG, and "
        "observe-hand");
  }
  if (coordinates && gains.stiffness > device.max_stiffness) {
    doubts.push_back(fmt::format("coupling stiffness {} N/m is above the device's rated {} N/m",
                                 gains.stiffness, device.max_stiffness));
  }
  if (traits(kind).couples_rotation && gains.angular_stiffness > device.max_angular_stiffness) {
    doubts.push_back(
        fmt::format("angular coupling stiffness {} N·m/rad is above the device's rated {} N·m/rad",
                    gains.angular_stiffness, device.max_angular_stiffness));
  }
  const double lag = lag_of(device, period);
  if (coordinates && device.mass > 0 && 2 * gains.damping * lag > device.mass) {
    doubts.push_back(fmt::format(
        "coupling damping {} N·s/m stops the device's {} kg within {} s, as late as its force is: "
        "lower it",
        gains.damping, device.mass, 2 * lag));
  }
  // Directly felt, one contact; else the coupling, however stiff the wall behind it.
  const Impedance coupling = felt_impedance(kind, gains, contacts);
  const double one = std::min(contacts.stiffness, contacts.max_hand_stiffness);
  const double felt = coordinates ? coupling.stiffness : one;
  const double needed =
      felt * lag + (coordinates ? 0 : contacts.damping * one / contacts.stiffness);
  const double there = device.damping + (coordinates ? coupling.damping : 0);
  if (needed > there) {
    doubts.push_back(fmt::format(
        "a spring of {:.5g} N/m at {} Hz needs {:.3g} N·s/m of damping to be passive (Colgate), "
        "device and coupling have {:.3g}: it may buzz, more so with several contacts",
        felt, 1 / period, needed, there));
  }
  return doubts;
}

}  // namespace hlm::server
