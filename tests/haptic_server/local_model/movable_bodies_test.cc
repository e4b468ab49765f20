// A body that the tool pushes, as the environment that owns it would have it (docs/method.md 11).
#include <cmath>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "hlm/haptic_server/local_model/local_model.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"
#include "tests/support/random_tool.h"

namespace hlm::server {
namespace {

constexpr double kStep = 1e-3;  // s
constexpr double kGravity = 9.81;

struct Loop {
  double mass = 0.3;          ///< Of the body, kg.
  double frame = 1.0 / 60;    ///< s.
  int delay = 0;              ///< Each way, steps.
  double stiffness = 4000;    ///< N/m.
  double gravity = kGravity;  ///< m/s².
};

/// An environment with one body, a cube of 50 mm on a table, that moves by its weight and by the
/// impulses that it is told of alone. Its step is 1 ms.
class LateWorld {
 public:
  explicit LateWorld(const Loop& loop) : loop_(loop), moment_(loop.mass * kSize * kSize / 6) {
    body_.p.z() = kSize / 2;
  }

  /// The state of the proxy and the impulses, as they arrive.
  struct Message {
    std::uint64_t step;
    Configuration q;
    Vector6 P;
  };
  struct Update {
    ReportedContacts contacts;
    MovableBodies bodies;
    Configuration q;
    double impulse_step;
  };

  void receive(const Message& message) {
    newest_ = message;
    received_.push_back(message);
    if (received_.size() > 10) received_.pop_front();
  }

  Update frame() {
    // Played out at an even rate, a frame behind the newest: with unequal portions the body would
    // hop on its table.
    const double steps_per_frame = loop_.frame / kStep;
    const double newest = static_cast<double>(newest_.step);
    const double lag = newest - played_ - 2 * steps_per_frame;
    played_ += steps_per_frame * (1 + std::clamp(0.1 * lag / steps_per_frame, -0.02, 0.02));
    if (lag > 4 * steps_per_frame) played_ = newest - steps_per_frame;
    played_ = std::clamp(played_, 0., newest);
    const Vector6 due = played();
    const Vector6 F = (due - applied_) / loop_.frame;
    applied_ = due;
    const int steps = static_cast<int>(std::round(loop_.frame / kStep));
    for (int i = 0; i < steps; ++i) step(F, loop_.frame / steps);
    return report();
  }

  const Twist& V() const { return V_; }
  const Pose& X() const { return body_; }

 private:
  static constexpr double kSize = 0.05;  // m

  Vector6 played() const {
    for (std::size_t i = received_.size(); i-- > 1;) {
      const double before = static_cast<double>(received_[i - 1].step);
      const double after = static_cast<double>(received_[i].step);
      if (played_ < before || after == before) continue;
      return received_[i - 1].P +
             (played_ - before) / (after - before) * (received_[i].P - received_[i - 1].P);
    }
    return applied_;
  }

  void step(const Wrench& F, double dt) {
    V_.head<3>() += dt * (F.head<3>() / loop_.mass - Vector3(0, 0, loop_.gravity));
    V_.tail<3>() += dt * F.tail<3>() / moment_;
    load_ = 0;
    if (loop_.gravity > 0 && body_.p.z() + dt * V_[2] <= kSize / 2) {
      const double stopped = (kSize / 2 - body_.p.z()) / dt;
      load_ = loop_.mass * (stopped - V_[2]) / dt;
      V_[2] = stopped;
    }
    body_.p += dt * V_.head<3>();
    body_.R = rotation_from_vector(dt * V_.tail<3>()) * body_.R;
  }

