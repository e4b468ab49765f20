// The whole servo under values that the protocol takes and nobody means: the ends of each range,
// zeros with a sign, numbers so small that their squares are zero. In virtual time: the real tick,
// session and codec, and the simulated device with and without a hand.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <regex>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "hlm/haptic_server/device/simulated_device.h"
#include "hlm/haptic_server/loop/servo.h"
#include "hlm/haptic_server/report/run_summary.h"
#include "hlm/haptic_server/report/state_file.h"
#include "hlm/haptic_server/report/status_line.h"
#include "hlm/haptic_server/report/tick_columns.h"
#include "hlm/protocol/tool_fit.h"
#include "tests/fuzz/promises.h"
#include "tests/haptic_server/loop/servo_bench.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::server {
namespace {

constexpr double kDenormal = 5e-324;
constexpr double kSmall = 1e-310;
constexpr double kHuge = std::numeric_limits<double>::max();

/// What of a session varies. Of each the first choice is the usual one.
enum class Factor : std::size_t {
  kTool,
  kMass,
  kInertia,
  kCentre,
  kJointFrame,
  kLimits,
  kHandFrame,
  kGravity,
  kToolLength,
  kRate,
  kEpsilon,
  kStart,
  kRule,
  kController,
  kTuning,
  kContacts,
  kSides,
  kPoint,
  kNormal,
  kSeparation,
  kPointSpeed,
  kFriction,
  kLoad,
  kBodies,
  kMobility,
  kBodyMotion,
  kRound,
  kPlace,
  kSpeed,
  kTimes,
  kEcho,
  kSequence,
  kPace,
  kHand,
  kFreedom,
  kSensor,
};
/// How many choices there are, by Factor.
constexpr std::array<int, 36> kChoices{7, 6, 7, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 7, 5, 3, 6, 4,
                                       4, 7, 4, 5, 4, 3, 6, 5, 3, 3, 4, 4, 4, 3, 4, 3, 2, 2};
using Row = std::array<int, kChoices.size()>;

/// Makes the choices of a session: those of a row, or each time anew, with `wildness` the chance
/// that it is not the usual one.
class Chooser {
 public:
  Chooser(test::Random& random, double wildness) : random_(random), wildness_(wildness) {}
  Chooser(test::Random& random, const Row& row) : random_(random), row_(row) {}

  int operator()(Factor factor) {
    const auto index = static_cast<std::size_t>(factor);
    if (row_) return (*row_)[index];
    if (random_.uniform(0, 1) >= wildness_) return 0;
    return random_.integer(0, kChoices[index] - 1);
  }
  double of(Factor factor, std::initializer_list<double> values) {
    if (static_cast<int>(values.size()) != kChoices[static_cast<std::size_t>(factor)]) {
      throw std::logic_error("the choices of a factor are not as many as its values");
    }
    return *std::next(values.begin(), (*this)(factor));
  }
  test::Random& random() { return random_; }

