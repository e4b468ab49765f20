// Worlds and the tools in them: loaded, assembled, and in a session with the server.
#include "tests/fuzz/fuzz.h"
#include "tests/support/virtual_session.h"

namespace hlm::fuzz {
namespace {

constexpr double kDuration = 0.04;  // s: one or two frames
/// More take time and show no more.
constexpr std::size_t kMostBodies = 30;
constexpr int kMostTools = 2;

void simulate(const ve::WorldDescription& world, const std::string& tool) {
  test::VirtualSessionOptions options;
  options.world = world;
  options.tool = tool;
  options.hand = test::constant_push(test::force(5, 2, 1));
  test::VirtualSession session(options, [](const server::TickRecord& record) {
    demand(record.F_command.allFinite(), "a command is finite");
    demand(record.fault == Fault::kNone || record.F_command.isZero(0), "no force in a fault");
  });
  session.run(kDuration);
  ++accepted;
}

void read(const std::string& text) {
  const std::string name = "input.sdf";
  try {
    const ve::WorldDescription world = ve::parse_world(text, name);
    if (world.bodies.size() > kMostBodies) return;
    int tools = 0;
    for (const ve::ModelDescription& model : world.models) {
      if (tools == kMostTools) break;
      try {
        simulate(world, model.name);
        ++tools;
      } catch (const std::runtime_error&) {  // Most models are no tools.
      }
    }
  } catch (const std::runtime_error& error) {
    demand(is_one_line_about(name, error.what()), "an error is one line that names the file");
  }
}

}  // namespace
}  // namespace hlm::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  hlm::fuzz::read({reinterpret_cast<const char*>(data), size});
  return 0;
}
