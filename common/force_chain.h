// Why does a person feel nothing? The chain from the session to the force on the hand, and its
// first link that stops it. The live page and haptic_doctor show the same one.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>

#include "hlm/common/spatial.h"
#include "hlm/common/vocabulary.h"

namespace hlm {

/// What one side knows of a session at one instant. Empty: not known there. Forces are those at the
/// hand, world axes.
struct ForceFacts {
  bool session = false;  ///< A client has one.
  std::string refused;   ///< Why it has none; empty: not known.
  ServerState server{};
  Fault fault = Fault::kNone;
  std::optional<double> silence;      ///< Time since anything came from the client, s.
  std::optional<double> update_rate;  ///< Updates taken, Hz.
  double least_update_rate = 0;       ///< Rate below which force comes and goes, Hz.
  double age = 0;                     ///< Age of the latest contacts when they were taken, s.
  bool motors_off = false;            ///< The device's own safety, or its switch, holds them off.
  Vector3 p_WD = Vector3::Zero();     ///< Device handle, m.
  std::optional<Vector3> F_hand;      ///< N; empty where the device does not measure it.
  bool uses_contacts = true;          ///< Contacts make the force in the controller in effect.
  std::size_t reported = 0;           ///< Contacts.
  std::optional<double> epsilon;      ///< Contacts are reported from this separation on, m.
  std::size_t active = 0;             ///< Local contacts with separation <= 0.
  double smallest_separation = 0;     ///< Smallest separation of the local contacts, m.
  double stiffness = 0;               ///< Stiffness of a contact, N/m.
  std::optional<double> penalty;      ///< Sum of the contact forces' magnitudes, N.
  Vector3 F_env = Vector3::Zero();    ///< N.
  Vector3 F_command = Vector3::Zero();
  ForceLimit limit = ForceLimit::kNone;
};

struct ChainLink {
  std::string name;
  std::string value;   ///< Value for a person, at most two lines.
  std::string reason;  ///< Why it stops or limits the force, a clause; empty: it does not.
};

/// The links from the session to the command. A link without a part in the force has the value "–".
using ForceChain = std::array<ChainLink, 10>;
ForceChain force_chain(const ForceFacts& facts);

/// The first link that stops or limits the force; null if there is none.
const ChainLink* first_stop(const ForceChain& chain) noexcept;

}  // namespace hlm
