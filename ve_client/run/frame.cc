#include "hlm/ve_client/run/frame.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <utility>

#include "hlm/common/uniform.h"
#include "hlm/ve_client/world/catch_up.h"
#include "hlm/ve_client/world/scene_shapes.h"

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

/// Factor on the time until an update is replaced. 1 covers steady speed and equal periods only;
/// larger values send more.
constexpr double kMargin = 1.5;
/// Farthest that a body is held beyond ε, m.
constexpr double kFarthestHold = 0.05;
/// With shapes, bodies within this are sent, m, and within what the tool travels until the next
/// update but so many has come, at most the third, m: a body that was not sent is a wall.
constexpr double kNearBodies = 0.02;
/// A hand at rest may be as fast, m/s, before the client hears of it.
constexpr double kUsualSpeed = 0.3;
constexpr double kLosses = 3;
constexpr double kFarthestBodies = 0.3;

/// Takes over what the server says: where the tool goes, and its impulses on bodies, which a world
/// that stands still does not get. Returns these as wrenches during the frame.
Pushes follow_server(World& world, bool moves, VirtualTool& tool, HapticClient& client,
                     double period, FrameResult& result) {
  if (const protocol::ProxyState* proxy = result.inbox.state) {
    result.state_refused = !tool.can_follow(proxy->q, proxy->v);
    if (!result.state_refused) tool.set_target(proxy->q, proxy->v);
  }
  Pushes pushes;
  for (const auto& [body, P_W] : client.take_impulses(period)) {
    if (body < world.description().bodies.size() && world.is_movable(static_cast<int>(body))) {
      if (moves) world.add_wrench(static_cast<int>(body), P_W / period);
      pushes[static_cast<int>(body)] = P_W / period;
    } else {
      result.state_refused = true;
    }
  }
  return pushes;
}

/// The server finds the contacts of shapes itself: what the tool is near tells which bodies it may
/// push next.
bool finds_contacts(const HapticClient& client, const FrameOptions& options) {
  return options.shapes && client.has_scene();
}

/// How old the proxy's state that an update is for gets until the update is replaced, s: the state
/// was sent as the frame before began.
double age_when_replaced(const HapticClient& client, double period, const FrameOptions& options) {
  return kMargin * (client.round_trip() + options.delay + 2 * period);
}

/// Within which the tool's contacts are looked for, m. With shapes they tell which bodies it may
/// push until the update is replaced.
double reach_of(const VirtualTool& tool, double age, bool shapes, const FrameOptions& options) {
  if (!shapes) return options.epsilon;
  return std::min(kNearBodies + kLosses * age * std::max(tool.target_speed(), kUsualSpeed),
                  kFarthestBodies);
}

/// The contacts of the tool within ε. A body in the engine follows the tool's impulses late: what
/// was reported of it is, until it is farther than both can have moved meanwhile.
std::vector<FoundContact> tool_contacts(const World& world, HeldTool& held, double epsilon,
                                        double age) {
  const VirtualTool& tool = held.tool;
  const Surroundings& surroundings = held.surroundings;
  const bool holds = !surroundings.bodies().empty();
  const auto found = held.proximity.query(tool, epsilon + (holds ? kFarthestHold : 0));
  std::vector<FoundContact> contacts(found.begin(), found.end());
  std::erase_if(contacts, [&](const FoundContact& contact) {
    const double travel = age * (tool.target_speed() + contact.v_WC.norm());
    const double hold = surroundings.reports(contact.key.b) ? std::min(travel, kFarthestHold) : 0;
    return contact.separation > epsilon + hold;
  });
  held.skin_contacts.name(
      world.pieces(), [&](int link) { return tool.X_WB(link); }, contacts);
  return contacts;
}

/// The tool pushes bodies by the impulses that the hand felt, and in no other way.
bool pushes_by_impulses(const HapticClient& client, const FrameOptions& options) {
  return client.connected() && client.welcome().capabilities.movable_bodies &&
         !options.push_by_following;
}

/// Puts the bodies that the hand holds where the server has them.
/// pace: of the world's time, in the hand's.
void place_held(World& world, double pace, HapticClient& client, FrameResult& result) {
  for (const HeldPlace& held : client.take_held()) {
    const auto body = static_cast<int>(held.body);
    if (held.body >= world.description().bodies.size() || !world.is_movable(body)) {
      result.state_refused = true;
      continue;
    }
    world.hold(body, held.X_WB, pace > 0 ? Twist(held.V_W / pace) : Twist(Twist::Zero()));
    if (!is_held(held.number)) world.let_go(body);
  }
}

