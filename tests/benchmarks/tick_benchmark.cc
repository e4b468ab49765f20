// What one tick computes: local model and controller, by number of contacts and degrees of freedom.
#include <algorithm>
#include <memory>

#include <benchmark/benchmark.h>

#include "hlm/haptic_server/control/controller.h"
#include "hlm/haptic_server/local_model/local_model.h"
#include "hlm/haptic_server/safety/limiter.h"

namespace hlm::server {
namespace {

constexpr double kStep = 1e-3;  // s

/// d = 3: a planar tool; d = 6: a rigid tool; d = 12: a rigid tool with a chain of six links, held
/// and touched at its end.
ToolDescription tool_with(int dof) {
  ToolDescription tool;
  Link root;
  root.joint = dof == 3 ? JointType::kPlanar : JointType::kFree;
  root.I_LCom = 2e-3 * Matrix3::Identity();
  tool.links.push_back(root);
  for (int i = 6; i < dof; ++i) {
    Link link;
    link.parent = i - 6;
    link.joint = JointType::kRevolute;
    link.axis = Vector3::Unit(i % 3);
    link.X_PJ.p = {0.05, 0, 0};
    link.p_LCom = {0.025, 0, 0};
    link.mass = 0.2;
    link.I_LCom = 2e-4 * Matrix3::Identity();
    tool.links.push_back(link);
  }
  tool.hand_link = static_cast<int>(tool.links.size()) - 1;
  return tool;
}

/// Contacts spread over the walls of a square hole around the last link.
ReportedContacts contacts_of(const ToolModel& tool, int count) {
  ReportedContacts contacts;
  const int link = tool.links() - 1;
  for (int i = 0; i < count; ++i) {
    const double angle = 1.5707963267948966 * (i % 4);
    ReportedContact contact;
    contact.a.index = static_cast<std::uint32_t>(link);
    contact.identity = static_cast<std::uint64_t>(i);
    contact.n_W = {std::cos(angle), std::sin(angle), 0};
    contact.p_WC =
        tool.X_WL(link).p - 0.02 * contact.n_W + Vector3(0, 0, 0.002 * (i / 4 - count / 8));
    contacts.push_back(contact);
  }
  return contacts;
}

void tick(benchmark::State& state, bool adopts) {
  const ToolDescription tool = tool_with(static_cast<int>(state.range(0)));
  const ToolModel start(tool);
  const ReportedContacts contacts = contacts_of(start, static_cast<int>(state.range(1)));
  LocalModel model(tool, start.configuration(), {}, kStep);
  const Controller controller(ControllerKind::kFourChannel, {});
  Limiter limiter({}, {}, kStep);
  limiter.allow(true);

  DeviceState device;
  device.X_WD = model.proxy().X_WH();
  device.F_hand = Wrench::Constant(0.05);
  model.adopt({.contacts = contacts, .q_VE = start.configuration(), .age = 0.02});
  for (auto _ : state) {
    if (adopts) model.adopt({.contacts = contacts, .q_VE = start.configuration(), .age = 0.02});
    const ContactWrench felt =
        model.step(controller.to_proxy(device, {model.proxy().X_WH(), model.hand_twist()}));
    const HandMotion proxy{model.proxy().X_WH(), model.hand_twist()};
    const Wrench u = controller.to_device(device, proxy, {}, felt);
    benchmark::DoNotOptimize(limiter.limit(u, felt.impulse));
  }
}

/// A rigid tool of four contacts, without and with an external wrench, which each update changes.
void TickWithExternalWrench(benchmark::State& state) {
  const ToolDescription tool = tool_with(6);
  const ToolModel start(tool);
  const ReportedContacts contacts = contacts_of(start, 4);
  LocalModel model(tool, start.configuration(), {}, kStep);
  ExternalWrenches external(static_cast<std::size_t>(state.range(0)));
  Configuration q = start.configuration();
  const Velocity v = Velocity::Zero(6);
  double time = 0;
  for (auto _ : state) {
    time += 0.017;
    q[2] = 0.001 * std::sin(30 * time);
    for (ExternalWrench& each : external) each.F_W[2] = -2e4 * q[2];
    model.adopt({.contacts = contacts, .q_VE = q, .time = time, .v_VE = &v, .external = external});
    benchmark::DoNotOptimize(model.step({}));
  }
}

void Tick(benchmark::State& state) { tick(state, false); }
void TickWithUpdate(benchmark::State& state) { tick(state, true); }

/// A brick on the floor in front of the tool: four contacts between them, the others below it.
void add_brick(std::uint32_t id, int contacts, ReportedContacts& reported, MovableBodies& bodies) {
  MovableBody& body = bodies.emplace_back();
  body.id = id;
  body.p_WCom = {0.05, 0.05 * id, 0};
  body.W.diagonal() << Vector3::Constant(3), Vector3::Constant(3000);
  body.A_W[2] = -9.81;
  for (int i = 0; i < contacts; ++i) {
    ReportedContact& contact = reported.emplace_back();
    const Vector3 corner(i & 1 ? 0.02 : -0.02, i & 2 ? 0.02 : -0.02, 0.001 * (i / 4));
    contact.identity = 1000 * (id + 1) + static_cast<std::uint64_t>(i);
    contact.friction = 0.4;
    contact.p_WC = body.p_WCom + corner;
    if (i < 4) {
      contact.b = {SideKind::kMovableBody, id};
      contact.n_W = {-1, 0, 0};
      contact.p_WC.x() = 0.02;
    } else {
      contact.a = {SideKind::kMovableBody, id};
      contact.load = 0.1;
    }
  }
}

/// A rigid tool that pushes two bricks, contacts in all as given; an update repeats `replayed`
/// steps.
void tick_with_bodies(benchmark::State& state, int replayed) {
  const ToolDescription tool = tool_with(6);
  const ToolModel start(tool);
  ReportedContacts contacts;
  MovableBodies bodies;
  for (std::uint32_t id = 0; id < 2; ++id) {
    add_brick(id, static_cast<int>(state.range(0)) / 2, contacts, bodies);
  }
  const auto model =
      std::make_unique<LocalModel>(tool, start.configuration(), LocalModelParameters{}, kStep);
  HandInput hand;
  hand.F[0] = 1;
  const auto adopt = [&](std::uint64_t step) {
    model->adopt({.contacts = contacts,
                  .q_VE = start.configuration(),
                  .bodies = bodies,
                  .impulse_step = std::max(1.0, static_cast<double>(step) - replayed),
                  .period = 0.017});
  };
  for (int i = 0; i < 100; ++i) model->step(hand);
  adopt(100);
  for (auto _ : state) {
    if (replayed > 0) adopt(model->impulses().step());
    benchmark::DoNotOptimize(model->step(hand));
  }
}

/// A tool presses a stack of cubes and pushes its top: what moves, all in one system.
void Stack(benchmark::State& state) {
  const ToolDescription tool = tool_with(6);
  const ToolModel start(tool);
  ReportedContacts contacts;
  MovableBodies bodies;
  for (std::uint32_t id = 0; id < static_cast<std::uint32_t>(state.range(0)); ++id) {
    MovableBody& body = bodies.emplace_back();
    body.id = id;
    body.p_WCom = {0, 0, -0.05 * id - 0.025};
    body.W.diagonal() << Vector3::Constant(3), Vector3::Constant(8000);
    body.A_W[2] = -9.81;
    for (std::uint64_t i = 0; i < 8; ++i) {  // On what is below; four of the first with the tool.
      if (i >= 4 && id > 0) continue;
      ReportedContact& contact = contacts.emplace_back();
      contact.identity = 100 * (id + 1) + i;
      contact.friction = 0.5;
      contact.p_WC = {i & 1 ? 0.02 : -0.02, i & 2 ? 0.02 : -0.02, i < 4 ? -0.05 * (id + 1) : 0};
      if (i < 4) {
        contact.a = {SideKind::kMovableBody, id};
        if (id + 1 < state.range(0)) contact.b = {SideKind::kMovableBody, id + 1};
        contact.load = 0.75 * (id + 1);
      } else {
        contact.b = {SideKind::kMovableBody, id};
      }
    }
  }
  const auto model =
      std::make_unique<LocalModel>(tool, start.configuration(), LocalModelParameters{}, kStep);
  HandInput hand;
  hand.F.head<3>() << 1, 0, -3;
  std::uint64_t steps = 0;
  for (auto _ : state) {
    if (steps++ % 17 == 0) {
      state.PauseTiming();
      model->adopt({.contacts = contacts,
                    .q_VE = model->proxy().configuration(),
                    .bodies = bodies,
                    .impulse_step = static_cast<double>(model->impulses().step()),
                    .period = 0.017});
      state.ResumeTiming();
    }
    benchmark::DoNotOptimize(model->step(hand));
  }
}
BENCHMARK(Stack)->ArgName("bodies")->DenseRange(2, 8, 2)->Unit(benchmark::kMicrosecond);

void TickWithBodies(benchmark::State& state) { tick_with_bodies(state, 0); }
void TickThatRepeats60Steps(benchmark::State& state) { tick_with_bodies(state, 60); }
BENCHMARK(TickWithBodies)->ArgName("contacts")->Arg(16)->Arg(64)->Unit(benchmark::kMicrosecond);
BENCHMARK(TickThatRepeats60Steps)
    ->ArgName("contacts")
    ->Arg(16)
    ->Arg(64)
    ->Unit(benchmark::kMicrosecond);

const std::vector<std::vector<std::int64_t>> kCases{{3, 6, 12}, {1, 4, 16, 64}};
BENCHMARK(Tick)->ArgNames({"d", "contacts"})->ArgsProduct(kCases)->Unit(benchmark::kMicrosecond);
BENCHMARK(TickWithExternalWrench)->ArgName("wrenches")->Arg(0)->Arg(1);
BENCHMARK(TickWithUpdate)
    ->ArgNames({"d", "contacts"})
    ->ArgsProduct(kCases)
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace hlm::server
