// A simulator that lets a hand feel its world: a ball above a floor, in the plane. y points down.
//
//   simulator                                        # 10 s, with a haptic_server of its own
//
//   haptic_server --hand worlds/hands/session.toml   # or one in another terminal
//   simulator 127.0.0.1:47800
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <optional>
#include <thread>

#include <hlm/client/haptic_client.h>
#include <hlm/client/own_server.h>
#include <hlm/protocol/transport/udp_socket.h>

namespace {

constexpr double kRadius = 0.015;  // m
constexpr double kFloor = 0.03;    // y, m
constexpr double kEpsilon =
    0.005;  // Contacts are sent before they touch, from this separation on, m.
constexpr double kPeriod = 1.0 / 60;  // s

double now() {
  using Seconds = std::chrono::duration<double>;
  return Seconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// What the hand holds: a ball of 0.1 kg with x, y and an angle.
hlm::ToolDescription ball() {
  hlm::Link link;
  link.joint = hlm::JointType::kPlanar;
  link.mass = 0.1;
  link.I_LCom *= 0.4 * link.mass * kRadius * kRadius;
  hlm::ToolDescription tool;
  tool.links.push_back(link);
  return tool;
}

/// The floor under the ball, if it is near.
hlm::ReportedContacts contacts(const hlm::Configuration& q) {
  hlm::ReportedContact contact;
  contact.p_WC = {q[0], kFloor, 0};
  contact.n_W = {0, -1, 0};
  contact.separation = kFloor - kRadius - q[1];
  hlm::ReportedContacts near;
  if (contact.separation <= kEpsilon) near.push_back(contact);
  return near;
}

/// The hand of a simulated device draws the ball 10 mm into the floor, with 200 N/m.
hlm::protocol::Control press() {
  hlm::protocol::Control control;
  control.holds = true;
  control.X_WTarget.p = {0, kFloor - kRadius + 0.01, 0};
  return control;
}

void simulate(const char* named) {
  hlm::Configuration q = hlm::Configuration::Zero(3);
  hlm::Velocity v = hlm::Velocity::Zero(3);
  double force = 0;                                            // N
  hlm::protocol::UdpSocket socket(hlm::protocol::Endpoint{});  // any free port
  hlm::HapticClientOptions options;
  options.server = hlm::protocol::resolve(named != nullptr ? named : hlm::usual_server());
  std::optional<hlm::OwnServer> own;
  if (named == nullptr && !hlm::may_listen(options.server)) {
    own.emplace(hlm::OwnServerOptions{.planar = true});
    options.server = own->endpoint();
  }
  options.tool = ball();
  options.q = q;
  options.ve_rate = 1 / kPeriod;
  options.epsilon = kEpsilon;
  hlm::HapticClient haptic(socket, options);
  if (own) haptic.control(press());

  const auto start = std::chrono::steady_clock::now();
  for (int step = 1; step <= 600; ++step) {
    // A physics engine draws its tool towards the proxy and takes a step; here the tool is carried.
    if (const hlm::protocol::ProxyState* proxy = haptic.poll(now()).state) {
      q = proxy->q;
      v = proxy->v;
      force = proxy->F_env.head<3>().norm();
    }
    haptic.sample(now(), q, v, kPeriod);
    const hlm::ReportedContacts near = contacts(q);
    haptic.send(now(), near);
    if (step % 30 == 0) {
      std::printf("%s, ball at (%.4f, %.4f) m, contacts: %zu, force on the hand: %.2f N\n",
                  haptic.connected() ? "connected" : "no server", q[0], q[1], near.size(), force);
    }
    std::this_thread::sleep_until(start + step * std::chrono::duration<double>(kPeriod));
  }
  haptic.close(now());
}

}  // namespace

int main(int argc, char** argv) try {
  simulate(argc > 1 ? argv[1] : nullptr);
} catch (const std::exception& error) {
  std::fprintf(stderr, "simulator: %s\n", error.what());
  return 1;
}
