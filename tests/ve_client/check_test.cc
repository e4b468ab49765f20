// ve_client --check: what it says of a world, and whether that can be used.
#include "hlm/ve_client/run/check.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <unistd.h>

#include "tests/support/catch.h"
#include "tests/support/worlds.h"

namespace hlm::ve {
namespace {

using Catch::Matchers::ContainsSubstring;

struct Checked {
  bool usable = false;
  std::string text;
};

Checked check(const std::string& world, const std::string& tool = "") {
  Settings settings;
  settings.world = world;
  settings.tools = {{{tool, ""}, "", ""}};
  std::ostringstream out;
  const bool usable = check_scene(settings, out);
  return {usable, out.str()};
}

TEST_CASE("A world that can be used is counted, with what is approximated and ignored in it") {
  const auto [usable, text] = check(HLM_TEST_WORLDS "/materials.sdf");
  CHECK(usable);
  CHECK_THAT(text, ContainsSubstring("models: 1, bodies: 1 (0 fixed), collisions: 1, joints: 0") &&
                       ContainsSubstring("no tool: ") && ContainsSubstring("\napproximated:\n") &&
                       ContainsSubstring("materials.sdf:19: model 'm' link 'body' collision 'box': "
                                         "<mu2>") &&
                       ContainsSubstring("\nignored:\n") && ContainsSubstring("\ncan be used\n"));
}

TEST_CASE("A file of lights or cameras alone can be used, and nothing in it can be touched") {
  for (const char* name : {"light_alone.sdf", "lights_and_camera.sdf"}) {
    CAPTURE(name);
    const auto [usable, text] = check(HLM_TEST_WORLDS "/" + std::string(name));
    CHECK(usable);
    CHECK_THAT(text, ContainsSubstring("\nnothing in it can be touched: it has no <collision>\n"));
    CHECK_FALSE(check(HLM_TEST_WORLDS "/" + std::string(name), "lamp").usable);
  }
  CHECK_THAT(check(HLM_TEST_WORLDS "/shapes.sdf").text, !ContainsSubstring("can be touched"));
}

TEST_CASE("All that is wrong with a world is said at once") {
  const auto [usable, text] = check(HLM_TEST_WORLDS "/bad_values.sdf");
  CHECK_FALSE(usable);
  CHECK(std::ranges::count(text, '\n') == 15);  // Nine faults, and one thing that is approximated.
  CHECK_THAT(text, ContainsSubstring("\nrefused:\n") && ContainsSubstring("cannot be used\n"));
}

TEST_CASE("A tool is checked too, the named one and another") {
  const auto [usable, text] = check(HLM_WORLDS "/linkage.sdf");
  CHECK(usable);
  CHECK_THAT(text, ContainsSubstring("tool 'arm': links: 2, degrees of freedom: 2"));
  const auto [other, why] = check(HLM_WORLDS "/linkage.sdf", "hammer");
  CHECK_FALSE(other);
  CHECK_THAT(why, ContainsSubstring("tool 'hammer'") && ContainsSubstring("it has: arm"));
}

TEST_CASE("The second tool that a world names is checked, unless another is held") {
  const auto [usable, text] = check(HLM_WORLDS "/bimanual.sdf");
  CHECK(usable);
  CHECK_THAT(text, ContainsSubstring("tool 'tray'") && ContainsSubstring("tool 'peg'"));
  CHECK(check(HLM_WORLDS "/bimanual.sdf", "peg").usable);

  const std::string file = std::filesystem::temp_directory_path() /
                           ("hlm_check_test." + std::to_string(getpid()) + ".sdf");
  std::ofstream(file) << "<sdf version='1.9'><world name='w'><haptic:tool>a</haptic:tool>"
                         "<haptic:second_tool>b</haptic:second_tool>"
                      << test::model("a", "0 0 0 0 0 0", "")
                      << test::fixed_model("b", "1 0 0 0 0 0", "") << "</world></sdf>";
  const auto [fixed_usable, why] = check(file);
  std::filesystem::remove(file);
  CHECK_FALSE(fixed_usable);
  CHECK_THAT(why, ContainsSubstring("tool 'b'"));
}

TEST_CASE("What only the engine refuses is refused by the check") {
  const std::string file = std::filesystem::temp_directory_path() /
                           ("hlm_check_test." + std::to_string(getpid()) + ".sdf");
  std::ofstream(file) << "<sdf version='1.9'><world name='w'><model name='m'><link name='l'>"
                      << test::kInertial
                      << "</link><joint name='j' type='revolute'><parent>world</parent>"
                         "<child>l</child><axis><xyz>0 0 1</xyz><dynamics><spring_stiffness>1e9"
                         "</spring_stiffness></dynamics></axis></joint></model></world></sdf>";
  const auto [usable, text] = check(file);
  std::filesystem::remove(file);
  CHECK_FALSE(usable);
  CHECK_THAT(text, ContainsSubstring("spring_stiffness") && ContainsSubstring("to be stable"));
}

}  // namespace
}  // namespace hlm::ve
