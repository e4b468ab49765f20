// One run of one method on one task: the server's tick and the client's frame in virtual time.
#pragma once

#include <cstdint>
#include <vector>

#include "experiments/cell.h"
#include "experiments/method.h"
#include "hlm/haptic_server/device/observed_device.h"
#include "hlm/haptic_server/device/simulated_device.h"
#include "hlm/haptic_server/report/tick_record.h"
#include "hlm/protocol/transport/memory_network.h"
#include "hlm/ve_client/scene/world_description.h"

namespace hlm::experiments {

/// What the computers and the network between them are like.
struct Conditions {
  double servo_rate = 512;  ///< Hz; 512 is the paper's.
  double ve_low = 30;       ///< Hz. The rate of each frame is drawn between these.
  double ve_high = 60;      ///< Hz.
  double ve_delay = 0;      ///< From sampling the tool to sending its contacts, s.
  protocol::LinkConditions link{.delay = 0.002};
  double healing_speed = 0;  ///< m/s; the paper has no healing.
  bool waits = false;        ///< The VE begins a frame when the update before is acknowledged.
};

/// What is touched, and how.
struct Task {
  ve::WorldDescription world;
  std::string tool;
  server::SimulatedDeviceOptions device;
  server::ObserverOptions observer;  ///< Where the device does not measure the hand's wrench.
  server::HandSegment hand;          ///< Goes on for ever, from `start` on.
  double duration = 5;               ///< s, of the hand's action.
  double stiffness = 4000;           ///< N/m: of the contacts or, without them, of the coupling.
  double damping = 30;               ///< N·s/m, likewise.
  double friction = 0.3;             ///< μ.
  /// The hand pushes at a point this far off the handle's origin at most, along x and y, m: drawn
  /// from the seed. Without it all is symmetric, and rotation never begins.
  double off_centre = 0.002;
};

struct Trial {
  Task task;
  Method method;
  Conditions conditions;
  std::uint64_t seed = 1;
};

/// What adopting one update did, with the proxy where it was.
struct UpdateEffect {
  double time = 0;    ///< s.
  double force = 0;   ///< N: change of the resultant of all spring forces.
  double rise = 0;    ///< N: largest rise of one contact's spring force.
  double fall = 0;    ///< N: largest fall; a contact that goes loses all.
  double energy = 0;  ///< J: change of the energy stored in all springs.
  /// Normal of a contact that the local model did not have before; zero if there is none.
  Vector3 arrived_n_W = Vector3::Zero();
};
// Without what arrived.
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(UpdateEffect, time, force, rise, fall, energy)

/// Time zero is when the hand begins to act.
struct Trace {
  ControllerKind controller = ControllerKind::kFourChannel;
  int device_delay = 0;  ///< Ticks from a command to its effect.
  std::vector<server::TickRecord> ticks;
  /// At the end of each tick, J: kinetic energy of a proxy with dynamics, and all contact springs'.
  std::vector<double> internal_energy;
  bool broken = false;  ///< The server left its running state, or the session ended.
  std::vector<UpdateEffect> updates;
};

/// The hand begins at a moment drawn from the seed, after the first report of the environment, so
/// that no two seeds have the same phase between hand, frames and steps.
Trace run(const Trial& trial);

/// A force of the hand, world axes, N: constant and with an amplitude at a frequency (Hz).
server::HandSegment push(const Vector3& constant);
server::HandSegment shake(const Vector3& amplitude, double frequency);

}  // namespace hlm::experiments
