// A hand in a MuJoCo world: the body "tool" is felt, other bodies can be pushed, carried or turned.
//
//   haptic_server --device-option freedom=spatial --hand HAND.toml   # in another terminal
//   touch_mujoco scene.xml 127.0.0.1:47800 10                        # 10 s
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <stdexcept>
#include <thread>

#include <hlm/client/mujoco/session.h>
#include <hlm/protocol/transport/udp_socket.h>
#include <mujoco/mujoco.h>

namespace {

constexpr double kRate = 60;  // frames a second

void simulate(const char* scene, const char* server, double seconds) {
  char error[500] = "";
  const std::unique_ptr<mjModel, decltype(&mj_deleteModel)> model(
      mj_loadXML(scene, nullptr, error, sizeof error), &mj_deleteModel);
  if (!model) throw std::runtime_error(error);
  const std::unique_ptr<mjData, decltype(&mj_deleteData)> data(mj_makeData(model.get()),
                                                               &mj_deleteData);
  hlm::protocol::UdpSocket socket(hlm::protocol::Endpoint{});  // any free port
  hlm::mujoco::Options options;
  options.server = hlm::protocol::resolve(server);
  options.period = 1 / kRate;
  hlm::mujoco::Session touch(socket, *model, *data, "tool", options);

  const auto start = std::chrono::steady_clock::now();
  const int frames = static_cast<int>(seconds * kRate);
  const int last = model->nbody - 1;
  for (int frame = 1; frame <= frames; ++frame) {
    const int steps = touch.drive();
    for (int i = 0; i < steps; ++i) mj_step(model.get(), data.get());
    touch.send();
    if (frame % static_cast<int>(kRate / 2) == 0) {
      const double* p = data->xipos + 3 * last;
      std::printf("%s, tool at (%.4f, %.4f, %.4f) m, body at (%.4f, %.4f, %.4f) m, contacts: %zu\n",
                  touch.client().connected() ? "connected" : "no server", touch.q()[0],
                  touch.q()[1], touch.q()[2], p[0], p[1], p[2], touch.contacts());
    }
    std::this_thread::sleep_until(start + frame * std::chrono::duration<double>(options.period));
  }
  touch.close();
}

}  // namespace

int main(int argc, char** argv) try {
  simulate(argc > 1 ? argv[1] : "scene.xml", argc > 2 ? argv[2] : "127.0.0.1:47800",
           argc > 3 ? std::atof(argv[3]) : 10);
} catch (const std::exception& error) {
  std::fprintf(stderr, "touch_mujoco: %s\n", error.what());
  return 1;
}