/// What the servers say, for all tools. length: of the world's step, s.
void follow_servers(VirtualEnvironment& environment, std::span<HapticClient* const> clients,
                    double period, double length, std::span<FrameResult> results) {
  std::vector<Pushes> pushes;
  std::vector<MovableBodies> reported;
  double round_trip = 0;
  for (std::size_t i = 0; i < clients.size(); ++i) {
    HeldTool& held = environment.tools[i];
    pushes.push_back(
        follow_server(environment.world, length > 0, held.tool, *clients[i], period, results[i]));
    place_held(environment.world, environment.pace.now(), *clients[i], results[i]);
    reported.push_back(held.surroundings.bodies());
    round_trip = std::max(round_trip, clients[i]->round_trip());
  }
  const auto hands = std::ranges::count_if(clients, &HapticClient::connected);
  if (length > 0) environment.shared.push(pushes, reported, length, round_trip, hands > 1);
}

/// Those that the server moves once the hand holds them.
std::function<bool(int body)> bodies_to_hold(const HapticClient& client,
                                             const FrameOptions& options) {
  return [&client, follows = options.push_by_following](int body) {
    return !follows && client.holds(static_cast<std::uint32_t>(body));
  };
}

/// What stops a tool in the engine.
std::function<bool(int body)> obstacles(const VirtualEnvironment& environment,
                                        std::span<HapticClient* const> clients, std::size_t tool,
                                        const FrameOptions& options) {
  // A tool that nobody holds any more does not push what others hold.
  const bool left = clients.size() > 1 && !clients[tool]->connected();
  const bool by_impulses = pushes_by_impulses(*clients[tool], options);
  const Surroundings& surroundings = environment.tools[tool].surroundings;
  const auto held_by_server = bodies_to_hold(*clients[tool], options);
  return [&world = environment.world, &surroundings, left, held_by_server, by_impulses](int body) {
    if (left) return !world.is_movable(body);
    // Until the server has it, as when a session begins, the tool carries it here.
    if (held_by_server(body)) return !world.is_held(body);
    return !by_impulses || surroundings.is_obstacle(body);
  };
}

/// Natural frequency of a pulled body on its spring, Hz, and the largest force, N: as a finger
/// would, it drags what is light, and leaves what is heavy.
constexpr double kPullFrequency = 3;
constexpr double kMostPull = 10;

/// Draws a body during one step of the world's solver, h seconds: critically damped, integrated as
/// VirtualTool::pull(). Returns the wrench about its centre of mass.
Wrench pull_body(World& world, const BodyPull& pull, double h) {
  const Pose X_WB = world.X_WB(pull.body);
  const Vector3 p_W = X_WB * pull.p_B;
  const double w = 2 * std::numbers::pi * kPullFrequency;
  const Vector3 v = world.velocity_at(pull.body, p_W);
  const Vector3 a =
      (w * w * (pull.target_W - p_W - h * v) - 2 * w * v) / (1 + 2 * w * h + w * w * h * h);
  Vector3 f = world.description().bodies[static_cast<std::size_t>(pull.body)].mass * a;
  if (f.norm() > kMostPull) f *= kMostPull / f.norm();
  Wrench F;
  F << f, (p_W - X_WB.p).cross(f);
  world.add_wrench(pull.body, F);
  return F;
}

/// One step of the engine, in which the tools follow their proxies; without a length they are where
/// these are. length: s.
void step(VirtualEnvironment& environment, std::span<HapticClient* const> clients, double length,
          const FrameOptions& options) {
  environment.pulled.setZero();
  if (length == 0) {
    for (HeldTool& held : environment.tools) held.tool.carry();
    return;
  }
  std::vector<ToolContact> contacts;
  for (std::size_t i = 0; i < clients.size(); ++i) {
    HeldTool& held = environment.tools[i];
    held.tool.set_pace(environment.pace.of_step());
    const double reach = held.tool.follow(length);
    const auto stops_tool = obstacles(environment, clients, i, options);
    const auto own = held.proximity.within_reach(held.tool, reach, stops_tool);
    contacts.insert(contacts.end(), own.begin(), own.end());
  }
  environment.world.step(length, contacts, [&](double h) {
    for (HeldTool& held : environment.tools) held.tool.pull(h);
    if (options.pull) {
      environment.pulled += h / length * pull_body(environment.world, *options.pull, h);
    }
  });
  for (std::size_t i = 0; i < clients.size(); ++i) {
    HeldTool& held = environment.tools[i];
    held.tool.read_back();
    catch_up(held.tool, held.proximity, obstacles(environment, clients, i, options));
  }
}

