// One run of a task in which the tool moves a body, in virtual time.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "experiments/cell.h"
#include "experiments/trial.h"
#include "hlm/haptic_server/device/hand.h"
#include "hlm/protocol/messages.h"

namespace hlm::experiments {

/// What is touched, and how.
struct BodyTask {
  ve::WorldDescription world;
  std::string tool = "tool";
  std::string body = "body::body";  ///< The one that is watched.
  server::HandScript hand;
  double duration = 4;  ///< s.
};

/// The server's loop stands still now and then, as on a busy machine.
struct Stalls {
  double shortest = 0;  ///< s.
  double longest = 0;   ///< s; 0: none.
  double every = 0.25;  ///< s, on average.
};

struct BodyConditions {
  double ve_rate = 60;      ///< Hz.
  double delay = 0;         ///< One way, s.
  double loss = 0;          ///< Share of datagrams.
  double stiffness = 4000;  ///< k, N/m.
  double epsilon = 0.005;   ///< m.
  double friction_scale =
      1;  ///< On the friction that updates report, against the environment's own.
  bool by_following = false;
  bool server_holds = true;  ///< With shapes it moves what the hand holds.
  bool shapes = false;       ///< The server has the shapes and finds contacts at every tick.
  Outage outage{};
  Stalls stalls{};
  std::optional<Method> method{};  ///< Instead of ε and shapes; none: the local model.
  std::string device{};  ///< File of the user's; empty: the usual one, with strong motors.
};

/// What tells them from the defaults.
Inputs inputs_of(const BodyConditions& conditions);

/// One tick, and where the body is in the environment.
struct BodySample {
  double time = 0;
  Wrench F_env = Wrench::Zero();  ///< What is felt, as method.h has it.
  Wrench F_command = Wrench::Zero();
  Pose X_WP;
  Twist V_WP = Twist::Zero();
  bool adopted = false;
  bool colliding = false;
  bool limited = false;
  std::size_t bodies = 0;  ///< In the local model.
  Pose X_WB;               ///< Of the body after the latest frame.
  Twist V_WB = Twist::Zero();
};

std::vector<BodySample> run(const BodyTask& task, const BodyConditions& conditions,
                            std::uint64_t seed);

/// Of the samples from a time on.
struct ForceStatistics {
  double mean = 0;
  double deviation = 0;  ///< Standard deviation, N.
  double largest = 0;    ///< |F|, N.
  double least = 0;      ///< Along the axis, N.
  double most = 0;
  double update_step = 0;  ///< Largest change in the tick of an update that is no collision, N.
  double step = 0;         ///< Largest change from any tick to the next, N.
  int collisions = 0;
  int limited = 0;  ///< Ticks.
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(ForceStatistics, mean, deviation, largest, least, most,
                                   update_step, step, collisions, limited)
/// Of F_env along an axis, from `begin` to `end` (s).
ForceStatistics force_along(const std::vector<BodySample>& samples, const Vector3& axis,
                            double begin, double end);

}  // namespace hlm::experiments
