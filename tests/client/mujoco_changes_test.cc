// What a session of MuJoCo in C++ leaves of a user's model and forces.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <vector>

#include <unistd.h>

#include "hlm/client/mujoco/session.h"
#include "hlm/protocol/transport/udp_socket.h"
#include "tests/support/catch.h"

namespace hlm::mujoco {
namespace {

constexpr const char* kScene = R"(<mujoco><worldbody><geom type="plane" size="1 1 0.1"/>
  <body name="tool" pos="0 0 0.1"><freejoint/><geom type="box" size="0.02 0.02 0.02" margin="0.001"/></body>
  <body name="cube" pos="0 0 0.3"><freejoint/><geom type="box" size="0.02 0.02 0.02"/></body>
  </worldbody></mujoco>)";

struct World {
  World() {
    const auto file = std::filesystem::temp_directory_path() /
                      ("hlm_changes_" + std::to_string(getpid()) + ".xml");
    std::ofstream(file) << kScene;
    char error[500] = "";
    model.reset(mj_loadXML(file.c_str(), nullptr, error, sizeof error));
    std::filesystem::remove(file);
    INFO(error);
    REQUIRE(model != nullptr);
    data.reset(mj_makeData(model.get()));
  }
  std::vector<char> bytes() const {
    std::vector<char> saved(static_cast<std::size_t>(mj_sizeModel(model.get())));
    mj_saveModel(model.get(), nullptr, saved.data(), static_cast<int>(saved.size()));
    return saved;
  }

  std::unique_ptr<mjModel, decltype(&mj_deleteModel)> model{nullptr, &mj_deleteModel};
  std::unique_ptr<mjData, decltype(&mj_deleteData)> data{nullptr, &mj_deleteData};
};

Vector6 force(double first) {
  Vector6 F_W = Vector6::Zero();
  F_W[0] = first;
  return F_W;
}

TEST_CASE("The model is byte for byte what it was once its session is closed, or gone") {
  World world;
  const std::vector<char> before = world.bytes();
  const protocol::UdpSocket nobody(protocol::resolve("127.0.0.1:0", 0));
  protocol::UdpSocket socket(protocol::resolve("127.0.0.1:0", 0));
  const Options options{.server = nobody.local()};
  {
    Session session(socket, *world.model, *world.data, "tool", options);
    session.drive();
    session.send();
    CHECK(world.bytes() != before);
    session.close();
    CHECK(world.bytes() == before);
  }
  {
    Session session(socket, *world.model, *world.data, "tool", options);
    session.drive();
    world.model->geom_friction[0] = 0.3;  // The user's own.
  }
  CHECK(world.model->geom_friction[0] == 0.3);
  world.model->geom_friction[0] = 1;
  CHECK(world.bytes() == before);
}

TEST_CASE("A number that somebody else has set since stays as it is") {
  mjtNum number = 1;
  int whole = 3;
  {
    Changes changes;
    changes.set(number, 1e6);
    changes.set(whole, 5);
    number = 2;
  }
  CHECK(number == 2);
  CHECK(whole == 3);
}

TEST_CASE("A push is taken back where it still is, and nothing where forces were cleared") {
  World world;
  mjtNum* const row = world.data->xfrc_applied + 12;
  row[0] = 4;  // The user's.
  Pushes pushes;
  const auto push = [&] { pushes.add(*world.data, 2, force(3)); };
  push();
  CHECK(row[0] == 7);
  CHECK(pushes.on(*world.data, 2)[0] == 3);
  pushes.take_back(*world.data);
  CHECK(row[0] == 4);
  push();
  mj_resetData(world.model.get(), world.data.get());
  CHECK(pushes.on(*world.data, 2).isZero(0));
  pushes.take_back(*world.data);
  CHECK(row[0] == 0);
  push();
  row[0] = 9;  // Another one of the user's.
  pushes.take_back(*world.data);
  CHECK(row[0] == 9);
}

TEST_CASE("A body that is kept is seen to be put elsewhere, and not to move by itself") {
  World world;
  Changes changes;
  Bodies bodies(*world.model, 1, changes);
  bodies.keep(2);
  CHECK_FALSE(bodies.was_moved(*world.data, 2));
  CHECK(bodies.leave(*world.data, 0).empty());
  world.data->qpos[9] += 1e-3;
  CHECK_FALSE(bodies.was_moved(*world.data, 2));
  world.data->qpos[9] += 0.1;
  CHECK(bodies.was_moved(*world.data, 2));
  bodies.let_go(2);
  CHECK_FALSE(bodies.was_moved(*world.data, 2));

  bodies.keep(2);
  bodies.place(*world.data, 2, {{0, 0, 0.3}, {}}, Vector6::Unit(0));
  world.data->qpos[7] += 0.1;
  CHECK(bodies.leave(*world.data, 0.1).empty());
  bodies.place(*world.data, 2, {{0, 0, 0.3}, {}}, Vector6::Unit(0));
  CHECK(bodies.leave(*world.data, 0.1) == std::vector<int>{2});
}

}  // namespace
}  // namespace hlm::mujoco