 private:
  test::Random& random_;
  double wildness_ = 0;
  std::optional<Row> row_;
};

/// Rows in which any two choices of two factors meet at least once.
std::vector<Row> pairwise_rows(test::Random& random) {
  using Pair = std::array<int, 4>;  // Factor, choice, factor, choice.
  const int factors = static_cast<int>(kChoices.size());
  std::set<Pair> open;
  const auto count_of = [](int factor) { return kChoices[static_cast<std::size_t>(factor)]; };
  for (int a = 0; a < factors; ++a) {
    for (int b = a + 1; b < factors; ++b) {
      for (int i = 0; i < count_of(a); ++i) {
        for (int j = 0; j < count_of(b); ++j) open.insert({a, i, b, j});
      }
    }
  }
  const auto pairs_of = [&](const Row& row, auto visit) {
    for (int a = 0; a < factors; ++a) {
      for (int b = a + 1; b < factors; ++b) {
        visit(Pair{a, row[static_cast<std::size_t>(a)], b, row[static_cast<std::size_t>(b)]});
      }
    }
  };
  std::vector<Row> rows;
  while (!open.empty()) {
    constexpr int kTries = 20;
    Row best{};
    std::size_t most = 0;
    for (int i = 0; i < kTries; ++i) {
      Row row;
      for (int f = 0; f < factors; ++f) {
        row[static_cast<std::size_t>(f)] = random.integer(0, count_of(f) - 1);
      }
      const Pair& first = *std::next(
          open.begin(),
          random.integer(0, static_cast<int>(std::min<std::size_t>(open.size(), 50)) - 1));
      row[static_cast<std::size_t>(first[0])] = first[1];
      row[static_cast<std::size_t>(first[2])] = first[3];
      std::size_t met = 0;
      pairs_of(row, [&](const Pair& pair) { met += open.count(pair); });
      if (met > most) {
        most = met;
        best = row;
      }
    }
    pairs_of(best, [&](const Pair& pair) { open.erase(pair); });
    rows.push_back(best);
  }
  return rows;
}

/// A rotation whose quaternion is as far from unit as the protocol takes.
Quaternion loose(const Quaternion& R) { return Quaternion(R.coeffs() * 1.0009); }

Matrix3 extreme_inertia(Chooser& choose) {
  switch (choose(Factor::kInertia)) {
    case 1:
      return 1e-12 * Matrix3::Identity();  // The smallest that may turn.
    case 2:
      return Vector3(0, 0, 1e-12).asDiagonal();
    case 3:
      return 1e6 * Matrix3::Identity();  // The largest.
    case 4:
      return Vector3(1e-12, kDenormal, 1e6).asDiagonal();
    case 5: {  // On the edge of having a negative eigenvalue.
      Matrix3 I = Vector3(1, 1, 1e-6).asDiagonal();
      I(0, 1) = I(1, 0) = 1;
      return I;
    }
    case 6:
      return kSmall * Matrix3::Identity();  // Too small alone.
    default:
      return 2e-3 * Matrix3::Identity();
  }
}

Pose extreme_frame(Chooser& choose, Factor factor) {
  switch (choose(factor)) {
    case 1:
      return {{1e4, -1e4, 1e4}, Quaternion::Identity()};
    case 2:
      return {{-0.0, kDenormal, -kSmall}, loose(choose.random().rotation())};
    case 3:
      return choose.random().pose(0.1);
    default:
      return {};
  }
}

Link extreme_link(Chooser& choose, JointType joint, int parent) {
  Link link;
  link.parent = parent;
  link.joint = joint;
  link.mass = choose.of(Factor::kMass, {1, 1e-6, 1e3, kSmall, -0.0, 1e-3});
  link.I_LCom = extreme_inertia(choose);
  link.p_LCom = Vector3(1, -1, 0) * choose.of(Factor::kCentre, {0, kDenormal, 1e4, 0.01});
  link.X_PJ = extreme_frame(choose, Factor::kJointFrame);
  if (parent >= 0) link.X_PJ.p.x() = std::min(link.X_PJ.p.x() + 0.05, 1e4);
  link.axis = choose.random().integer(0, 1) == 0 ? Vector3::UnitZ() : Vector3::UnitX();
  const double limit = choose.of(Factor::kLimits, {kNoLimit, 0, kDenormal, 0.01});
  link.lower = -limit;
  link.upper = limit;
  return link;
}

ToolDescription extreme_tool(Chooser& choose) {
  using enum JointType;
  ToolDescription tool;
  const auto add = [&](JointType joint, int parent) {
    tool.links.push_back(extreme_link(choose, joint, parent));
  };
  const auto chain = [&](JointType joint, int count) {
    for (int i = 0; i < count; ++i) add(joint, static_cast<int>(tool.links.size()) - 1);
  };
  const int kind = choose(Factor::kTool);
  switch (kind) {
    case 1:
      add(kFree, -1);
      break;
    case 2:
      add(kRevolute, -1);
      break;
    case 3:
      add(kPrismatic, -1);
      break;
    case 4:
      add(kPlanar, -1);
      chain(kRevolute, 1);
      break;
    case 5:  // As many degrees of freedom as there may be, as many links.
      add(kFree, -1);
      chain(kRevolute, 10);
      chain(kFixed, 5);
      break;
    case 6:
      add(kFixed, -1);
      chain(kPrismatic, 2);
      chain(kPlanar, 1);
      break;
    default:
      add(kPlanar, -1);
  }
  tool.hand_link = choose.random().integer(0, static_cast<int>(tool.links.size()) - 1);
  tool.X_LH = extreme_frame(choose, Factor::kHandFrame);
  tool.gravity_W = Vector3(1, -1, 0) * choose.of(Factor::kGravity, {-0.0, 100, kDenormal, 9.81});
  tool.length = choose.of(Factor::kToolLength, {0.1, 1e-6, 1e4, kSmall});
  return tool;
}

/// The tool need not be one that is granted a session.
protocol::Hello extreme_hello(Chooser& choose) {
  protocol::Hello hello;
  hello.tool = extreme_tool(choose);
  hello.ve_rate = choose.of(Factor::kRate, {60, kDenormal, 1e5, 1e-3});
  hello.epsilon = choose.of(Factor::kEpsilon, {0.005, -0.0, kDenormal, 10});
  const double start = choose.of(Factor::kStart, {0, 1e4, -1e4, kDenormal});
  hello.q = Configuration::Constant(hello.tool.configuration_size(), start);
  if (hello.tool.links[0].joint == JointType::kFree) {
    hello.q.segment<4>(3) = Eigen::Vector4d(1.0009, -0.0, 0, kDenormal);
  }
  return hello;
}

double extreme_number(Chooser& choose, const Range& range, double usual) {
  switch (choose(Factor::kTuning)) {
    case 1:
      return range.least;
    case 2:
      return range.most;
    case 3:
      return std::max(range.least, kDenormal);
    case 4:
      return std::array{range.least, usual,
                        range.most}[static_cast<std::size_t>(choose.random().integer(0, 2))];
    default:
      return usual;
  }
}

protocol::Control extreme_control(Chooser& choose) {
  protocol::Control control;
  control.telemetry = true;
  control.tuned = true;
  control.tuning.update_rule = static_cast<UpdateRule>(choose(Factor::kRule));
  control.tuning.controller = static_cast<ControllerKind>(choose(Factor::kController));
  for (const TuningRange& range : kTuningRanges) {
    double& number = control.tuning.*range.number;
    number = extreme_number(choose, range, number);
  }
  return control;
}

Vector3 extreme_normal(Chooser& choose) {
  test::Random& random = choose.random();
  Vector3 axis = Vector3::Zero();
  axis[random.integer(0, 2)] = random.integer(0, 1) == 0 ? -1 : 1;
  switch (choose(Factor::kNormal)) {
    case 1:
      return random.direction();
    case 2:
      return 0.9991 * axis;
    case 3:
      return Vector3(axis + Vector3(kDenormal, -0.0, kSmall));
    default:
      return axis;
  }
}

std::pair<ContactSide, ContactSide> extreme_sides(Chooser& choose, int links) {
  test::Random& random = choose.random();
  const auto link = static_cast<std::uint32_t>(random.integer(0, links - 1));
  const ContactSide tool{SideKind::kToolLink, link};
  const ContactSide body{SideKind::kMovableBody, static_cast<std::uint32_t>(random.integer(0, 16))};
  switch (choose(Factor::kSides)) {
    case 1:
      return {tool, body};
    case 2:
      return {body, {SideKind::kWorld, 0}};
    case 3:
      return {body, {SideKind::kMovableBody, std::numeric_limits<std::uint32_t>::max()}};
    case 4:
      return {tool, {SideKind::kToolLink, static_cast<std::uint32_t>(links - 1)}};
    case 5:
      return {body, body};
    default:
      return {tool, {SideKind::kWorld, 0}};
  }
}

ReportedContact extreme_contact(Chooser& choose, const Pose& X_WH, int links) {
  test::Random& random = choose.random();
  ReportedContact contact;
  contact.pair = static_cast<std::uint32_t>(random.integer(0, 3));
  contact.axis = static_cast<std::uint16_t>(random.integer(0, 2));
  std::tie(contact.a, contact.b) = extreme_sides(choose, links);
  contact.n_W = extreme_normal(choose);
  const double away = choose.of(Factor::kPoint, {0.01, -0.0, 1e4, kDenormal});
  contact.p_WC = (X_WH.p + random.vector(away)).cwiseMax(-1e4).cwiseMin(1e4);
  contact.separation =
      choose.of(Factor::kSeparation, {-1e-3, -0.0, kDenormal, -kDenormal, 1e4, -1e4, 1e-3});
  contact.v_WC = choose.of(Factor::kPointSpeed, {0, 1e3, -1e-45, 0.1}) * contact.n_W;
  contact.v_WC = contact.v_WC.cwiseMax(-1e3).cwiseMin(1e3);
  contact.friction = choose.of(Factor::kFriction, {0.3, -10, -0.0, 1e-45, 10});
  contact.load = choose.of(Factor::kLoad, {0, 1e-45, 1e6, 1});
  contact.plane = random.integer(0, 1) == 0 ? PlaneOwner::kA : PlaneOwner::kB;
  return contact;
}

Matrix6 extreme_mobility(Chooser& choose) {
  switch (choose(Factor::kMobility)) {
    case 1:
      return Matrix6::Zero();
    case 2:
      return 1e12 * Matrix6::Identity();
    case 3:
      return Matrix6::Ones();  // Of rank 1.
    case 4:
      return kSmall * Matrix6::Identity();
    case 5: {  // On the edge of having a negative eigenvalue.
      Matrix6 W = Matrix6::Identity();
      W(2, 2) = W(5, 5) = -0.9e-5;
      return W;
    }
    default:
      return Matrix6::Identity();
  }
}

MovableBody extreme_body(Chooser& choose, const Pose& X_WH, std::uint32_t id) {
  MovableBody body;
  body.id = id;
  const double away = choose.of(Factor::kPoint, {0.01, -0.0, 1e4, kDenormal});
  body.p_WCom = (X_WH.p + choose.random().vector(away)).cwiseMax(-1e4).cwiseMin(1e4);
  body.W = extreme_mobility(choose);
  switch (choose(Factor::kBodyMotion)) {
    case 1:
      body.V_W.setConstant(1e3);
      break;
    case 2:
      body.A_W.setConstant(-1e6);
      break;
    case 3:
      body.P_W.setConstant(1e6);
      break;
    case 4:
      body.V_W.setConstant(-kDenormal);
      body.P_W.setConstant(kSmall);
      break;
    default:
      break;
  }
  body.roundness = static_cast<Roundness>(choose(Factor::kRound));
  if (body.roundness == Roundness::kAxis) {
    body.axis_W =
        Vector3::UnitX() *
        std::array{0.0, 1e-45, 2.0}[static_cast<std::size_t>(choose.random().integer(0, 2))];
  }
  return body;
}

/// How often this came to pass, over all sessions.
struct Survey {
  int sessions = 0;  ///< Granted.
  int refused = 0;   ///< Hellos turned away.
  long ticks = 0;
  long updates = 0;       ///< Adopted.
  double peak_force = 0;  ///< N.
  std::map<Fault, int> faults;
};

std::string text_of(const Survey& survey) {
  std::ostringstream text;
  text << survey.sessions << " sessions, " << survey.refused << " hellos refused, " << survey.ticks
       << " ticks, " << survey.updates << " updates, up to " << survey.peak_force << " N";
  for (const auto& [fault, count] : survey.faults) text << "; " << name_of(fault) << ' ' << count;
  return text.str();
}

HandScript extreme_hand(Chooser& choose) {
  const int kind = choose(Factor::kHand);
  if (kind == 0) return {};
  Push push;
  push.constant << 12, -5, 0, 0, 0, 0.1;
  if (kind == 2) {
    push.amplitude << 20, 20, 20, 0.3, 0.3, 0.3;
    push.frequency = 7;
  }
  return {{{1.0, push}}, AfterLastSegment::kHold};
}

SimulatedDeviceOptions extreme_device(Chooser& choose) {
  SimulatedDeviceOptions options;
  if (choose(Factor::kFreedom) == 1) options.freedom = DeviceFreedom::kSpatial;
  options.measures_hand_wrench = choose(Factor::kSensor) == 0;
  return options;
}

ServoOptions extreme_options(Chooser& choose) {
  ServoOptions options;
  options.local_model.update_rule = static_cast<UpdateRule>(choose(Factor::kRule));
  options.controller = static_cast<ControllerKind>(choose(Factor::kController));
  return options;
}

/// Throws unless the claim holds.
void claim(bool holds, const std::string& what) {
  if (!holds) throw std::runtime_error(what);
}

/// Whether a text for a person has a word that is no number.
bool names_no_number(const std::string& text) {
  static const std::regex kNoNumber("(^|[^a-z_])-?(nan|inf)($|[^a-z_])");
  return std::regex_search(text, kNoNumber);
}

/// Every number that a tick leaves behind, in its log, its state file or its messages, is one.
void claim_finite(const TickRecord& record) {
  visit_signals([&](std::string_view name, auto member, const auto& suffixes) {
    for (std::size_t i = 0; i < suffixes.size(); ++i) {
      const auto value = component(record.*member, i);
      if constexpr (std::is_floating_point_v<decltype(value)>) {
        claim(std::isfinite(value), std::string(name) + std::string(suffixes[i]) +
                                        " is not finite, fault " +
                                        std::string(name_of(record.fault)));
      }
    }
  });
  const std::initializer_list<double> unlogged{record.port_bound, record.port_power,
                                               record.gripper,    record.scale,
                                               record.stiffness,  record.lowered};
  for (const double value : unlogged) claim(std::isfinite(value), "what is not logged is finite");
}

/// A client that says such things to a server, and what it must not see.
class ExtremeSession {
 public:
  ExtremeSession(Chooser& choose, Survey& survey, StateFile& state, Timing& timing)
      : choose_(choose),
        survey_(survey),
        state_(state),
        timing_(timing),
        options_(extreme_options(choose)),
        device_(extreme_device(choose), extreme_hand(choose), 1 / options_.rate),
        servo_(std::make_unique<Servo>(options_, 0, session_, device_)),
        budget_(ForceBudget::of(options_.limits, device_.ratings(), 1 / options_.rate)) {}