  Update report() const {
    Update update;
    update.q = newest_.q;
    update.impulse_step = played_;
    MovableBody& body = update.bodies.emplace_back();
    body.id = 7;
    body.p_WCom = body_.p;
    body.V_W = V_;
    body.W.diagonal() << Vector3::Constant(1 / loop_.mass), Vector3::Constant(1 / moment_);
    body.A_W[2] = -loop_.gravity;
    body.P_W = applied_;
    for (std::uint64_t i = 0; i < 4; ++i) {
      const Vector3 corner(i & 1 ? .02 : -.02, i & 2 ? .02 : -.02, 0);
      // The tool's top under the cube's lower face.
      const Vector3 x = newest_.q.head<3>() + corner;
      ReportedContact& contact = update.contacts.emplace_back();
      contact.identity = i;
      contact.b = {SideKind::kMovableBody, 7};
      contact.n_W = body_.R * -Vector3::UnitZ();
      const Vector3 face = body_ * Vector3(0, 0, -kSize / 2);
      contact.separation = contact.n_W.dot(x - face);
      contact.p_WC = x - contact.separation * contact.n_W;
      contact.friction = 0.5;
      if (loop_.gravity == 0) continue;
      ReportedContact& support = update.contacts.emplace_back();
      support.identity = 10 + i;
      support.a = {SideKind::kMovableBody, 7};
      support.b = {SideKind::kWorld, 1};
      support.p_WC = body_ * Vector3(corner.x(), corner.y(), -kSize / 2);
      support.separation = support.p_WC.z();
      support.p_WC.z() = 0;
      support.friction = 0.5;
      support.load = load_ / 4;
    }
    return update;
  }

  Loop loop_;
  double moment_;    // kg·m²
  double load_ = 0;  // N, on the table
  Pose body_;
  Twist V_ = Twist::Zero();
  Vector6 applied_ = Vector6::Zero();
  Message newest_{0, Configuration(), Vector6::Zero()};
  std::deque<Message> received_{newest_};
  double played_ = 0;  // step
};

/// Local model and environment, late for each other. The hand holds the tool with a spring.
class Held {
 public:
  explicit Held(const Loop& loop)
      : loop_(loop), world_(loop), tool_(test::rigid_tool(0.5, Matrix3::Identity() * 1e-3)) {
    LocalModelParameters parameters;
    parameters.stiffness = loop.stiffness;
    model_.emplace(tool_, ToolModel(tool_).neutral(), parameters, kStep);
    world_.receive(message());
    model_->adopt(update(world_.frame()));
  }

  /// Force on the hand by the contacts in one step, N; the hand's target moves to z.
  ContactWrench step(const Vector3& target) {
    const double now = static_cast<double>(ticks_++) * kStep;
    while (!to_server_.empty() && to_server_.front().second <= ticks_) {
      model_->adopt(update(to_server_.front().first));
      to_world_.push_back({message(), ticks_ + loop_.delay});
      to_server_.pop_front();
    }
    HandInput hand;
    const double K = 1500;
    const double B = 30;
    hand.stiffness.head<3>().setConstant(K);
    hand.damping.head<3>().setConstant(B);
    hand.stiffness.tail<3>().setConstant(5);
    hand.damping.tail<3>().setConstant(0.05);
    const Twist V = model_->hand_twist();
    Pose X_target;
    X_target.p = target;
    hand.F = hand.stiffness.cwiseProduct(displacement(model_->proxy().X_WH(), X_target)) -
             hand.damping.cwiseProduct(V);
    const ContactWrench felt = model_->step(hand);
    if (now >= next_frame_) {
      next_frame_ += loop_.frame;
      while (!to_world_.empty() && to_world_.front().second <= ticks_) {
        world_.receive(to_world_.front().first);
        to_world_.pop_front();
      }
      if (loop_.delay == 0) world_.receive(message());
      to_server_.push_back({world_.frame(), ticks_ + 1 + loop_.delay});
    }
    felt_ += kStep * felt.F + felt.impulse;
    return felt;
  }

  const Wrench& felt() const { return felt_; }
  const LateWorld& world() const { return world_; }
  const LocalModel& model() const { return *model_; }

 private:
  LateWorld::Message message() const {
    Vector6 P = Vector6::Zero();
    for (const auto& total : model_->impulses().totals()) P = total.P_W;
    return {model_->impulses().step(), model_->proxy().configuration(), P};
  }
  ModelUpdate update(const LateWorld::Update& u) {
    newest_ = u;
    return {.contacts = newest_.contacts,
            .q_VE = newest_.q,
            .age = 0,
            .bodies = newest_.bodies,
            .impulse_step = newest_.impulse_step,
            .period = loop_.frame};
  }

