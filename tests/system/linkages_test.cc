// The linkages that come with the project, led by their hands, server and client together.
#include <cstdio>
#include <string>

#include "hlm/haptic_server/device/hand_script.h"
#include "tests/support/catch.h"
#include "tests/support/virtual_session.h"

namespace hlm::test {
namespace {

/// The scene of worlds/NAME.sdf under the hand of worlds/hands/NAME.toml, and where it went.
class Scene {
 public:
  Scene(const std::string& name, const std::string& tool, const std::string& target)
      : session_(options(name, tool)), target_(body_named(target)) {}

  /// Least and greatest values since the beginning.
  struct Reach {
    Configuration lowest;  ///< Of the world's tool.
    Configuration highest;
    Vector3 target_lowest;  ///< Place of the target, world, m.
    Vector3 target_highest;
  };

  Reach run(double duration) {
    Reach reach{q(), q(), target(), target()};
    for (double t = 0; t < duration; t += kLook) {
      session_.run(kLook);
      reach.lowest = reach.lowest.cwiseMin(q());
      reach.highest = reach.highest.cwiseMax(q());
      reach.target_lowest = reach.target_lowest.cwiseMin(target());
      reach.target_highest = reach.target_highest.cwiseMax(target());
    }
    CHECK(session_.last().fault == Fault::kNone);
    return reach;
  }

 private:
  static constexpr double kLook = 0.05;  // s

  static VirtualSessionOptions options(const std::string& name, const std::string& tool) {
    VirtualSessionOptions options;
    options.world = repository_world(name + ".sdf");
    options.tool = tool;
    options.hand = server::read_hand_script(std::string(HLM_WORLDS) + "/hands/" + name + ".toml");
    return options;
  }
  int body_named(const std::string& name) {
    const auto& bodies = session_.environment().world.description().bodies;
    int index = 0;
    while (bodies.at(static_cast<std::size_t>(index)).name != name) ++index;
    return index;
  }
  const Configuration& q() { return session_.environment().tools.front().tool.q(); }
  Vector3 target() { return session_.environment().world.X_WB(target_).p; }

  VirtualSession session_;
  int target_;
};

TEST_CASE("The arm reaches around the corner to the button, and its joints stop at their limits") {
  Scene scene("corner", "arm", "button::body");
  const Scene::Reach reach = scene.run(24);
  CAPTURE(reach.lowest.transpose(), reach.highest.transpose());
  CHECK(reach.lowest[0] == Approx(-0.8).margin(0.01));  // rad
  CHECK(reach.lowest[1] == Approx(-1.1).margin(0.01));  // rad: all but stretched
  CHECK(reach.highest[1] == Approx(1.3).margin(0.01));  // rad: folded
  CHECK(reach.target_lowest.x() < 0.09 - 0.01);         // m: the button is pushed in
  CHECK(reach.target_lowest.x() > 0.09 - 0.042);        // m: not beyond its stop
}

TEST_CASE("The scissors close on the peg and on the pin, and stop at their limits") {
  Scene scene("scissors", "scissors", "peg::body");
  const Scene::Reach reach = scene.run(22);
  CAPTURE(reach.lowest.transpose(), reach.highest.transpose());
  CHECK(reach.highest[1] == Approx(0.6).margin(0.01));  // rad: closed
  CHECK(reach.highest[0] == Approx(0.1).margin(1e-3));  // m: the slide's end
  // The peg is pushed until the fixed blade holds it: its edge at 2 mm, its radius 12 mm.
  CHECK(reach.target_highest.y() == Approx(0.002 - 0.012).margin(2e-3));
}

}  // namespace
}  // namespace hlm::test
