// A servo between a device that does as the test says and a client that is the test.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hlm/haptic_server/loop/servo.h"
#include "tests/protocol/queue_link.h"
#include "tests/support/random_tool.h"

namespace hlm::test {

/// What passed between the servo and its surroundings, in order.
using Journal = std::vector<std::string>;

class ScriptedDevice final : public server::Device, private server::GuidedHand {
 public:
  explicit ScriptedDevice(Journal& journal) : journal_(journal) {}

  std::string_view name() const noexcept override { return "scripted device"; }
  const server::DeviceRatings& ratings() const noexcept override { return rated; }
  bool measures_hand_wrench() const noexcept override { return true; }
  void align(const Pose& X_WH) noexcept override {
    journal_.emplace_back("align");
    aligned_to = X_WH;
  }
  void enable() noexcept override {
    journal_.emplace_back("enable");
    enabled = true;
  }
  void disable() noexcept override {
    journal_.emplace_back("disable");
    enabled = false;
  }
  server::GuidedHand* guided_hand() noexcept override { return this; }
  std::optional<server::DeviceState> read() noexcept override {
    journal_.emplace_back("read");
    return state;
  }
  bool write(const Wrench& F) noexcept override {
    journal_.emplace_back("write");
    written = F;
    return takes_wrenches;
  }

  void grip(double force) noexcept override { gripped = force; }
  const char* cause() const noexcept override { return why; }

  server::DeviceRatings rated;
  const char* why = "";                                              ///< What cause() returns.
  std::optional<server::DeviceState> state = server::DeviceState{};  ///< What read() returns.
  bool takes_wrenches = true;                                        ///< What write() returns.
  bool enabled = false;
  Pose aligned_to;
  Wrench written = Wrench::Zero();  ///< The latest.
  double gripped = 0;               ///< Likewise, N.

 private:
  void hold(const Pose&) noexcept override { journal_.emplace_back("hold the hand"); }
  void release() noexcept override { journal_.emplace_back("let go of the hand"); }

  Journal& journal_;
};

/// A QueueLink that keeps the journal.
class JournalLink final : public protocol::DatagramLink {
 public:
  explicit JournalLink(Journal& journal) : journal_(journal) {}

  bool receive(protocol::Datagram& datagram) noexcept override {
    if (!queue.receive(datagram)) return false;
    journal_.push_back("receive " + kind(protocol::view(datagram.bytes)));
    return true;
  }
  void send(const protocol::Endpoint& to, std::span<const std::byte> bytes) noexcept override {
    journal_.push_back("send " + kind(bytes));
    queue.send(to, bytes);
  }

  QueueLink queue;

 private:
  static std::string kind(std::span<const std::byte> bytes) {
    protocol::Header header;
    if (decode_header(bytes, header)) return "garbage";
    switch (header.type) {
      case protocol::MessageType::kHello:
        return "hello";
      case protocol::MessageType::kWelcome:
        return "welcome";
      case protocol::MessageType::kReject:
        return "reject";
      case protocol::MessageType::kContactUpdate:
        return "update";
      case protocol::MessageType::kProxyState:
        return "state";
      case protocol::MessageType::kGoodbye:
        return "goodbye";
      case protocol::MessageType::kControl:
        return "control";
      default:
        return "telemetry";
    }
  }

  Journal& journal_;
};

/// A tool of 1 kg and 2e-3 kg·m² that moves in the plane, held at its centre of mass.
inline ToolDescription planar_tool() {
  return rigid_tool(1, Matrix3::Identity() * 2e-3, JointType::kPlanar);
}

/// Two planar links, joined by a hinge.
inline ToolDescription planar_linkage() {
  ToolDescription tool = planar_tool();
  Link second = tool.links[0];
  second.parent = 0;
  second.joint = JointType::kRevolute;
  second.X_PJ.p = {0.05, 0, 0};
  tool.links.push_back(second);
  return tool;
}

/// A wall at right angles to x, `distance` from the tool's point at height y, for a tool at the
/// origin. approach: its speed towards the tool, m/s.
inline ReportedContact wall_ahead(double distance, double y = 0, double approach = 0) {
  ReportedContact wall;
  wall.n_W = {-1, 0, 0};
  wall.p_WC = {distance, y, 0};
  wall.separation = distance;
  wall.v_WC = {-approach, 0, 0};
  return wall;
}

inline Wrench planar_wrench(double fx, double fy, double tz) {
  Wrench F = Wrench::Zero();
  F << fx, fy, 0, 0, 0, tz;
  return F;
}

class ServoBench {
 public:
  static constexpr protocol::Endpoint kClient{.address = 0x0A000002, .port = 50000};