  void run(int ticks) {
    if (!begin()) return;
    send(extreme_control(choose_));
    for (int i = 0; i < ticks && fault_ == Fault::kNone; ++i) {
      say();
      tick(i == ticks / 2 ? choose_.random().integer(0, 200) : 0);
    }
    if (fault_ != Fault::kNone) {
      release();
    } else {
      send(protocol::Goodbye{});
      for (int i = 0; i < 30; ++i) tick();
    }
    claim(!names_no_number(summary_.text(0)), "the summary has numbers: " + summary_.text(0));
  }

 private:
  /// Asks for a session. Whether it was granted; a refusal is for the reason that there is.
  bool begin() {
    hello_ = extreme_hello(choose_);
    hello_.nonce = ++hellos_;
    const protocol::Envelope envelope{.sequence = choose_.random().integer(0, 1) == 0 ? 1 : ~0ULL};
    const std::optional<std::string> error = error_of(envelope);
    link_.deliver(kClient, envelope, hello_);
    tick();
    if (!error) {
      claim(session_.active(), "a hello without an error is granted a session");
      ++survey_.sessions;
      return true;
    }
    ++survey_.refused;
    claim(!session_.active(), "a hello with an error is refused");
    expect_reject(protocol::RejectReason::kTool, *error);
    return false;
  }

