#include "ve_client/frame.h"

#include <algorithm>

#include "common/uniform.h"
#include "ve_client/contacts/select.h"

namespace hlm::ve {

VirtualEnvironment::VirtualEnvironment(const WorldDescription& description,
                                       const std::string& tool_name, const FollowOptions& follow)
    : assembly(assemble_tool(description, tool_name)),
      world(description, assembly.bodies),
      tool(world, assembly, follow),
      proximity(world, assembly) {}

double adapted_epsilon(const FrameOptions& options, double speed, double delay, double period) {
  // 1 covers steady speed and equal periods only; 2 nearly doubles the ghosts past edges.
  constexpr double kMargin = 1.5;
  const double travel = kMargin * speed * (delay + period);
  return std::clamp(travel, options.epsilon, std::max(options.epsilon, options.largest_epsilon));
}

FrameResult run_frame(VirtualEnvironment& environment, HapticClient& client, Clock& clock,
                      double period, const FrameOptions& options) {
  auto& [assembly, world, tool, proximity] = environment;
  FrameResult result;

  result.inbox = client.poll(clock.now());
  if (const protocol::ProxyState* proxy = result.inbox.state) {
    result.state_refused = !tool.can_follow(proxy->q, proxy->v);
    if (!result.state_refused) tool.set_target(proxy->q, proxy->v);
  }

  const double reach = tool.follow(period);
  world.step(period, proximity.within_reach(tool, reach), [&](double h) { tool.pull(h); });
  tool.read_back();

  const double sampled_at = clock.now();
  client.sample(sampled_at, tool.q(), tool.v(), period);
  const double delay = client.round_trip() + options.delay;
  result.epsilon = adapted_epsilon(options, tool.target_speed(), delay, period);
  const std::vector<FoundContact> contacts =
      select_contacts(proximity.query(tool, result.epsilon), assembly.planar_normal_W);

  if (options.delay > 0) clock.sleep_until(sampled_at + options.delay);
  client.send(clock.now(), reports_of(contacts));

  for (const FoundContact& contact : contacts) {
    ++(contact.separation <= 0 ? result.active : result.predicted);
  }
  return result;
}

double FramePeriods::next() { return 1 / uniform(engine_, low_, high_); }

}  // namespace hlm::ve
