// Linkages: energy and motion of free chains, what the hand feels of them in every posture, links
// that touch each other, joints at their limits, weight.
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <Eigen/Eigenvalues>
#include <spdlog/fmt/fmt.h>

#include "experiments/experiments.h"
#include "hlm/common/uniform.h"
#include "hlm/haptic_server/device/hand_script.h"
#include "hlm/haptic_server/local_model/free_motion.h"
#include "hlm/haptic_server/local_model/hand_map.h"
#include "hlm/haptic_server/local_model/local_model.h"
#include "tests/support/virtual_session.h"

namespace hlm::experiments {
namespace {

using server::LocalModel;

constexpr double kStep = 1e-3;   // s
constexpr double kLink = 0.2;    // m
constexpr double kThick = 0.01;  // m, half of a link's width
constexpr double kMass = 0.4;    // kg, of a link

/// Bars that turn about z, x and y in turn, or about z alone; held at the last one's end.
ToolDescription chain(int links, JointType root, bool planar) {
  const Vector3 axes[] = {Vector3::UnitZ(), Vector3::UnitY(), Vector3::UnitX()};
  const double across = 2 * kMass / 3 * kThick * kThick;
  const double along = kMass / 3 * (kLink * kLink / 4 + kThick * kThick);
  ToolDescription tool;
  for (int i = 0; i < links; ++i) {
    Link& link = tool.links.emplace_back();
    link.parent = i - 1;
    link.joint = i == 0 ? root : JointType::kRevolute;
    link.axis = planar ? axes[0] : axes[i % 3];
    if (i > 0) link.X_PJ.p = {kLink, 0, 0};
    link.p_LCom = {kLink / 2, 0, 0};
    link.mass = kMass;
    link.I_LCom = Vector3(across, along, along).asDiagonal();
  }
  tool.hand_link = links - 1;
  tool.X_LH.p = {kLink, 0, 0};
  tool.length = kLink * links;
  return tool;
}

Velocity drawn(std::mt19937_64& engine, int dof) {
  Velocity v(dof);
  for (int i = 0; i < dof; ++i) v[i] = uniform(engine, -1, 1);
  return v;
}

double kinetic_energy(const ToolModel& tool, const Velocity& v) {
  return 0.5 * v.dot(tool.mass_matrix() * v);
}

/// A chain in a drawn posture that was kicked once, with `energy` (J).
LocalModel kicked(std::uint64_t seed, JointType root, int links, double energy) {
  std::mt19937_64 engine(seed);
  const ToolDescription tool = chain(links, root, root == JointType::kPlanar);
  ToolModel posture(tool);
  posture.set_configuration(posture.integrate(posture.neutral(), drawn(engine, posture.dof()), 1));
  Velocity v = drawn(engine, posture.dof());
  v *= std::sqrt(energy / kinetic_energy(posture, v));
  LocalModel model(tool, posture.configuration(), {}, kStep);
  model.follow(posture.configuration(), v);
  return model;
}

struct Chain {
  const char* name;
  JointType root;
  int links;
  double energy;  ///< J.
};

/// What a free chain's energy does in 60 s, and how far the motion of its first second is from that
/// with steps twenty times as short, rad and m.
struct Drift {
  double worst = 0;  ///< Of the energy's share.
  double astray = 0;
  std::vector<std::array<double, 2>> series;  ///< Time and the energy's share.
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Drift, worst, astray, series)

Drift drift(const Chain& chain, std::uint64_t seed) {
  Drift result;
  LocalModel model = kicked(seed, chain.root, chain.links, chain.energy);
  ToolModel exact = model.proxy();
  Velocity v = model.velocity();
  for (int i = 0; i < 20'000; ++i) server::move_freely(exact, v, kStep / 20);
  for (int i = 0; i < 60'000; ++i) {
    const double share = kinetic_energy(model.proxy(), model.velocity()) / chain.energy;
    result.worst = std::max(result.worst, std::abs(share - 1));
    if (i % 500 == 0) result.series.push_back({i * kStep, share});
    if (i == 1000) {
      const Configuration difference = model.proxy().configuration() - exact.configuration();
      result.astray = difference.cwiseAbs().maxCoeff();
    }
    model.step({});
  }
  return result;
}

void free_chains(Bench& bench) {
  std::vector<Chain> chains;
  for (const auto& [name, root] :
       {std::pair("free", JointType::kFree), std::pair("in the plane", JointType::kPlanar),
        std::pair("hinged", JointType::kRevolute)}) {
    for (const auto& [links, energy] : {std::pair(2, 0.5), std::pair(7, 5.0)}) {
      chains.push_back({name, root, links, energy});
    }
  }
  const auto inputs = [](const Chain& chain) {
    return Inputs{{"chain", chain.name}, {"links", chain.links}};
  };
  const std::vector<Drift> drifts =
      bench.map(chains, inputs, [&](const Chain& chain) { return drift(chain, bench.seed()); });
  Table& table = bench.table("linkages_energy", "chain,time_s,energy_share");
  double worst = 0;
  double astray = 0;
  for (std::size_t i = 0; i < chains.size(); ++i) {
    worst = std::max(worst, drifts[i].worst);
    astray = std::max(astray, drifts[i].astray);
    const std::string name = fmt::format("{} links, {}", chains[i].links, chains[i].name);
    for (const auto& [time, share] : drifts[i].series) table.row(name, time, share);
  }
  bench.claim({.what = "Linkages, free chains",
               .criterion = "chains of 2 and 7 links, free, in the plane and hinged: energy within "
                            "1 % of the kick's over 60 s; after 1 s where steps twenty times as "
                            "short lead, to 1e-3 rad and 1 mm (as in MuJoCo: free_motion_test.cc)",
               .measured = fmt::format("{:.2g} %; {:.2g}", 100 * worst, astray),
               .holds = worst <= 0.01 && astray <= 1e-3});
}

/// |force|² + |torque/length|², square root, that the wrenches of 1 N at a point make at most.
double felt_of_1_N(const ToolModel& tool, const server::HandMap& H, int link, const Vector3& p_W) {
  Vector6 scale = Vector6::Ones();
  scale.tail<3>() /= tool.description().length;
  const Eigen::Matrix<double, 6, 3> felt =
      scale.asDiagonal() * (H * tool.point_jacobian(link, p_W).transpose());
  const Matrix3 squares = felt.transpose() * felt;
  const Eigen::SelfAdjointEigenSolver<Matrix3> solver(squares, Eigen::EigenvaluesOnly);
  return std::sqrt(solver.eigenvalues().maxCoeff());
}

/// What the hand feels, N.
struct Postures {
  double largest = 0;
  double largest_exact = 0;                   ///< By Eq. 8 alone.
  double drawn = 0;                           ///< Most of 1 N on drawn chains.
  std::vector<std::array<double, 3>> series;  ///< Bend, rad; exact, N; felt, N.
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Postures, largest, largest_exact, drawn, series)

/// A post pushes the middle of three links sideways with 3.2 N, while the arm goes through its
/// stretched posture; and drawn postures of drawn chains.
Postures go_through(int trials, std::uint64_t seed) {
  Postures result;
  const ToolDescription arm = chain(3, JointType::kRevolute, true);
  for (double bend = -1.0025; bend <= 1; bend += 0.005) {
    ToolModel tool(arm);
    tool.set_configuration(Configuration(Eigen::Vector3d(0, bend, -2 * bend)));
    const GeneralisedForce tau =
        tool.point_jacobian(1, tool.X_WL(1) * Vector3(kLink / 2, 0, 0)).transpose() *
        (tool.X_WL(1).R * Vector3(0, 3.2, 0));
    Eigen::Matrix<double, 6, 3> J = tool.hand_jacobian();
    J.bottomRows<3>() *= arm.length;
    const Matrix3 squares = J.transpose() * J;
    const Vector6 plain = J * squares.ldlt().solve(Vector3(tau));
    const double exact = plain.head<3>().norm();
    const Wrench felt =
        server::hand_map(tool, tool.mass_matrix().llt(), tool.hand_jacobian()) * tau;
    result.series.push_back({bend, exact, felt.head<3>().norm()});
    result.largest = std::max(result.largest, felt.head<3>().norm());
    result.largest_exact = std::max(result.largest_exact, exact);
  }
  std::mt19937_64 engine(seed);
  for (int trial = 0; trial < trials; ++trial) {
    const int links = 2 + static_cast<int>(uniform(engine, 0, 8));
    ToolModel tool(
        chain(links, trial % 2 == 0 ? JointType::kRevolute : JointType::kPlanar, trial % 3 == 0));
    tool.set_configuration(tool.integrate(tool.neutral(), 3 * drawn(engine, tool.dof()), 1));
    const server::HandMap H =
        server::hand_map(tool, tool.mass_matrix().llt(), tool.hand_jacobian());
    for (int link = 0; link < links; ++link) {
      const Vector3 p_W = tool.X_WL(link) * Vector3(uniform(engine, 0, kLink), 0, 0);
      result.drawn = std::max(result.drawn, felt_of_1_N(tool, H, link, p_W));
    }
  }
  return result;
}

void postures(Bench& bench) {
  const int trials = bench.quick() ? 1000 : 20'000;
  const Postures o = bench.run({{"of", "postures"}, {"trials", trials}},
                               [&] { return go_through(trials, bench.seed()); });
  Table& table = bench.table("linkages_map", "bend_rad,exact_N,felt_N");
  for (const auto& [bend, exact, felt] : o.series) table.row(bend, exact, felt);
  bench.claim({.what = "Linkages, in every posture",
               .criterion = "in no posture does the hand feel more than three times the contact "
                            "force: 3.2 N on an arm that is all but stretched, and 1 N anywhere on "
                            "drawn chains of 2 to 9 links",
               .measured = fmt::format("{:.3g} N (by Eq. 8 alone {:.3g} N); {:.3g} N", o.largest,
                                       o.largest_exact, o.drawn),
               .holds = o.largest <= 3 * 3.2 && o.drawn <= 3});
}

struct Folded {
  double deepest = 0;                         ///< m; below 0 within each other.
  double kick = 0;                            ///< Of the first bar, rad/s.
  double lost = 0;                            ///< Share of the momentum.
  std::vector<std::array<double, 4>> series;  ///< Time, rates of first and last bar, gap.
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(Folded, deepest, kick, lost, series)

/// Three bars bent to a U: the last one swings back onto the first (the paper's Fig. 11).
Folded fold_up() {
  Folded result;
  server::LocalModelParameters frictionless;
  frictionless.static_friction = frictionless.kinetic_friction = 0;
  const ToolDescription tool = chain(3, JointType::kPlanar, true);
  Configuration q = Configuration::Zero(5);
  q.tail<2>() << 1.6, 1.6;
  LocalModel model(tool, q, frictionless, kStep);
  model.follow(q, Velocity::Unit(5, 4) * 2);  // rad/s in the last joint
  const ToolModel& proxy = model.proxy();
  ReportedContact contact;
  contact.a = {SideKind::kToolLink, 2};
  contact.b = {SideKind::kToolLink, 0};
  contact.n_W = proxy.X_WL(0).R * Vector3::UnitY();
  contact.separation = 0.02;
  contact.p_WC = proxy.X_WL(2) * Vector3(kLink, 0, 0) - contact.separation * contact.n_W;
  model.adopt({.contacts = {contact}, .q_VE = q});
  const auto momentum = [&] { return Vector3((proxy.mass_matrix() * model.velocity()).head<3>()); };
  const Vector3 before = momentum();
  const double first_bar = model.velocity()[2];
  for (int i = 0; i < 200; ++i) {
    const Velocity& v = model.velocity();
    result.series.push_back({i * kStep, v[2], v[2] + v[3] + v[4], model.contacts()[0].now.s});
    result.deepest = std::min(result.deepest, model.contacts()[0].now.s);
    model.step({});
  }
  result.kick = std::abs(model.velocity()[2] - first_bar);
  result.lost = (momentum() - before).head<2>().norm() / before.head<2>().norm();
  return result;
}

void fold(Bench& bench) {
  const Folded o = bench.run({{"of", "fold"}}, fold_up);
  Table& table = bench.table("linkages_fold", "time_s,first_rad_s,last_rad_s,gap_m");
  for (const auto& [time, first, last, gap] : o.series) table.row(time, first, last, gap);
  bench.claim({.what = "Linkages, folded onto themselves",
               .paper = "Fig. 11: both links feel the contact",
               .criterion = "the first of three bars is hit by the last: it turns otherwise, by "
                            "0.1 rad/s at least, the momentum of all stays within 0.1 %, and they "
                            "do not pass through each other (0.5 mm)",
               .measured = fmt::format("{:.2g} rad/s, {:.1g} %, {:.2g} mm", o.kick, 100 * o.lost,
                                       -1e3 * o.deepest),
               .holds = o.kick >= 0.1 && o.lost <= 1e-3 && o.deepest > -5e-4});
}

struct LedArm {
  double error = 0;                           ///< Of the limits, rad.
  std::vector<std::array<double, 3>> series;  ///< Time, shoulder, elbow.
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(LedArm, error, series)

/// The shipped arm with limits, led by its hand.
LedArm lead_to_limits(std::uint64_t seed) {
  LedArm result;
  test::VirtualSessionOptions options;
  options.world = test::repository_world("corner.sdf");
  options.tool = "arm";
  options.hand = server::read_hand_script((test::worlds_folder() / "hands/corner.toml").string());
  options.seed = seed;
  Configuration lowest = Configuration::Zero(2);
  Configuration highest = Configuration::Zero(2);
  test::VirtualSession* running = nullptr;
  test::VirtualSession session(options, [&](const server::TickRecord& tick) {
    const auto& model = running->servo().local_model();
    if (tick.step == 0 || !model) return;
    const Configuration& q = model->proxy().configuration();
    lowest = lowest.cwiseMin(q);
    highest = highest.cwiseMax(q);
    if (tick.step % 50 == 0) {
      result.series.push_back({static_cast<double>(tick.step) * kStep, q[0], q[1]});
    }
  });
  running = &session;
  session.run(24);
  result.error =
      std::max({std::abs(lowest[0] + 0.8), std::abs(lowest[1] + 1.1), std::abs(highest[1] - 1.3)});
  return result;
}

void joint_limits(Bench& bench) {
  const LedArm o =
      bench.run({{"of", "joint limits"}}, [&] { return lead_to_limits(bench.seed()); });
  Table& table = bench.table("linkages_limits", "time_s,shoulder_rad,elbow_rad");
  for (const auto& [time, shoulder, elbow] : o.series) table.row(time, shoulder, elbow);
  bench.claim({.what = "Linkages, joint limits",
               .criterion = "the arm of worlds/corner.sdf is led to three of its limits, and stops "
                            "there: within 0.01 rad at each tick",
               .measured = fmt::format("{:.2g} rad", o.error),
               .holds = o.error <= 0.01});
}

/// A tool of 0.5 kg that is held still, under each controller that the paper has: how far its
/// weight is off at most, as a share.
double weigh() {
  double worst = 0;
  for (const ControllerKind kind : {ControllerKind::kFourChannel, ControllerKind::kThreeChannel,
                                    ControllerKind::kVirtualCoupler, ControllerKind::kDirect}) {
    test::VirtualSessionOptions options;
    std::string tool = test::model("tool", "0 0 0 0 0 0", test::box("0.04 0.04 0.04"),
                                   "<haptic:tool_joint>planar</haptic:tool_joint>");
    tool.replace(tool.find("<mass>1<"), 8, "<mass>0.5<");
    options.world = test::world_of(tool, "0 -9.81 0");
    options.tool = "tool";
    options.servo.controller = kind;
    options.device.dry_friction = 0;
    server::Reach reach;
    reach.position = Vector3::Zero();
    reach.relative = true;
    options.hand = {{{1, reach}}, server::AfterLastSegment::kHold};
    test::VirtualSession session(options);
    session.run(4);
    worst = std::max(worst, std::abs(session.last().F_command[1] / (-0.5 * 9.81) - 1));
  }
  return worst;
}

void weight(Bench& bench) {
  const double worst = bench.run({{"of", "weight"}}, weigh);
  bench.claim({.what = "Linkages, the tool's own weight",
               .criterion = "a tool of 0.5 kg that is held weighs 4.905 N under each of the four "
                            "controllers, within 0.1 %",
               .measured = fmt::format("{:.2g} % off at most", 100 * worst),
               .holds = worst <= 1e-3});
}

}  // namespace

void linkages(Bench& bench) {
  free_chains(bench);
  postures(bench);
  fold(bench);
  joint_limits(bench);
  weight(bench);
}

}  // namespace hlm::experiments
