// Every shipped scene for a moment, server and client together in virtual time: with sanitizers,
// whatever a whole session touches.
#include <filesystem>
#include <string>

#include "hlm/ve_client/scene/scene.h"
#include "tests/support/catch.h"
#include "tests/support/virtual_session.h"

namespace hlm::test {
namespace {

namespace fs = std::filesystem;

/// In each of them for so many seconds.
void move_about(double seconds) {
  for (const ve::SceneSummary& summary : ve::scenes_beside(fs::path(HLM_WORLDS) / "testbed.sdf")) {
    CAPTURE(summary.name);
    const ve::Scene scene = ve::load_scene(summary.file);
    VirtualSessionOptions options;
    options.world = scene.world;
    options.tool = scene.tools.front();
    options.device.freedom = server::DeviceFreedom::kSpatial;
    options.frame.epsilon = 0.02;
    server::Push push{.constant = force(1, -1, -3), .amplitude = force(4, 4, 2), .frequency = 3};
    options.hand = {{{1.0, push}}, server::AfterLastSegment::kHold};
    bool finite = true;
    VirtualSession session(options, [&](const server::TickRecord& tick) {
      finite = finite && tick.F_command.allFinite() && tick.F_env.allFinite();
    });
    session.run(seconds);
    CHECK(finite);
    CHECK(session.last().fault == Fault::kNone);
  }
}

TEST_CASE("A hand that moves about in any shipped scene feels a finite force") { move_about(0.1); }

TEST_CASE("And for longer", "[optimised]") { move_about(1.5); }

}  // namespace
}  // namespace hlm::test
