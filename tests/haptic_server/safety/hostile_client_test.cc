// What a client that means harm gets out of the device port, in virtual time: the real tick and the
// simulated device, moved by a hand.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <string>

#include <spdlog/fmt/ostr.h>

#include "hlm/haptic_server/device/simulated_device.h"
#include "hlm/haptic_server/loop/servo.h"
#include "tests/haptic_server/loop/servo_bench.h"
#include "tests/support/catch.h"
#include "tests/support/random.h"

namespace hlm::server {
namespace {

/// A hand that moves the handle softly to and fro among the contacts.
HandScript moving_hand() {
  Reach there;
  there.position = {0.02, 0.01, 0};
  there.rotation = {0, 0, 0.2};
  there.grip = {.stiffness = 200, .damping = 10, .angular_stiffness = 0.5, .angular_damping = 0.02};
  Reach back = there;
  back.position = {-0.01, -0.02, 0};
  back.rotation = {0, 0, -0.1};
  return {{{0.3, there}, {0.2, back}}, AfterLastSegment::kRepeat};
}

/// What scripts/energy_receipt.py --bound reads of the ticks: files PREFIX0.csv, PREFIX1.csv, … for
/// the environment variable HLM_HOSTILE_LOG, or nothing.
class PortLog {
 public:
  PortLog() {
    static int files = 0;
    const char* prefix = std::getenv("HLM_HOSTILE_LOG");
    if (!prefix) return;
    file_.open(prefix + std::to_string(files++) + ".csv");
    file_ << "life,time_s,session,step,device_x_m,device_y_m,device_z_m,device_qw,device_qx,"
             "device_qy,device_qz,command_force_x_N,command_force_y_N,command_force_z_N,"
             "command_torque_x_N_m,command_torque_y_N_m,command_torque_z_N_m\n";
  }

  void write(const TickRecord& tick) {
    if (!file_.is_open()) return;
    const Pose& X = tick.X_WD;
    fmt::print(file_, "{},{},{},{},{},{},{},{},{},{},{}", life_, tick.time, tick.session, tick.step,
               X.p.x(), X.p.y(), X.p.z(), X.R.w(), X.R.x(), X.R.y(), X.R.z());
    for (const double number : tick.F_command) fmt::print(file_, ",{}", number);
    file_ << '\n';
  }
  /// A person has let a fault end.
  void begin_life() { ++life_; }

 private:
  std::ofstream file_;
  int life_ = 0;
};

class HostileSession {
 public:
  explicit HostileSession(const ServoOptions& options, bool moves)
      : options_(options),
        moves_(moves),
        device_({.dry_friction = 0, .measures_hand_wrench = true}, moving_hand(), 1 / options.rate),
        servo_(std::make_unique<Servo>(options, 0, session_, device_)) {}

  void run(int updates) {
    while (updates_ < updates) {
      if (random_.integer(0, 3) == 0) say();
      tick();
    }
  }

  /// The most that was given beyond what was taken and explained, over any stretch of time, J.
  double most() const { return most_; }
  double given() const { return given_; }  ///< J.
  double taken() const { return taken_; }  ///< J.
  /// Difference of the server's ledger from that of this test, J.
  double ledger_error() const { return ledger_error_; }
  /// How far given less taken was above what the port never exceeds, J; negative: below it.
  double bound_error() const { return bound_error_; }
  int faults() const { return faults_; }

 private:
  void say() {
    if (!session_.active() || faulty_) return say_hello();
    // Stalls: sometimes nothing for up to 0.1 s.
    if (random_.integer(0, 200) == 0) quiet_ = random_.integer(10, 100);
    if (quiet_ > 0) return;
    protocol::ContactUpdate update;
    update.q_VE = Vector3(random_.uniform(-0.02, 0.02), random_.uniform(-0.02, 0.02),
                          random_.uniform(-0.2, 0.2));
    update.v_VE = Velocity::Zero(3);
    update.ve_period = 1.0 / 60;
    update.echo_step = step_;
    const int count = random_.integer(0, 6);
    for (int i = 0; i < count; ++i) {
      ReportedContact contact;
      const double angle = random_.uniform(0, 6.3);
      contact.identity = static_cast<std::uint64_t>(random_.integer(0, 30));
      if (is_known(update, contact.identity)) continue;
      contact.n_W = {std::cos(angle), std::sin(angle), 0};
      contact.p_WC = Vector3(random_.uniform(-0.03, 0.03), random_.uniform(-0.03, 0.03), 0);
      contact.separation = random_.uniform(-0.02, 0.005);
      if (moves_) contact.v_WC = random_.uniform(-1, 1) * contact.n_W;
      update.contacts.push_back(contact);
    }
    // A wrench that pushes, and says that it resists, or that it does not.
    update.ve_time = ve_time_ += random_.uniform(0, 0.03);
    if (moves_ && random_.integer(0, 1) == 0) {
      ExternalWrench& wrench = update.external.emplace_back();
      const double size = std::pow(10, random_.uniform(-1, 4));
      wrench.F_W << random_.vector(size), random_.vector(0.1 * size);
      if (random_.integer(0, 1) == 0) wrench.F_W = -size * displacement(Pose{}, X_WD_);
      update.v_VE = Vector3(random_.vector(1));
    }
    link_.deliver(kClient, {.session = session_.id(), .sequence = ++sequence_}, update);
    ++updates_;
  }

