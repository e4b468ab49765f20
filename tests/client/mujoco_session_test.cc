// hlm::mujoco::Session against the server's own tick, in virtual time.
#include <memory>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include "examples/mujoco_cpp/pre_step.h"
#include "hlm/tools/virtual/virtual_server.h"
#include "tests/support/catch.h"

namespace hlm::test {
namespace {

constexpr double kPeriod = 1.0 / 60;  // s
constexpr double kGravity = 9.81;     // m/s²
constexpr double kTool = 0.1;         // kg

const char* const kTray = R"(<mujoco><option timestep="0.002"/><worldbody>
  <geom type="plane" size="1 1 0.1"/>
  <body name="tool" pos="0 0 0.05"><freejoint/><geom type="box" size="0.05 0.05 0.005" mass="0.1"/></body>
  <body name="cube" pos="0 0 0.0751"><freejoint/><geom type="box" size="0.02 0.02 0.02" mass="0.3"/></body>
</worldbody></mujoco>)";

struct World {
  explicit World(const char* text) {
    char error[500] = "";
    mjVFS files;
    mj_defaultVFS(&files);
    mj_makeEmptyFileVFS(&files, "world.xml", static_cast<int>(std::string(text).size()));
    std::copy_n(text, std::string(text).size(), static_cast<char*>(files.filedata[0]));
    model.reset(mj_loadXML("world.xml", &files, error, sizeof error));
    mj_deleteVFS(&files);
    INFO(error);
    REQUIRE(model);
    data.reset(mj_makeData(model.get()));
  }

  std::unique_ptr<mjModel, decltype(&mj_deleteModel)> model{nullptr, &mj_deleteModel};
  std::unique_ptr<mjData, decltype(&mj_deleteData)> data{nullptr, &mj_deleteData};
};

/// A server whose simulated device nothing holds but hold().
struct Server {
  explicit Server(double delay = 0)
      : server(
            {.arguments = {"--device-option", "freedom=spatial", "--device-option", "friction=0"},
             .network = {.delay = delay}}) {}

  mujoco::Options options() {
    return {.server = protocol::MemoryNetwork::kServer, .period = kPeriod, .clock = [this] {
              return server.now();
            }};
  }
  /// Of the latest tick, N.
  double force() const { return server.ticks().back().F_command.z(); }

  server::VirtualServer server;
};

void hold(mujoco::Session& session, double z) {
  protocol::Control control;
  control.holds = true;
  control.X_WTarget.p = {0, 0, z};
  session.client().control(control);
}

TEST_CASE("A cube on a tray weighs what it weighs through MuJoCo's session, however late") {
  const double delay = GENERATE(0.0, 0.05);
  World world(kTray);
  Server server(delay);
  mujoco::Session touch(server.server.link(), *world.model, *world.data, "tool", server.options());
  while (server.server.now() < 5) {
    if (touch.client().has_scene()) hold(touch, 0.1);
    for (int steps = touch.drive(); steps > 0; --steps) {
      mj_step(world.model.get(), world.data.get());
    }
    touch.send();
    server.server.pass(server.server.now() + kPeriod);
  }
  CHECK(-server.force() == Approx((0.3 + kTool) * kGravity).epsilon(1e-3));
  CHECK(world.data->xpos[3 * 2 + 2] - world.data->xpos[3 + 2] == Approx(0.025).margin(0.001));
}

TEST_CASE("A loop that calls before each step has a hand, too") {
  World world(kTray);
  Server server;
  Touch touch(server.server.link(), *world.model, *world.data, "tool", server.options());
  hold(touch.session(), 0.1);
  for (int step = 0; step < 2500; ++step) {
    touch.pre_step(world.data.get());
    mj_step(world.model.get(), world.data.get());
    server.server.pass(server.server.now() + world.model->opt.timestep);
  }
  CHECK(-server.force() == Approx((0.3 + kTool) * kGravity).epsilon(0.01));
  CHECK(world.data->xpos[3 * 2 + 2] > 0.09);  // m: it was lifted
}

TEST_CASE("After a reset the cube is where that puts it, and the model at the end as it was") {
  World world(kTray);
  const std::vector<mjtNum> armature(world.model->dof_armature,
                                     world.model->dof_armature + world.model->nv);
  Server server;
  mujoco::Session touch(server.server.link(), *world.model, *world.data, "tool", server.options());
  double highest = 0;  // m, of the cube since the reset
  for (int frame = 0; frame < 300; ++frame) {
    if (touch.client().has_scene()) hold(touch, 0.2);
    for (int steps = touch.drive(); steps > 0; --steps) {
      mj_step(world.model.get(), world.data.get());
    }
    touch.send();
    server.server.pass(server.server.now() + kPeriod);
    if (frame == 240) {
      CHECK(world.data->xpos[3 * 2 + 2] > 0.15);
      mj_resetData(world.model.get(), world.data.get());
      mj_forward(world.model.get(), world.data.get());
    }
    if (frame > 242) highest = std::max(highest, world.data->xpos[3 * 2 + 2]);
  }
  CHECK(highest < 0.08);
  touch.close();
  for (int i = 0; i < world.model->nv; ++i) {
    CHECK(world.model->dof_armature[i] == armature[static_cast<std::size_t>(i)]);
  }
  for (int i = 0; i < 6 * world.model->nbody; ++i) CHECK(world.data->xfrc_applied[i] == 0);
}

}  // namespace
}  // namespace hlm::test