  /// Why the hello is refused, as its receiver finds it.
  std::optional<std::string> error_of(const protocol::Envelope& envelope) const {
    protocol::Hello received;
    const auto parts = fuzz::all_parts(envelope, hello_);
    claim(!protocol::decode(parts, received), "a hello is well formed");
    protocol::normalize(received.tool, received.q);
    if (const auto error = protocol::find_error(received)) return std::string(*error);
    if (traits(options_.controller).replaces_proxy && hello_.tool.links.size() != 1) {
      return "this controller needs a tool of one link, without a curve; use another one";
    }
    return std::nullopt;
  }

  void expect_reject(protocol::RejectReason reason, std::string text) {
    claim(reject_.has_value(), "a refused hello is answered");
    text.resize(std::min(text.size(), protocol::kMaxText));
    claim(reject_->reason == reason, "a reject has its reason");
    const std::string said(reject_->text.begin(), reject_->text.end());
    claim(said.find(text) != std::string::npos, "a reject says '" + text + "', not '" + said + "'");
    claim(!names_no_number(said), "a reject names numbers: " + said);
    reject_.reset();
  }

  void say() {
    if (wait_ > 0) {
      --wait_;
      return;
    }
    wait_ = static_cast<int>(choose_.of(Factor::kPace, {16, 0, 3, 40}));
    send(update());
  }

