#include "hlm/common/force_chain.h"

#include <cmath>
#include <cstdio>

#include "hlm/common/contact.h"

namespace hlm {
namespace {

constexpr double kNothing = 0.01;    // N: no hand feels it.
constexpr double kBarelyFelt = 0.1;  // N.
constexpr double kDead = 1;          // s without a word of the client.
constexpr double kSoft = 50;         // N/m: as air to a hand.

/// About three significant digits, without exponents for the usual sizes.
std::string fixed(double value) {
  if (!std::isfinite(value)) return "–";
  const double size = std::abs(value);
  const char* format = size >= 1e6 ? "%.1e" : size >= 100 ? "%.0f" : size >= 10 ? "%.1f" : "%.2f";
  char text[32];
  std::snprintf(text, sizeof text, format, value);
  return text == std::string("-0.00") ? "0.00" : text;
}

std::string newtons(double value) { return fixed(value) + " N"; }
std::string millimetres(double metres) { return fixed(1e3 * metres) + " mm"; }
std::string milliseconds(double seconds) {
  return std::to_string(std::lround(1e3 * seconds)) + " ms";
}

ChainLink session(const ForceFacts& f) {
  ChainLink link{"session", std::string(name_of(f.server)), {}};
  if (!f.session) {
    link.value = "none";
    link.reason = f.refused.empty() ? "no client has a session: start ve_client" : f.refused;
  } else if (f.fault != Fault::kNone) {
    link.reason = "haptic_server stopped with fault " + std::string(name_of(f.fault)) + ": " +
                  std::string(meaning_of(f.fault)) +
                  "; restart ve_client, or press Reset on its page";
  }
  return link;
}

std::string updates_reason(const ForceFacts& f) {
  if (f.silence && *f.silence > kDead) {
    return "nothing has come from the client for " + fixed(*f.silence) +
           " s: it is dead or hangs, or the network to it is cut";
  }
  if (f.update_rate && *f.update_rate < f.least_update_rate) {
    return "the client is slow: only " + fixed(*f.update_rate) +
           " updates a second arrive, and with fewer than " + fixed(f.least_update_rate) +
           " the force comes and goes";
  }
  if (f.server == ServerState::kFading) {
    return "haptic_server hears too little of the client and lets the force fade";
  }
  if (f.age > kOldestContacts) return "the contacts are old: the environment is late or silent";
  return {};
}

ChainLink updates(const ForceFacts& f) {
  const std::string rate = f.update_rate ? fixed(*f.update_rate) + " Hz\n" : "";
  return {"updates", rate + "age " + milliseconds(f.age), updates_reason(f)};
}

ChainLink device(const ForceFacts& f) {
  const std::string position =
      "x " + fixed(1e3 * f.p_WD.x()) + "\ny " + fixed(1e3 * f.p_WD.y()) + " mm";
  if (!f.motors_off) return {"device", position, {}};
  return {"device", "motors off",
          "the device is disabled: its own safety, or its enable switch, holds the motors off"};
}

/// A force on the hand means that there is a hand, measured or not.
ChainLink hand(const ForceFacts& f) {
  if (!f.F_hand) return {"hand", "–", {}};
  const bool pulls = f.F_hand->norm() >= kNothing || f.F_env.norm() >= kNothing;
  return {"hand", newtons(f.F_hand->norm()),
          pulls ? "" : "no hand on the device: take the handle, or drag it on the page"};
}

ChainLink contacts(const ForceFacts& f) {
  if (!f.uses_contacts) return {"contacts", "–", {}};
  ChainLink link{"contacts", std::to_string(f.reported), {}};
  if (f.reported > 0) return link;
  link.reason = "no contacts reported: ";
  if (!f.epsilon) {
    link.reason += "the tool is farther than epsilon from everything";
  } else if (*f.epsilon > 0) {
    link.reason +=
        "the tool is farther than epsilon (" + millimetres(*f.epsilon) + ") from everything";
  } else {
    link.reason += "with epsilon 0 only touching contacts are sent";
  }
  return link;
}

ChainLink separation(const ForceFacts& f) {
  if (!f.uses_contacts || f.reported == 0) return {"separation", "–", {}};
  ChainLink link{"separation", millimetres(f.smallest_separation), {}};
  if (f.smallest_separation > 0) {
    link.reason = "nothing is touched: the nearest contact is " +
                  millimetres(f.smallest_separation) + " away";
  }
  return link;
}

ChainLink penalty(const ForceFacts& f) {
  if (!f.uses_contacts) return {"penalty", "–", {}};
  const std::string force = f.penalty ? newtons(*f.penalty) : fixed(f.stiffness) + " N/m";
  ChainLink link{"penalty", force + "\n" + std::to_string(f.active) + " active", {}};
  if (f.active == 0) {
    link.reason = "no local contact is active";
  } else if (f.stiffness < kSoft) {
    link.reason = "the stiffness is only " + fixed(f.stiffness) +
                  " N/m: such contacts give way before a hand feels them";
  }
  return link;
}

ChainLink environment(const ForceFacts& f) {
  ChainLink link{"F_env", newtons(f.F_env.norm()), {}};
  if (f.F_env.norm() >= kNothing) return link;
  link.reason = f.uses_contacts ? "the contact forces cancel out, or are too small to feel"
                                : "the engine's tool does not resist";
  return link;
}

std::string limit_reason(const ForceFacts& f) {
  const bool felt = f.F_command.norm() >= kBarelyFelt;
  switch (f.limit) {
    case ForceLimit::kNone:
      return {};
    case ForceLimit::kForce:
      return felt ? "the force is at its limit"
                  : "the force limit lets nothing through: raise --force-limit";
    case ForceLimit::kTorque:
      return "the torque is at its limit";
    case ForceLimit::kRate:
      return "the force may not change faster";
    case ForceLimit::kFade:
      return "the force fades in, or out while no updates arrive";
    case ForceLimit::kPower:
      return "the force may not give more power to the hand";
    case ForceLimit::kEnergy:
      return "the force gave more energy than it may: what pushes the hand is damped";
  }
  return "the force is limited";  // A limit that only a newer server knows.
}

ChainLink limiter(const ForceFacts& f) {
  return {"limiter", f.limit == ForceLimit::kNone ? "free" : std::string(name_of(f.limit)),
          limit_reason(f)};
}

ChainLink command(const ForceFacts& f) {
  return {"command", newtons(f.F_command.norm()),
          f.F_command.norm() < kNothing ? "the controller commands nothing" : ""};
}

}  // namespace

ForceChain force_chain(const ForceFacts& facts) {
  return {session(facts),    updates(facts), device(facts),      hand(facts),    contacts(facts),
          separation(facts), penalty(facts), environment(facts), limiter(facts), command(facts)};
}

const ChainLink* first_stop(const ForceChain& chain) noexcept {
  for (const ChainLink& link : chain) {
    if (!link.reason.empty()) return &link;
  }
  return nullptr;
}

}  // namespace hlm
