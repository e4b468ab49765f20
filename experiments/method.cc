#include "experiments/method.h"

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

#include "tests/support/virtual_session.h"

namespace hlm::experiments {

const Method& method(std::string_view name) {
  std::string known;
  for (const Method& candidate : kMethods) {
    if (candidate.name == name) return candidate;
    known.append(known.empty() ? "" : ", ").append(candidate.name);
  }
  throw std::runtime_error("method '" + std::string(name) + "' must be one of " + known);
}

bool couples_engine(const Method& method) { return !traits(method.controller).uses_contacts; }

void use(const Method& method, double stiffness, double damping,
         test::VirtualSessionOptions& options) {
  options.frame.epsilon = method.epsilon;
  options.frame.shapes = method.shapes;
  server::ServoOptions& servo = options.servo;
  servo.controller = method.controller;
  servo.local_model.update_rule = method.update_rule;
  servo.local_model.stiffness = stiffness;
  servo.local_model.damping = damping;
  if (!couples_engine(method)) return;
  // One frequency for translation and rotation: the engine's spring turns with K I / m.
  constexpr double mass = 1;           // kg, of the tool
  constexpr double inertia = 6.67e-4;  // kg·m², of the peg about z
  servo.gains = {.stiffness = stiffness,
                 .damping = damping,
                 .angular_stiffness = stiffness * inertia / mass,
                 .angular_damping = damping * inertia / mass};
  const double w = std::sqrt(stiffness / mass);
  options.follow = {.mode = ve::FollowMode::kImplicit,
                    .frequency = w / (2 * std::numbers::pi),
                    .damping_ratio = damping / (2 * mass * w),
                    .max_force = 1e6};
}

const Wrench& felt(const std::optional<Method>& method, const server::TickRecord& record) {
  return method && couples_engine(*method) ? record.F_command : record.F_env;
}

void cut(const Outage& outage, const server::TickRecord& record,
         const protocol::LinkConditions& otherwise, test::VirtualSession& session) {
  const double rate = server::ServoOptions{}.rate;
  const double since = std::round(static_cast<double>(record.step) - outage.begin * rate);
  if (since == 0) session.network().set_conditions({.delay = otherwise.delay, .loss = 1});
  if (since == std::round(outage.duration * rate)) session.network().set_conditions(otherwise);
}

}  // namespace hlm::experiments