/// What is reported to a server.
struct Report {
  ReportedContacts contacts;
  MovableBodies bodies;
  BodyPoses poses;
};

/// What the tool touches, or nearly touches, and the bodies that it can push.
Report find_contacts(VirtualEnvironment& environment, std::size_t i, const HapticClient& client,
                     double period, const FrameOptions& options, FrameResult& result) {
  HeldTool& held = environment.tools[i];
  Surroundings& surroundings = held.surroundings;
  const bool shapes = finds_contacts(client, options);
  const double age = age_when_replaced(client, period, options);
  result.epsilon = reach_of(held.tool, age, shapes, options);
  std::vector<FoundContact> contacts = tool_contacts(environment.world, held, result.epsilon, age);
  result.found = contacts.size();
  if (!shapes) {
    const auto selected = held.selection.select(contacts, held.assembly.planar_normal_W);
    contacts = std::vector<FoundContact>(selected.begin(), selected.end());
  }
  result.active = static_cast<std::size_t>(std::ranges::count_if(
      contacts, [](const FoundContact& contact) { return contact.separation <= 0; }));
  result.predicted = contacts.size() - result.active;
  if (!options.report_friction[i]) {
    for (FoundContact& contact : contacts) contact.friction = -1;
  }
  std::vector<FoundContact> none;
  surroundings.find(pushes_by_impulses(client, options) ? contacts : none, options.epsilon, shapes,
                    bodies_to_hold(client, options));
  if (shapes) contacts.clear();
  result.bodies = surroundings.bodies().size();
  result.supports = surroundings.contacts().size();
  contacts.insert(contacts.end(), surroundings.contacts().begin(), surroundings.contacts().end());
  return {
      reports_of(contacts), surroundings.bodies(),
      shapes ? body_poses(environment.world, held.tool, options.push_by_following) : BodyPoses()};
}

/// Of the tool's joints, where their gripper's opening is that, unless its device leads it.
JointDrives drives_of(const ToolAssembly& tool, double opening) {
  JointDrives drives = tool.drives;
  for (JointDrive& drive : drives) {
    drive.target = drive.closed + opening * (drive.open - drive.closed);
  }
  return drives;
}

/// What pulls a body, besides its contacts.
void add_pull(const VirtualEnvironment& environment, const BodyPull& pull, MovableBodies& bodies) {
  for (MovableBody& body : bodies) {
    if (static_cast<int>(body.id) == pull.body) body.A_W += body.W * environment.pulled;
  }
}

/// What a world of this pace looks like in the hand's time.
void slow_down(Report& report, double pace) {
  for (MovableBody& body : report.bodies) {
    body.V_W *= pace;
    body.W *= pace * pace;
    body.A_W *= pace * pace;
  }
  for (ReportedContact& contact : report.contacts) contact.v_WC *= pace;
  for (auto& pose : report.poses) pose.V_W *= pace;
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
  const double length = environment.pace.begin_frame(period, options.pace);
  follow_servers(environment, clients, period, length, results);
  step(environment, clients, length, options);
  if (stands_still()) return results;

  const double sampled_at = clock.now();
  const double pace = environment.pace.now();
  std::vector<Report> reports;
  for (std::size_t i = 0; i < clients.size(); ++i) {
    HeldTool& held = environment.tools[i];
    clients[i]->sample(sampled_at, held.tool.q(), held.tool.v(), period);
    clients[i]->drive(drives_of(held.assembly, options.opening));
    reports.push_back(find_contacts(environment, i, *clients[i], period, options, results[i]));
    // As the pace changes so do accelerations, as nothing in the world does.
    if (pace == 1) clients[i]->follow_accelerations(reports.back().bodies);
    environment.shared.add_others(i, reports.back().bodies);
    if (options.pull) add_pull(environment, *options.pull, reports.back().bodies);
    slow_down(reports.back(), pace);
    clients[i]->set_pace(pace);
  }
  if (options.delay > 0) clock.sleep_until(sampled_at + options.delay);
  for (std::size_t i = 0; i < clients.size(); ++i) {
    clients[i]->send(clock.now(), reports[i].contacts, reports[i].bodies, reports[i].poses);
  }
  return results;
}

double FramePeriods::next() { return 1 / uniform(engine_, low_, high_); }

}  // namespace hlm::ve
