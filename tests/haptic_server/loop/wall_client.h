// A session in virtual time with a client whose tool follows the proxy up to a wall.
#pragma once

#include <algorithm>
#include <cstdint>

#include "hlm/haptic_server/loop/servo.h"
#include "tests/protocol/queue_link.h"
#include "tests/support/random_tool.h"

namespace hlm::test {

inline constexpr double kPeriod = 1e-3;  // s
inline constexpr double kWall = 0.01;    // m: x of the wall
inline constexpr int kFrame = 16;        // ticks of a frame of the client
inline constexpr double kToolMass = 1;   // kg

class WallClient {
 public:
  /// So many contacts with the wall, 0: there is none, two and more on a lever, m.
  explicit WallClient(int contacts, double lever = 0) : contacts_(contacts), lever_(lever) {
    protocol::Hello hello;
    hello.nonce = 1;
    hello.tool = rigid_tool(kToolMass, Matrix3::Identity() * 2e-3, JointType::kPlanar);
    hello.q = Configuration::Zero(3);
    hello.ve_rate = 1 / (kFrame * kPeriod);
    link_.deliver(kClient, {.sequence = 1}, hello);
  }

  /// So many ticks; each(i, record) after each of them.
  template <class Each>
  void run(const server::ServoOptions& options, server::Device& device, int ticks, Each each) {
    protocol::ServerSession session(link_, {});
    server::Servo servo(options, 0, session, device);
    for (int i = 0; i < ticks; ++i) {
      if (i > 0 && i % kFrame == 0) send(session.id());
      server::Timing timing;
      timing.tick = static_cast<std::uint64_t>(i);
      timing.scheduled = timing.begin = i * kPeriod;
      const server::TickRecord record = servo.tick(timing);
      if (i % kFrame == 0) follow(record);
      each(i, record);
    }
  }

 private:
  static constexpr protocol::Endpoint kClient{.address = 0x0A000002, .port = 50000};

  void send(std::uint64_t session) {
    protocol::ContactUpdate update;
    update.q_VE = Vector3(x_, 0, 0);
    update.v_VE = Vector3(v_, 0, 0);
    update.ve_period = kFrame * kPeriod;
    update.echo_step = echo_;
    for (int i = 0; i < contacts_; ++i) {
      ReportedContact wall;
      wall.identity = static_cast<std::uint64_t>(i + 1);
      wall.n_W = {-1, 0, 0};
      wall.p_WC = {kWall, lever_ * (i % 2 == 0 ? 1 : -0.75), 0};
      wall.separation = kWall - x_;
      update.contacts.push_back(wall);
    }
    link_.deliver(kClient, {.session = session, .sequence = ++sequence_}, update);
  }

  void follow(const server::TickRecord& record) {
    const double before = x_;
    x_ = contacts_ > 0 ? std::min(record.X_WP.p.x(), kWall) : record.X_WP.p.x();
    v_ = (x_ - before) / (kFrame * kPeriod);
    echo_ = record.step;
    link_.forget_sent();
  }

  int contacts_;
  double lever_;
  QueueLink link_;
  std::uint64_t sequence_ = 0;
  std::uint64_t echo_ = 0;
  double x_ = 0;  // Of its tool, m.
  double v_ = 0;
};

}  // namespace hlm::test