  template <class Message>
  void send(const Message& message) {
    sequence_ += static_cast<std::uint64_t>(choose_.of(Factor::kSequence, {1, 1000, 17}));
    const auto time = static_cast<std::int64_t>(
        std::array{0LL, std::numeric_limits<long long>::min(),
                   std::numeric_limits<long long>::max()}[static_cast<std::size_t>(
            choose_.random().integer(0, 2))]);
    link_.deliver(kClient, {.session = session_.id(), .sequence = sequence_, .send_time = time},
                  message);
  }

  protocol::ContactUpdate update() {
    protocol::ContactUpdate update;
    time_in(update);
    place_in(update);
    const auto bodies = static_cast<std::uint32_t>(choose_.of(Factor::kBodies, {0, 1, 16}));
    for (std::uint32_t i = 0; i < bodies; ++i) {
      const std::uint32_t id = i == 15 ? std::numeric_limits<std::uint32_t>::max() : i;
      update.bodies.push_back(extreme_body(choose_, X_WH_, id));
    }
    const int contacts = static_cast<int>(choose_.of(Factor::kContacts, {1, 0, 192}));
    for (int i = 0; i < contacts; ++i) {
      ReportedContact& contact = update.contacts.emplace_back(
          extreme_contact(choose_, X_WH_, static_cast<int>(hello_.tool.links.size())));
      contact.identity = i == 0 ? ~0ULL : static_cast<std::uint64_t>(i);
    }
    return update;
  }