  Loop loop_;
  LateWorld world_;
  ToolDescription tool_;
  std::optional<LocalModel> model_;
  LateWorld::Update newest_;
  std::deque<std::pair<LateWorld::Message, int>> to_world_;
  std::deque<std::pair<LateWorld::Update, int>> to_server_;
  int ticks_ = 0;
  double next_frame_ = 0;
  Wrench felt_ = Wrench::Zero();
};

struct Weight {
  double mean = 0;       // N
  double deviation = 0;  // N
  double step = 0;       // N: largest change from one tick to the next
};

/// The cube is lifted off its table by 50 mm in a second; what it weighs after three.
Weight weigh(const Loop& loop) {
  Held held(loop);
  Weight weight;
  double last = 0;
  double squares = 0;
  constexpr int kTicks = 3000;
  for (int i = 0; i < 2 * kTicks; ++i) {
    const double f = -held.step({0, 0, 0.05 * std::min(1.0, i / 1000.0)}).F[2];
    if (i > kTicks) {
      weight.mean += f / (kTicks - 1);
      squares += f * f / (kTicks - 1);
      weight.step = std::max(weight.step, std::abs(f - last));
    }
    last = f;
  }
  weight.deviation = std::sqrt(std::max(0.0, squares - weight.mean * weight.mean));
  return weight;
}

TEST_CASE("A cube that is held weighs what it weighs, however late and slow its environment",
          "[optimised]") {
  const double mass = GENERATE(0.3, 3.0);               // kg
  const double rate = GENERATE(30.0, 60.0);             // Hz
  const int delay = GENERATE(0, 20);                    // ms each way
  const double stiffness = GENERATE(4000.0, 50'000.0);  // N/m
  CAPTURE(mass, rate, delay, stiffness);
  const Weight weight =
      weigh({.mass = mass, .frame = 1 / rate, .delay = delay, .stiffness = stiffness});
  CHECK(weight.mean == Approx(mass * kGravity).epsilon(0.01));
  CHECK(weight.deviation < 0.02 * mass * kGravity);
  CHECK(weight.step < 2);  // N
}

TEST_CASE("A cube that is hit gains the momentum that the hand felt") {
  const int delay = GENERATE(0, 20, 100);
  Held held({.delay = delay, .stiffness = 16'000, .gravity = 0});
  for (int i = 0; i < 2000; ++i) held.step({0, 0, i < 300 ? 0.3e-3 * i : -0.05});
  const double felt = -held.felt()[2];  // N·s
  REQUIRE(felt > 0.02);
  CHECK(0.3 * held.world().V()[2] == Approx(felt).epsilon(1e-6));
}

TEST_CASE("A body on a platform that rises goes with it between updates") {
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  LocalModel model(tool, ToolModel(tool).neutral(), {}, kStep);
  MovableBody body;
  body.W = Matrix6::Identity();
  body.V_W[2] = 0.1;
  body.A_W[2] = -kGravity;
  ReportedContact support;
  support.a = {SideKind::kMovableBody, 0};
  support.v_WC = {0, 0, 0.1};  // m/s
  support.load = kGravity;
  model.adopt({.contacts = {support}, .q_VE = model.proxy().configuration(), .bodies = {body}});
  for (int i = 0; i < 50; ++i) model.step({});
  CHECK(model.bodies()[0].X_WB.p.z() == Approx(0.005).margin(1e-4));  // m
}

TEST_CASE("A session that meets ever new bodies keeps its loop, what comes late does not move") {
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  const auto model =
      std::make_unique<LocalModel>(tool, ToolModel(tool).neutral(), LocalModelParameters{}, kStep);
  HandInput hand;
  hand.F[2] = -1;
  std::uint32_t id = 0;
  for (int update = 0; update < 160; ++update) {
    MovableBodies bodies;
    ReportedContacts contacts;
    for (std::size_t i = 0; i < kMaxMovedBodies; ++i) {
      MovableBody& body = bodies.emplace_back();
      body.id = id++;
      body.W = Matrix6::Identity();
      ReportedContact& contact = contacts.emplace_back();
      contact.identity = body.id;
      contact.b = {SideKind::kMovableBody, body.id};
    }
    model->adopt({.contacts = contacts, .q_VE = model->proxy().configuration(), .bodies = bodies});
    model->step(hand);
  }
  CHECK(model->impulses().totals().size() == BodyImpulses::kMaxTouched);
  CHECK(model->velocity().allFinite());
}

TEST_CASE("Numbers without sense leave a body at rest, not the model in ruins") {
  const ToolDescription tool = test::rigid_tool(1, Matrix3::Identity() * 1e-3);
  LocalModel model(tool, ToolModel(tool).neutral(), {}, kStep);
  MovableBody body;
  body.W = 1e12 * Matrix6::Identity();
  body.P_W.setConstant(-1e6);
  ReportedContact contact;
  contact.b = {SideKind::kMovableBody, 0};
  HandInput hand;
  hand.F[2] = -1;
  for (int i = 0; i < 100; ++i) {
    if (i % 10 == 0) {
      model.adopt({.contacts = {contact}, .q_VE = model.proxy().configuration(), .bodies = {body}});
    }
    model.step(hand);
    REQUIRE(model.velocity().allFinite());
    REQUIRE(std::isfinite(model.healing_tank()));
  }
}

TEST_CASE("A body without mobility of its own in a direction does not move in it") {
  // As on a slide along x.
  MovableBody reported;
  reported.W(0, 0) = 2;
  const LocalBody body(reported);
  REQUIRE(body.B.cols() == 1);
  CHECK((body.B * body.B.transpose() - reported.W).norm() < 1e-12);
}

TEST_CASE("A body that joints leave one direction moves in that one, whatever rounding is in W") {
  test::Random random;
  for (int i = 0; i < 1000; ++i) {
    CAPTURE(i);
    // As the jaw on a slider had it in an engine: 3.3 1/kg along x, and beside a diagonal of zeros
    // what rounding leaves.
    MovableBody reported;
    reported.W(0, 0) = random.uniform(0.1, 10);
    for (int row = 1; row < 6; ++row) {
      for (int column = 0; column < row; ++column) {
        const double rounding = random.uniform(-1, 1) * std::pow(10, random.uniform(-70, -12));
        reported.W(row, column) = reported.W(column, row) = rounding;
      }
    }
    const LocalBody body(reported);
    CHECK(body.B.cols() == 1);
    CHECK((body.B * body.B.transpose() - reported.W).norm() < 1e-9);
  }
}

TEST_CASE("A round body's contacts do not go round with it, those of others do") {
  const Roundness roundness = GENERATE(Roundness::kNone, Roundness::kAxis, Roundness::kSphere);
  MovableBody reported;
  reported.W.setIdentity();
  reported.roundness = roundness;
  reported.axis_W = {0, 1, 0};
  LocalBody body(reported);
  Twist V = Twist::Zero();
  V.tail<3>() << 0, 3, 0;  // rad/s: it rolls
  for (int i = 0; i < 100; ++i) body.advance(V, 1e-3);
  V.tail<3>() << 0, 0, 2;  // rad/s: it is turned across its axis
  for (int i = 0; i < 100; ++i) body.advance(V, 1e-3);
  const Eigen::AngleAxisd rolled(0.3, Vector3::UnitY());
  const Eigen::AngleAxisd turned(0.2, Vector3::UnitZ());
  Quaternion expected = Quaternion::Identity();
  if (roundness == Roundness::kAxis) expected = turned;
  if (roundness == Roundness::kNone) expected = turned * rolled;
  CHECK(body.X_WB.R.angularDistance(expected) < 1e-9);  // rad
}

/// The floor and six cubes of 50 mm and 0.3 kg on it; the tool touches the top one at its side.
struct Tower {
  static constexpr double kSize = 0.05;  // m
  static constexpr double kMass = 0.3;   // kg
  static constexpr double kMoment = kMass * kSize * kSize / 6;

  ReportedContacts contacts;
  MovableBodies bodies;

  Tower() {
    for (std::uint32_t id = 0; id < 6; ++id) {
      MovableBody& body = bodies.emplace_back();
      body.id = id;
      body.p_WCom = {0, 0, (id + 0.5) * kSize};
      body.W.diagonal() << Vector3::Constant(1 / kMass), Vector3::Constant(1 / kMoment);
      body.A_W[2] = -kGravity;
      for (std::uint64_t i = 0; i < 4; ++i) {
        ReportedContact& contact = contacts.emplace_back();
        contact.identity = 10 * (id + 1) + i;
        contact.a = {SideKind::kMovableBody, id};
        if (id > 0) contact.b = {SideKind::kMovableBody, id - 1};
        contact.p_WC = {i & 1 ? 0.025 : -0.025, i & 2 ? 0.025 : -0.025, id * kSize};
        contact.load = (6 - id) * kMass * kGravity / 4;
        contact.friction = 0.5;
      }
    }
    for (std::uint64_t i = 0; i < 4; ++i) {
      ReportedContact& contact = contacts.emplace_back();
      contact.identity = i;
      contact.b = {SideKind::kMovableBody, 5};
      contact.n_W = -Vector3::UnitX();
      contact.p_WC = {-0.025, i & 1 ? 0.01 : -0.01, 5.4 * kSize + (i & 2 ? 0.01 : -0.01)};
      contact.friction = 0.3;
    }
  }
};

TEST_CASE("The bodies of a pushed tower move by the forces of their contacts in every step",
          "[optimised]") {
  test::Random random;
  const Tower tower;
  ToolDescription tool = test::rigid_tool(0.5, Matrix3::Identity() * 1e-3);
  Configuration q = ToolModel(tool).neutral();
  q.head<3>() << -0.025, 0, 5.4 * Tower::kSize;
  const auto model = std::make_unique<LocalModel>(tool, q, LocalModelParameters{}, kStep);
  int moved = 0;
  int unsettled = 0;
  for (int trial = 0; trial < 200; ++trial) {
    model->adopt({.contacts = tower.contacts,
                  .q_VE = q,
                  .bodies = tower.bodies,
                  .impulse_step = static_cast<double>(model->impulses().step())});
    for (int i = 0; i < 20; ++i) {
      const LocalBodies before = model->bodies();
      HandInput hand;
      hand.F.head<3>() = Vector3(2, 0, 0) + random.vector(2);
      model->step(hand);
      std::vector<Vector3> impulses(6, -kStep * Tower::kMass * kGravity * Vector3::UnitZ());
      for (const LocalContacts* contacts : {&model->contacts(), &model->supports()}) {
        for (const LocalContact& contact : *contacts) {
          if (contact.a.kind == SideKind::kMovableBody) {
            impulses[contact.a.index] += kStep * contact.latest.f_W;
          }
          if (contact.b.kind == SideKind::kMovableBody) {
            impulses[contact.b.index] -= kStep * contact.latest.f_W;
          }
        }
      }
      // In the first step contacts settle into what the update says.
      if (i == 0 || model->state() == ProxyContactState::kColliding) continue;
      for (std::size_t id = 0; id < 6; ++id) {
        Vector3 gained = Tower::kMass * (model->bodies()[id].V_W - before[id].V_W).head<3>();
        if (before[id].correction_steps > 0) {
          gained -= Tower::kMass / before[id].correction_steps * before[id].correction.head<3>();
        }
        ++moved;
        unsettled += (gained - impulses[id]).norm() > 1e-3;  // N·s
      }
    }
  }
  CHECK(moved > 20'000);
  CHECK(unsettled <= moved / 500);
}

}  // namespace
}  // namespace hlm::server
