// A peg that enters a hole, and one that meets a wall, in virtual time.
#pragma once

#include <cstdint>
#include <optional>

#include "experiments/cell.h"
#include "experiments/method.h"
#include "tests/support/virtual_session.h"

namespace hlm::experiments {

struct CornerConditions {
  double delay = 0;                ///< One way, s.
  double epsilon = 0.005;          ///< m.
  double ve_low = 30;              ///< Hz. The rate of each frame is drawn between these.
  double ve_high = 60;             ///< Hz.
  bool shapes = true;              ///< The server has the shapes and finds contacts at every tick.
  double loss = 0;                 ///< Share of datagrams.
  double outage = 0;               ///< So long is all lost when it matters most, s.
  double settling = 0;             ///< So much longer does the hand wait before it begins, s.
  std::optional<Method> method{};  ///< Instead of ε and shapes; none: the local model.
  double stiffness = server::LocalModelParameters{}.stiffness;  ///< With a method, N/m.
  std::string device{};  ///< File of the user's; empty: one without friction, with strong motors.
};

/// A device and a server whose limits are far away, with this hand.
test::VirtualSessionOptions session_options(const server::HandScript& hand,
                                            const ve::WorldDescription& world,
                                            const CornerConditions& conditions, std::uint64_t seed);

/// A reach of a firm hand to p (m), turned by `angle` about z (rad).
server::HandSegment firm_reach(double duration, const Vector3& p, double angle = 0);
/// How long a reach with minimum jerk takes whose largest speed is `speed`, m/s.
double duration_of(double length, double speed);

/// What the walls of a hole are.
enum class Walls : std::uint8_t {
  kApart,    ///< Two blocks, 40 mm and twice the clearance apart.
  kTestbed,  ///< Those of worlds/testbed.sdf, 40 mm apart, which its floor adjoins.
  kBars,     ///< Four bars that touch, with level tops.
  kTiles,    ///< Eight tiles that touch, with level tops, about a ninth that is not there.
  kMesh,     ///< The skin of one mesh.
  kWedges,   ///< Two blocks whose edges are chamfered by wedges on them.
};

const char* name_of(Walls walls);

/// How a peg of 80 mm is led into a hole with its mouth at y = 0.
struct Entry {
  double clearance = 0.001;  ///< On each side, m.
  double speed = 0.2;        ///< Largest, m/s.
  bool wanders = false;      ///< It comes from the side over the edge, and goes in askew.
  std::uint64_t seed = 1;
  Walls walls = Walls::kApart;
};

Inputs inputs_of(const Entry& entry);

/// An entry with at least this gap, m, touches nothing.
inline constexpr double kTouchesNothing = 1e-5;
/// Force that is felt although nothing is there, N.
inline constexpr double kGhostForce = 0.5;

/// From the walls on its path, where these are not there, m.
double least_gap(const Entry& entry, const CornerConditions& conditions);

struct EntryOutcome {
  double largest_force = 0;    ///< Of the contacts on the hand, N.
  bool enters = false;         ///< The peg is in at the end.
  double acting_contacts = 0;  ///< In the local model, mean.
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(EntryOutcome, largest_force, enters, acting_contacts)
EntryOutcome enter(const Entry& entry, const CornerConditions& conditions);

/// How far from a wall force begins that a peg meets at `speed` (m/s), m; infinite if none does.
/// v·h where it is felt in the tick in which it is met.
double wall_error(double speed, const CornerConditions& conditions, std::uint64_t seed);

}  // namespace hlm::experiments