  void time_in(protocol::ContactUpdate& update) {
    const int times = choose_(Factor::kTimes);
    update.ve_time = std::array{1.5, kHuge, -kDenormal, -kHuge}[static_cast<std::size_t>(times)];
    update.ve_period = std::array{1.0 / 60, 1e6, kDenormal, 0.0}[static_cast<std::size_t>(times)];
    update.compute_time = std::array{0.003, -0.0, kSmall, 1e6}[static_cast<std::size_t>(times)];
    const int echo = choose_(Factor::kEcho);
    update.echo_step = std::array{step_, std::uint64_t{0}, ~std::uint64_t{0},
                                  std::uint64_t{1}}[static_cast<std::size_t>(echo)];
    update.echo_hold = std::array{0.001, kDenormal, -0.0, 1e6}[static_cast<std::size_t>(echo)];
    update.impulse_step = std::array{static_cast<double>(step_), kDenormal, kHuge,
                                     0.5}[static_cast<std::size_t>(echo)];
  }

  void place_in(protocol::ContactUpdate& update) {
    update.q_VE = hello_.q;
    if (choose_(Factor::kPlace) == 0 && servo_->local_model()) {
      update.q_VE = servo_->local_model()->proxy().configuration();
    } else if (choose_(Factor::kPlace) == 2) {
      update.q_VE.head(std::min<Eigen::Index>(3, update.q_VE.size())).setConstant(1e4);
    }
    update.q_VE = update.q_VE.cwiseMax(-1e4).cwiseMin(1e4);
    update.v_VE = Velocity::Constant(hello_.tool.dof(),
                                     choose_.of(Factor::kSpeed, {0, 1e3, -1e3, -kDenormal}));
  }

  void tick(int missed = 0) {
    timing_.missed = static_cast<std::uint64_t>(missed);
    timing_.tick += 1 + timing_.missed;
    timing_.overruns += timing_.missed;
    timing_.scheduled = timing_.begin = static_cast<double>(timing_.tick) / options_.rate;
    const TickRecord& record = servo_->tick(timing_);
    ++survey_.ticks;
    survey_.updates += record.adopted > 0;
    survey_.peak_force = std::max(survey_.peak_force, record.F_command.head<3>().norm());
    check(record);
    fuzz::demand_sent_well(link_.sent());
    read_rejects();
    link_.forget_sent();
    summary_.observe(record);
    state_.observe(record);
  }

