#include "ve_client/frame.h"

#include <algorithm>

#include "common/uniform.h"

namespace hlm::ve {

VirtualEnvironment::VirtualEnvironment(const WorldDescription& description,
                                       const std::string& tool_name, const FollowOptions& follow)
    : assembly(assemble_tool(description, tool_name)),
      world(description, assembly.bodies),
      tool(world, assembly, follow),
      proximity(world, assembly),
      surroundings(world, proximity) {}

namespace {

/// Factor on what is travelled until contacts are replaced. 1 covers steady speed and equal periods
/// only; 2 nearly doubles the ghosts past edges.
constexpr double kMargin = 1.5;
/// Farthest that a body is held beyond ε, m.
constexpr double kFarthestHold = 0.05;

}  // namespace

double adapted_epsilon(const FrameOptions& options, double speed, double delay, double period) {
  const double travel = kMargin * speed * (delay + period);
  return std::clamp(travel, options.epsilon, std::max(options.epsilon, options.largest_epsilon));
}

namespace {

/// Takes over what the server says: where the tool goes, and its impulses on bodies.
void follow_server(VirtualEnvironment& environment, HapticClient& client, double period,
                   FrameResult& result) {
  auto& [assembly, world, tool, proximity, surroundings, selection] = environment;
  if (const protocol::ProxyState* proxy = result.inbox.state) {
    result.state_refused = !tool.can_follow(proxy->q, proxy->v);
    if (!result.state_refused) tool.set_target(proxy->q, proxy->v);
  }
  for (const auto& [body, P_W] : client.take_impulses(period)) {
    if (body < world.description().bodies.size() && world.is_movable(static_cast<int>(body))) {
      world.add_wrench(static_cast<int>(body), P_W / period);
    } else {
      result.state_refused = true;
    }
  }
}

/// The contacts of the tool within epsilon. A body in the engine follows the tool's impulses by
/// `lag` seconds: what was reported of it is, until it is farther than both can have moved in that.
std::vector<FoundContact> tool_contacts(VirtualEnvironment& environment, double epsilon,
                                        double lag) {
  const VirtualTool& tool = environment.tool;
  const Surroundings& surroundings = environment.surroundings;
  const bool holds = !surroundings.bodies().empty();
  const auto found = environment.proximity.query(tool, epsilon + (holds ? kFarthestHold : 0));
  std::vector<FoundContact> contacts(found.begin(), found.end());
  std::erase_if(contacts, [&](const FoundContact& contact) {
    const double travel = kMargin * lag * (tool.target_speed() + contact.v_WC.norm());
    const double hold = surroundings.reports(contact.key.b) ? std::min(travel, kFarthestHold) : 0;
    return contact.separation > epsilon + hold;
  });
  return contacts;
}

}  // namespace

FrameResult run_frame(VirtualEnvironment& environment, HapticClient& client, Clock& clock,
                      double period, const FrameOptions& options) {
  World& world = environment.world;
  VirtualTool& tool = environment.tool;
  Surroundings& surroundings = environment.surroundings;
  FrameResult result;
  const auto stands_still = [&] {
    result.fault = world.fault() ? &*world.fault() : nullptr;
    return result.fault != nullptr;
  };

  result.inbox = client.poll(clock.now());
  if (stands_still()) return result;
  follow_server(environment, client, period, result);

  // The tool pushes bodies by the impulses that the hand felt, and in no other way.
  const bool by_impulses = client.connected() && client.welcome().capabilities.movable_bodies &&
                           !options.push_by_following;
  const auto stops_tool = [&](int body) { return !by_impulses || surroundings.is_obstacle(body); };
  const double reach = tool.follow(period);
  world.step(period, environment.proximity.within_reach(tool, reach, stops_tool),
             [&](double h) { tool.pull(h); });
  if (stands_still()) return result;
  tool.read_back();

  const double sampled_at = clock.now();
  client.sample(sampled_at, tool.q(), tool.v(), period);
  const double delay = client.round_trip() + options.delay;
  result.epsilon = adapted_epsilon(options, tool.target_speed(), delay, period);
  const std::vector<FoundContact> found =
      tool_contacts(environment, result.epsilon, delay + 2 * period);
  const auto selected = environment.selection.select(found, environment.assembly.planar_normal_W);
  std::vector<FoundContact> contacts(selected.begin(), selected.end());
  result.found = found.size();
  for (const FoundContact& contact : contacts) {
    ++(contact.separation <= 0 ? result.active : result.predicted);
  }
  if (!options.report_friction) {
    for (FoundContact& contact : contacts) contact.friction = -1;
  }
  if (!by_impulses) {
    surroundings.find({}, 0);
  } else {
    surroundings.find(contacts, result.epsilon);
    result.bodies = surroundings.bodies().size();
    result.supports = surroundings.contacts().size();
    contacts.insert(contacts.end(), surroundings.contacts().begin(), surroundings.contacts().end());
  }

  if (options.delay > 0) clock.sleep_until(sampled_at + options.delay);
  client.send(clock.now(), reports_of(contacts),
              by_impulses ? surroundings.bodies() : MovableBodies{});
  return result;
}

double FramePeriods::next() { return 1 / uniform(engine_, low_, high_); }

}  // namespace hlm::ve
