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
/// only; larger values send more contacts.
constexpr double kMargin = 1.5;
/// Farthest that a body is held beyond ε, m.
constexpr double kFarthestHold = 0.05;
/// Most contacts of the tool, on all axes: what is left is for those of bodies.
constexpr std::size_t kMostToolContacts = 2 * kMaxSelected;
static_assert(kMostToolContacts <= kMaxContacts);

}  // namespace

double adapted_epsilon(const FrameOptions& options, double speed, double delay, double period) {
  const double travel = kMargin * speed * (delay + period);
  return std::clamp(travel, options.epsilon, std::max(options.epsilon, options.largest_epsilon));
}

namespace {

/// Takes over what the server says: where the tool goes, and its impulses on bodies.
void follow_server(VirtualEnvironment& environment, HapticClient& client, double period,
                   FrameResult& result) {
  World& world = environment.world;
  VirtualTool& tool = environment.tool;
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

/// Adds the contacts on the other axes of the pairs that are sent, nearest pairs first: all of a
/// pair's or none, for a server treats what is missing as no obstacle to the others.
void add_other_axes(std::vector<FoundContact> others, const std::optional<Vector3>& planar_normal_W,
                    std::vector<FoundContact>& contacts) {
  std::vector<const FoundContact*> nearest;
  for (const FoundContact& contact : contacts) nearest.push_back(&contact);
  std::ranges::stable_sort(nearest, {}, &FoundContact::separation);
  std::vector<std::uint32_t> pairs;
  for (const FoundContact* contact : nearest) {
    if (std::ranges::find(pairs, contact->pair) == pairs.end()) pairs.push_back(contact->pair);
  }
  for (const std::uint32_t pair : pairs) {
    std::vector<FoundContact> of_pair;
    std::erase_if(others, [&](const FoundContact& contact) {
      if (contact.pair != pair) return false;
      of_pair.push_back(contact);
      return true;
    });
    ContactSelection selection;
    const auto selected = selection.select(of_pair, planar_normal_W);
    if (contacts.size() + selected.size() > kMostToolContacts) return;
    contacts.insert(contacts.end(), selected.begin(), selected.end());
  }
}

/// The contacts of the tool within epsilon. A body in the engine follows the tool's impulses by
/// `lag` seconds: what was reported of it is, until it is farther than both can have moved in that.
std::vector<FoundContact> tool_contacts(VirtualEnvironment& environment, double epsilon, double lag,
                                        bool all_axes) {
  const VirtualTool& tool = environment.tool;
  const Surroundings& surroundings = environment.surroundings;
  const bool holds = !surroundings.bodies().empty();
  const auto found =
      environment.proximity.query(tool, epsilon + (holds ? kFarthestHold : 0), all_axes);
  std::vector<FoundContact> contacts(found.begin(), found.end());
  std::erase_if(contacts, [&](const FoundContact& contact) {
    const double travel = kMargin * lag * (tool.target_speed() + contact.v_WC.norm());
    const double hold = surroundings.reports(contact.key.b) ? std::min(travel, kFarthestHold) : 0;
    return contact.separation > epsilon + hold;
  });
  environment.skin_contacts.name(environment.world, tool, contacts);
  return contacts;
}

/// Those to send: the selected ones of the best axes, and the other axes of their pairs.
std::vector<FoundContact> selected(VirtualEnvironment& environment,
                                   std::vector<FoundContact> found) {
  const auto other = std::stable_partition(
      found.begin(), found.end(), [](const FoundContact& contact) { return contact.axis == 0; });
  std::vector<FoundContact> others(other, found.end());
  found.erase(other, found.end());
  const auto& planar_normal_W = environment.assembly.planar_normal_W;
  const auto best = environment.selection.select(found, planar_normal_W);
  std::vector<FoundContact> contacts(best.begin(), best.end());
  add_other_axes(std::move(others), planar_normal_W, contacts);
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
  const bool all_axes =
      client.connected() && client.welcome().capabilities.axes && !options.one_axis;
  std::vector<FoundContact> found =
      tool_contacts(environment, result.epsilon, delay + 2 * period, all_axes);
  result.found = static_cast<std::size_t>(std::ranges::count(found, 0, &FoundContact::axis));
  std::vector<FoundContact> contacts = selected(environment, std::move(found));
  for (const FoundContact& contact : contacts) {
    if (contact.axis > 0) {
      ++result.on_other_axes;
    } else {
      ++(contact.separation <= 0 ? result.active : result.predicted);
    }
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