  void check(const TickRecord& record) {
    claim_finite(record);
    claim(record.refusal.empty(), "an update is taken: " + std::string(record.refusal));
    if (record.step == 1) p_WStart_ = record.X_WD.p;
    if (record.fault != Fault::kNone && fault_ == Fault::kNone) {
      ++survey_.faults[record.fault];
      check_reason(record);
    }
    fault_ = record.fault;
    check_limits(record);
    if (const auto& model = servo_->local_model()) X_WH_ = model->proxy().X_WH();
    step_ = record.step;
    const std::string status = format_status(record, options_.rate);
    if (record.adopted > 0) claim(!names_no_number(status), "the status has numbers: " + status);
  }

  void check_limits(const TickRecord& record) {
    const Wrench& F = record.F_command;
    constexpr double kRounding = 1e-9;
    claim(F.head<3>().norm() <= budget_.max_force + kRounding, "a force is within its limit");
    claim(F.tail<3>().norm() <= budget_.max_torque + kRounding, "a torque is within its limit");
    if (record.step == 0) claim(F.isZero(0), "no session, no force");
    if (record.step > 1) {
      const Wrench change = F - F_before_;
      claim(change.head<3>().norm() <= budget_.max_force_step + kRounding,
            "a force changes slowly");
      claim(change.tail<3>().norm() <= budget_.max_torque_step + kRounding,
            "a torque changes slowly");
    }
    F_before_ = F;
    const PortLedger& port = record.port;
    claim(port.given >= 0 && port.taken >= 0, "what was given and taken is not negative");
    claim(port.tank <= budget_.energy.capacity, "the tank holds no more than it may");
  }

  /// A fault is what it is called.
  void check_reason(const TickRecord& record) {
    const HandleLimits& handle = options_.handle;
    const auto speed = [](const Twist& V) { return V.head<3>().norm(); };
    const auto rate = [](const Twist& V) { return V.tail<3>().norm(); };
    switch (record.fault) {
      case Fault::kHandleSpeed:
        return claim(speed(record.V_WD) > handle.max_speed || rate(record.V_WD) > handle.max_rate,
                     "a fault of the handle's speed is one");
      case Fault::kWorkspace:
        return claim((record.X_WD.p - p_WStart_).norm() > handle.workspace,
                     "a fault of the workspace is one");
      case Fault::kImplausible:
        return claim(servo_->local_model()->velocity().cwiseAbs().maxCoeff() > 1e3 ||
                         speed(record.V_WP) > 20 || rate(record.V_WP) > 500 ||
                         (record.X_WP.p - record.X_WD.p).norm() > 5,
                     "an implausible proxy is one");
      case Fault::kEnergy:
        return claim(record.port.tank < -budget_.energy.capacity, "a fault of energy is one");
      default:
        claim(false, "there is no reason for the fault " + std::string(name_of(record.fault)));
    }
  }

  /// The fault stays until a person asks, and where that is due, one at the device.
  void release() {
    const bool at_device = ends_at_device(fault_);
    const auto ask = [&](bool person) {
      if (session_.active()) send(protocol::Goodbye{});
      hello_.clears_fault = person;
      hello_.nonce = ++hellos_;
      link_.deliver(kClient, {.sequence = 1}, hello_);
      tick();
    };
    send(update());
    tick();
    ask(false);
    expect_reject(protocol::RejectReason::kFault, "fault: ");
    if (at_device) {
      ask(true);
      expect_reject(protocol::RejectReason::kFault, "fault: ");
      servo_->obey(Intervention::kClear);
    }
    ask(true);
    claim(session_.active() && fault_ == Fault::kNone, "a person ends a fault");
  }

  void read_rejects() {
    for (const protocol::Datagram& datagram : link_.sent()) {
      protocol::Reject reject;
      protocol::Header header;
      if (protocol::decode_header(protocol::view(datagram.bytes), header)) continue;
      if (header.type != protocol::MessageType::kReject) continue;
      if (!protocol::decode(protocol::view(datagram.bytes), reject)) reject_ = reject;
    }
  }