  static bool is_known(const protocol::ContactUpdate& update, std::uint64_t identity) {
    return std::any_of(update.contacts.begin(), update.contacts.end(),
                       [&](const ReportedContact& c) { return c.identity == identity; });
  }

  /// As a person at the device would.
  void clear() {
    if (!ends_at_device(fault_)) return;
    log_.begin_life();
    servo_->obey(Intervention::kClear);
    const double forgiven = std::max(0.0, -port_.tank);
    forgiven_ += forgiven;
    net_ -= forgiven;
  }

  void say_hello() {
    if (session_.active()) {
      link_.deliver(kClient, {.session = session_.id(), .sequence = ++sequence_},
                    protocol::Goodbye{});
    }
    protocol::Hello hello;
    hello.nonce = ++hellos_;
    hello.tool = test::planar_tool();
    hello.q = Vector3(0, 0, 0);
    hello.clears_fault = true;
    clear();
    sequence_ = 0;
    faulty_ = false;
    link_.deliver(kClient, {.sequence = hellos_}, hello);
  }

  void tick() {
    quiet_ = std::max(0, quiet_ - 1);
    ++timing_.tick;
    timing_.scheduled = timing_.begin = static_cast<double>(timing_.tick) / options_.rate;
    const TickRecord record = servo_->tick(timing_);
    link_.forget_sent();
    log_.write(record);
    step_ = record.step;
    if (!faulty_) count(record);  // The ticks after it have no ledger.
    if (record.fault != Fault::kNone && !faulty_) ++faults_, faulty_ = true;
  }

  void count(const TickRecord& record) {
    if (record.step <= 1 && record.fault == Fault::kNone) {
      explained_before_ = 0;
      session_given_ = session_taken_ = 0;
    } else {
      const double work = command_.dot(displacement(X_WD_, record.X_WD));
      (work > 0 ? session_given_ : session_taken_) += std::abs(work);
      given_ += std::max(work, 0.0);
      taken_ += std::max(-work, 0.0);
      net_ += work - (record.port.explained - explained_before_);
      explained_before_ = record.port.explained;
      ledger_error_ = std::max({ledger_error_, std::abs(session_given_ - record.port.given),
                                std::abs(session_taken_ - record.port.taken)});
    }
    bound_error_ = std::max(bound_error_, given_ - taken_ - bound_ - forgiven_ -
                                              options_.limits.claim_power * record.time);
    port_ = record.port;
    fault_ = record.fault;
    least_ = std::min(least_, net_);
    most_ = std::max(most_, net_ - least_);
    command_ = record.F_command;
    X_WD_ = record.X_WD;
  }

  static constexpr auto kClient = test::ServoBench::kClient;

  ServoOptions options_;
  bool moves_;
  test::Random random_;
  test::QueueLink link_;
  protocol::ServerSession session_{link_, {}};
  SimulatedDevice device_;
  std::unique_ptr<Servo> servo_;
  Timing timing_;
  std::uint64_t hellos_ = 0;
  std::uint64_t sequence_ = 0;
  double ve_time_ = 0;      ///< s.
  std::uint64_t step_ = 0;  ///< Of the latest tick.
  int updates_ = 0;
  int quiet_ = 0;  ///< Ticks left of a stall.
  bool faulty_ = false;
  int faults_ = 0;

  PortLog log_;
  Wrench command_ = Wrench::Zero();
  Pose X_WD_;
  double explained_before_ = 0;
  double session_given_ = 0;
  double session_taken_ = 0;
  double given_ = 0;
  double taken_ = 0;
  double net_ = 0;
  double least_ = 0;
  double most_ = 0;
  double ledger_error_ = 0;
  double bound_ = 2 * (options_.limits.max_energy + options_.limits.claim_energy);
  double bound_error_ = -bound_;
  double forgiven_ = 0;  ///< Debts of the tank, by whoever cleared faults, J.
  PortLedger port_;
  Fault fault_ = Fault::kNone;
};

/// Of the updates of one rule.
void check(int updates) {
  const UpdateRule rule = GENERATE(UpdateRule::kRetain, UpdateRule::kIntermediateRepresentation);
  const bool moves = GENERATE(false, true);
  ServoOptions options;
  options.local_model.update_rule = rule;
  HostileSession session(options, moves);
  session.run(updates);
  INFO(name_of(rule) << (moves ? ", moving walls" : ", walls at rest") << ": given "
                     << session.given() << " J, taken " << session.taken() << " J, at most "
                     << session.most() << " J at a stretch, " << session.faults() << " faults");
  CHECK(session.given() > 0.1);
  CHECK(session.ledger_error() < 1e-9);  // J
  CHECK(session.bound_error() < 0);
  // What the rate limit lets through while the force is taken back comes on top.
  CHECK(session.most() <= options.limits.max_energy + 0.05);
}

TEST_CASE("A hostile client gets no more out of the port than is taken, explained, and a tank") {
  check(3000);
}

// test_hostile_client "[million]"
TEST_CASE("The same over a million updates", "[.][million]") { check(1'000'000 / 4); }

}  // namespace
}  // namespace hlm::server