  /// Updates may be rare.
  static server::ServoOptions patient() {
    server::ServoOptions options;
    options.silence_time = 0.25;
    return options;
  }

  explicit ServoBench(server::ServoOptions servo_options = patient(),
                      std::uint64_t configuration = 0, server::DeviceRatings rated = {},
                      server::SceneSource* scenes = nullptr)
      : options(std::move(servo_options)) {
    device.rated = rated;
    servo = std::make_unique<server::Servo>(options, configuration, session, device, scenes);
  }

  ServoBench(const ServoBench&) = delete;
  ServoBench& operator=(const ServoBench&) = delete;

  /// One period later.
  const server::TickRecord& tick(std::uint64_t missed = 0) {
    journal.clear();
    timing.missed = missed;
    timing.tick += 1 + missed;
    timing.overruns += missed;
    timing.scheduled = timing.begin = static_cast<double>(timing.tick) / options.rate;
    const server::TickRecord& record = servo->tick(timing);
    step = record.step;
    return record;
  }
  const server::TickRecord& ticks(int count) {
    for (int i = 1; i < count; ++i) tick();
    return tick();
  }

  void say_hello(const ToolDescription& tool = planar_tool()) {
    say_hello(tool, ToolModel(tool).neutral());
  }
  void say_hello(const ToolDescription& tool, const Configuration& q) {
    if (session.active()) send(protocol::Goodbye{});
    protocol::Hello hello;
    hello.nonce = ++hellos;
    hello.tool = tool;
    hello.q = q;
    hello.ve_rate = ve_rate;
    hello.clears_fault = clears_fault;
    // For a session begun anew everything counts from 1 again.
    sequence = step = 0;
    link.queue.deliver(kClient, {.sequence = hellos}, hello);
    q_VE = q;
    dof = ToolModel(tool).dof();
  }
  /// A session, and the tick that begins it.
  const server::TickRecord& begin(const ToolDescription& tool = planar_tool()) {
    say_hello(tool);
    return tick();
  }

  /// An update for the tool at its initial configuration, at rest, that answers the latest step.
  protocol::ContactUpdate update(const ReportedContacts& contacts = {}) const {
    protocol::ContactUpdate update;
    update.ve_period = 1 / ve_rate;
    update.q_VE = q_VE;
    update.v_VE = Velocity::Zero(dof);
    update.contacts = contacts;
    update.echo_step = step;
    return update;
  }
  template <class Message>
  void send(const Message& message) {
    link.queue.deliver(kClient, {.session = session.id(), .sequence = ++sequence}, message);
  }
  const server::TickRecord& tick_with(const protocol::ContactUpdate& update) {
    send(update);
    return tick();
  }
  template <class Message>
  Message last_sent() const {
    return link.queue.last_sent<Message>();
  }

  server::ServoOptions options;
  Journal journal;  ///< Of the latest tick.
  JournalLink link{journal};
  ScriptedDevice device{journal};
  protocol::ServerSession session{link, {}};
  std::unique_ptr<server::Servo> servo;
  server::Timing timing;
  double ve_rate = 60;       ///< Of the hellos, Hz.
  bool clears_fault = true;  ///< Likewise.
  std::uint64_t hellos = 0;
  std::uint64_t sequence = 0;  ///< Of the client's latest message in the session.
  std::uint64_t step = 0;      ///< The latest.
  Configuration q_VE;
  int dof = 0;
};

}  // namespace hlm::test