  static constexpr auto kClient = test::ServoBench::kClient;

  Chooser& choose_;
  Survey& survey_;
  StateFile& state_;
  Timing& timing_;
  ServoOptions options_;
  test::QueueLink link_;
  protocol::ServerSession session_{link_, {}};
  SimulatedDevice device_;
  std::unique_ptr<Servo> servo_;
  ForceBudget budget_;
  RunSummary summary_;
  protocol::Hello hello_;
  std::optional<protocol::Reject> reject_;  ///< The latest.
  std::uint64_t hellos_ = 0;
  std::uint64_t sequence_ = 0;
  int wait_ = 0;  ///< Ticks until the next update.
  std::uint64_t step_ = 0;
  Pose X_WH_;
  Vector3 p_WStart_ = Vector3::Zero();
  Wrench F_before_ = Wrench::Zero();
  Fault fault_ = Fault::kNone;
};

/// Plays sessions, one after the other as the state file sees them.
class Extremes {
 public:
  Extremes() {
    fuzz::on_broken_promise = [](const char* what) { throw std::runtime_error(what); };
  }
  ~Extremes() { fuzz::on_broken_promise = fuzz::end_at; }
  Extremes(const Extremes&) = delete;
  Extremes& operator=(const Extremes&) = delete;

  void play(Chooser choose, const std::string& which) {
    try {
      auto session = std::make_unique<ExtremeSession>(choose, survey, state_, timing_);
      session->run(choose.random().integer(200, 600));
    } catch (const std::exception& broken) {
      ++broken_[broken.what()];
      if (broken_[broken.what()] == 1) first_ += which + ": " + broken.what() + '\n';
    }
    read_state();
  }
  void finish() {
    std::string text = text_of(survey) + '\n' + first_;
    for (const auto& [what, count] : broken_) text += std::to_string(count) + " x " + what + '\n';
    INFO(text);
    CHECK(broken_.empty());
    CHECK(survey.sessions > 0);
  }

  Survey survey;

 private:
  void read_state() {
    std::ifstream file(folder_ / "extremes.json");
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    const auto lacks = [&](const char* name) {
      return text.find(std::string("\"") + name + "\": null") != std::string::npos;
    };
    if (lacks("silence") || lacks("age") || lacks("force") || names_no_number(text)) {
      ++broken_["state file: " + text];
    }
  }

  static ServerFacts facts() {
    ServerFacts facts;
    facts.listen = "extremes";
    return facts;
  }

  std::filesystem::path folder_ = std::filesystem::temp_directory_path() / "hlm_extremes";
  StateFile state_{folder_, facts()};
  Timing timing_;
  std::map<std::string, int> broken_;
  std::string first_;  ///< Session in which each thing was broken first.
};

void play_pairwise() {
  test::Random random;
  Extremes extremes;
  std::size_t row_number = 0;
  for (const Row& row : pairwise_rows(random)) {
    const std::uint64_t seed = random.engine()();
    test::Random own(seed);
    extremes.play(Chooser(own, row), "row " + std::to_string(row_number++));
  }
  extremes.finish();
}

void play_random(int sessions) {
  test::Random random;
  Extremes extremes;
  for (int i = 0; i < sessions; ++i) {
    const std::uint64_t seed = random.engine()();
    test::Random own(seed);
    const double wildness = std::array{0.02, 0.1, 0.5, 1.0}[static_cast<std::size_t>(i % 4)];
    extremes.play(Chooser(own, wildness), "session " + std::to_string(i));
  }
  extremes.finish();
}

TEST_CASE("Any two extremes of an accepted session leave nothing that is no number") {
  play_pairwise();
}

TEST_CASE("Extremes drawn at random leave nothing that is no number") { play_random(100); }

TEST_CASE("Some thousand sessions of extremes leave nothing that is no number", "[optimised]") {
  play_random(3000);
}

// test_extremes "[survey]"
TEST_CASE("The same over many more sessions", "[.][survey]") { play_random(100'000); }

}  // namespace
}  // namespace hlm::server
