#include "ve_client/frame.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "common/uniform.h"

namespace hlm::ve {
namespace {

std::vector<ToolAssembly> assemble(const WorldDescription& world,
                                   const std::vector<std::string>& names) {
  std::vector<ToolAssembly> assemblies;
  for (const std::string& name : names) assemblies.push_back(assemble_tool(world, name));
  return assemblies;
}

std::vector<int> bodies_of(const std::vector<ToolAssembly>& assemblies) {
  std::vector<int> bodies;
  for (const ToolAssembly& assembly : assemblies) {
    bodies.insert(bodies.end(), assembly.bodies.begin(), assembly.bodies.end());
  }
  return bodies;
}

}  // namespace

HeldTool::HeldTool(World& world, ToolAssembly assembled, const FollowOptions& follow)
    : assembly(std::move(assembled)),
      tool(world, assembly, follow),
      proximity(world, assembly),
      surroundings(world, proximity) {}

VirtualEnvironment::VirtualEnvironment(const WorldDescription& description,
                                       const std::vector<std::string>& tool_names,
                                       const FollowOptions& follow)
    : VirtualEnvironment(description, assemble(description, tool_names), follow) {}

VirtualEnvironment::VirtualEnvironment(const WorldDescription& description,
                                       std::vector<ToolAssembly> assemblies,
                                       const FollowOptions& follow)
    : world(description, bodies_of(assemblies)), shared(world, assemblies.size()) {
  for (ToolAssembly& assembly : assemblies) tools.emplace_back(world, std::move(assembly), follow);
}

namespace {

/// Factor on what is travelled until contacts are replaced. 1 covers steady speed and equal periods
/// only; larger values send more contacts.
constexpr double kMargin = 1.5;
/// Farthest from the proxy that what separates the tool from a shape says something of it, m.
constexpr double kFarthestLag = 0.05;
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

/// Takes over what the server says: where the tool goes, and its impulses on bodies. Returns these
/// as wrenches during the frame.
Pushes follow_server(World& world, VirtualTool& tool, HapticClient& client, double period,
                     FrameResult& result) {
  if (const protocol::ProxyState* proxy = result.inbox.state) {
    result.state_refused = !tool.can_follow(proxy->q, proxy->v);
    if (!result.state_refused) tool.set_target(proxy->q, proxy->v);
  }
  Pushes pushes;
  for (const auto& [body, P_W] : client.take_impulses(period)) {
    if (body < world.description().bodies.size() && world.is_movable(static_cast<int>(body))) {
      world.add_wrench(static_cast<int>(body), P_W / period);
      pushes[static_cast<int>(body)] = P_W / period;
    } else {
      result.state_refused = true;
    }
  }
  return pushes;
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
std::vector<FoundContact> tool_contacts(const World& world, HeldTool& held, double epsilon,
                                        double lag, bool all_axes) {
  const VirtualTool& tool = held.tool;
  const Surroundings& surroundings = held.surroundings;
  const bool holds = !surroundings.bodies().empty();
  const auto found = held.proximity.query(tool, epsilon + (holds ? kFarthestHold : 0), all_axes);
  std::vector<FoundContact> contacts(found.begin(), found.end());
  std::erase_if(contacts, [&](const FoundContact& contact) {
    const double travel = kMargin * lag * (tool.target_speed() + contact.v_WC.norm());
    const double hold = surroundings.reports(contact.key.b) ? std::min(travel, kFarthestHold) : 0;
    return contact.separation > epsilon + hold;
  });
  held.skin_contacts.name(world, tool, contacts);
  return contacts;
}

/// Those to send: the selected ones of the best axes, and the other axes of their pairs.
std::vector<FoundContact> selected(HeldTool& held, std::vector<FoundContact> found) {
  const auto other = std::stable_partition(
      found.begin(), found.end(), [](const FoundContact& contact) { return contact.axis == 0; });
  std::vector<FoundContact> others(other, found.end());
  found.erase(other, found.end());
  const auto& planar_normal_W = held.assembly.planar_normal_W;
  const auto best = held.selection.select(found, planar_normal_W);
  std::vector<FoundContact> contacts(best.begin(), best.end());
  add_other_axes(std::move(others), planar_normal_W, contacts);
  return contacts;
}

/// The tool pushes bodies by the impulses that the hand felt, and in no other way.
bool pushes_by_impulses(const HapticClient& client, const FrameOptions& options) {
  return client.connected() && client.welcome().capabilities.movable_bodies &&
         !options.push_by_following;
}

/// What the servers say, for all tools.
void follow_servers(VirtualEnvironment& environment, std::span<HapticClient* const> clients,
                    double period, std::span<FrameResult> results) {
  std::vector<Pushes> pushes;
  std::vector<MovableBodies> reported;
  double round_trip = 0;
  for (std::size_t i = 0; i < clients.size(); ++i) {
    HeldTool& held = environment.tools[i];
    pushes.push_back(follow_server(environment.world, held.tool, *clients[i], period, results[i]));
    reported.push_back(held.surroundings.bodies());
    round_trip = std::max(round_trip, clients[i]->round_trip());
  }
  environment.shared.push(pushes, reported, period, round_trip);
}

/// What stops a tool in the engine.
std::function<bool(int body)> obstacles(const VirtualEnvironment& environment,
                                        std::span<HapticClient* const> clients, std::size_t tool,
                                        const FrameOptions& options) {
  // A tool that nobody holds any more does not push what others hold.
  const bool left = clients.size() > 1 && !clients[tool]->connected();
  const bool by_impulses = pushes_by_impulses(*clients[tool], options);
  const Surroundings& surroundings = environment.tools[tool].surroundings;
  return [&world = environment.world, &surroundings, left, by_impulses](int body) {
    if (left) return !world.is_movable(body);
    return !by_impulses || surroundings.is_obstacle(body);
  };
}

/// One step of the engine, in which the tools follow their proxies.
void step(VirtualEnvironment& environment, std::span<HapticClient* const> clients, double period,
          const FrameOptions& options) {
  std::vector<ToolContact> contacts;
  for (std::size_t i = 0; i < clients.size(); ++i) {
    HeldTool& held = environment.tools[i];
    const double reach = held.tool.follow(period);
    const auto stops_tool = obstacles(environment, clients, i, options);
    const auto own = held.proximity.within_reach(held.tool, reach, stops_tool);
    contacts.insert(contacts.end(), own.begin(), own.end());
  }
  environment.world.step(period, contacts, [&](double h) {
    for (HeldTool& held : environment.tools) held.tool.pull(h);
  });
}

/// What a server is told.
struct Report {
  ReportedContacts contacts;
  MovableBodies bodies;
};

/// What the tool touches, or nearly touches, and the bodies that it can push.
Report find_contacts(VirtualEnvironment& environment, std::size_t i, const HapticClient& client,
                     double period, const FrameOptions& options, FrameResult& result) {
  HeldTool& held = environment.tools[i];
  Surroundings& surroundings = held.surroundings;
  const double delay = client.round_trip() + options.delay;
  result.epsilon = adapted_epsilon(options, held.tool.target_speed(), delay, period);
  // Which axes separate the tool from a shape says nothing of a proxy that is elsewhere, as it is
  // where contacts come late: without prediction always.
  const bool all_axes = client.connected() && client.welcome().capabilities.axes &&
                        !options.one_axis && result.epsilon > 0 &&
                        held.tool.lag() <= kFarthestLag;
  std::vector<FoundContact> found =
      tool_contacts(environment.world, held, result.epsilon, delay + 2 * period, all_axes);
  result.found = static_cast<std::size_t>(std::ranges::count(found, 0, &FoundContact::axis));
  std::vector<FoundContact> contacts = selected(held, std::move(found));
  for (const FoundContact& contact : contacts) {
    if (contact.axis > 0) {
      ++result.on_other_axes;
    } else {
      ++(contact.separation <= 0 ? result.active : result.predicted);
    }
  }
  if (!options.report_friction[i]) {
    for (FoundContact& contact : contacts) contact.friction = -1;
  }
  if (!pushes_by_impulses(client, options)) {
    surroundings.find({}, 0);
    return {reports_of(contacts), {}};
  }
  surroundings.find(contacts, result.epsilon);
  result.bodies = surroundings.bodies().size();
  result.supports = surroundings.contacts().size();
  contacts.insert(contacts.end(), surroundings.contacts().begin(), surroundings.contacts().end());
  return {reports_of(contacts), surroundings.bodies()};
}

}  // namespace

std::vector<FrameResult> run_frame(VirtualEnvironment& environment,
                                   std::span<HapticClient* const> clients, Clock& clock,
                                   double period, const FrameOptions& options) {
  World& world = environment.world;
  std::vector<FrameResult> results(clients.size());
  const auto stands_still = [&] {
    for (FrameResult& result : results) result.fault = world.fault() ? &*world.fault() : nullptr;
    return world.fault().has_value();
  };

  for (std::size_t i = 0; i < clients.size(); ++i) {
    results[i].inbox = clients[i]->poll(clock.now());
  }
  if (stands_still()) return results;
  follow_servers(environment, clients, period, results);
  step(environment, clients, period, options);
  if (stands_still()) return results;
  for (std::size_t i = 0; i < clients.size(); ++i) {
    HeldTool& held = environment.tools[i];
    held.tool.read_back();
    held.catch_up.update(held.tool, held.proximity, obstacles(environment, clients, i, options));
  }

  const double sampled_at = clock.now();
  std::vector<Report> reports;
  for (std::size_t i = 0; i < clients.size(); ++i) {
    HeldTool& held = environment.tools[i];
    clients[i]->sample(sampled_at, held.tool.q(), held.tool.v(), period);
    reports.push_back(find_contacts(environment, i, *clients[i], period, options, results[i]));
    environment.shared.add_others(i, reports.back().bodies);
  }
  if (options.delay > 0) clock.sleep_until(sampled_at + options.delay);
  for (std::size_t i = 0; i < clients.size(); ++i) {
    clients[i]->send(clock.now(), reports[i].contacts, reports[i].bodies);
  }
  return results;
}

double FramePeriods::next() { return 1 / uniform(engine_, low_, high_); }

}  // namespace hlm::ve
