// Scenes: which tool a world is played with, and which worlds stand beside it.
#include "hlm/ve_client/scene/scene.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include <unistd.h>

#include "tests/support/catch.h"
#include "tests/support/worlds.h"

namespace hlm::ve {
namespace {

using Catch::Matchers::ContainsSubstring;
namespace fs = std::filesystem;

/// A folder of worlds, with one that may not be reached from it.
struct Folder {
  Folder() { fs::create_directories(path); }
  ~Folder() { fs::remove_all(path.parent_path()); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  fs::path write(const std::string& name, const std::string& contents) const {
    std::ofstream(path / name) << "<sdf version='1.9'><world name='w'>" << contents
                               << "</world></sdf>";
    return path / name;
  }

  fs::path path =
      fs::temp_directory_path() / ("hlm_scene_test." + std::to_string(getpid())) / "worlds";
};

const std::string kModels =
    test::model("peg", "0 0 0 0 0 0", "") + test::model("brick", "1 0 0 0 0 0", "");

std::vector<std::string> names(const std::vector<SceneSummary>& scenes) {
  std::vector<std::string> names;
  for (const SceneSummary& scene : scenes) names.push_back(scene.name);
  return names;
}

TEST_CASE("A scene has the tool that is asked for, or else the one that the world names") {
  const Folder folder;
  const fs::path named = folder.write("named.sdf", "<haptic:tool>peg</haptic:tool>" + kModels);
  CHECK(load_scene(named).tools == std::vector<std::string>{"peg"});
  CHECK(load_scene(named, {{"brick", ""}}).tools == std::vector<std::string>{"brick"});
  CHECK_THROWS_WITH(load_scene(named, {{"hammer", ""}}),
                    ContainsSubstring("'hammer'") && ContainsSubstring("it has: peg, brick"));
  CHECK_THROWS_WITH(load_scene(named, {{"", "moon"}}), ContainsSubstring("start 'moon'"));

  const fs::path plain = folder.write("plain.sdf", kModels);
  CHECK(load_scene(plain, {{"peg", ""}}).tools == std::vector<std::string>{"peg"});
  CHECK_THROWS_WITH(load_scene(plain), ContainsSubstring("plain.sdf") &&
                                           ContainsSubstring("--tool") &&
                                           ContainsSubstring("<haptic:tool>") &&
                                           ContainsSubstring("it has: peg, brick"));
}

TEST_CASE("A scene for two hands has two tools: those that are asked for, or else the world's") {
  const Folder folder;
  const fs::path two = folder.write("two.sdf",
                                    "<haptic:tool>peg</haptic:tool><haptic:second_tool>brick"
                                    "</haptic:second_tool>" +
                                        kModels);
  CHECK(load_scene(two).tools == std::vector<std::string>{"peg"});
  CHECK(load_scene(two, {{}, {}}).tools == std::vector<std::string>{"peg", "brick"});
  const fs::path other =
      folder.write("other.sdf", "<haptic:second_tool>brick</haptic:second_tool>" + kModels);
  CHECK_THROWS_WITH(load_scene(other), ContainsSubstring("which model is the tool?"));
  CHECK(load_scene(other, {{"peg", ""}, {}}).tools == std::vector<std::string>{"peg", "brick"});
  const fs::path one = folder.write("one.sdf", "<haptic:tool>peg</haptic:tool>" + kModels);
  CHECK(load_scene(one, {{}, {"brick", ""}}).tools == std::vector<std::string>{"peg", "brick"});
  CHECK_THROWS_WITH(
      load_scene(one, {{}, {}}),
      ContainsSubstring("which model is the second tool") && ContainsSubstring("--second-tool"));
  CHECK_THROWS_WITH(load_scene(one, {{}, {"peg", ""}}),
                    ContainsSubstring("tool 'peg' is named twice"));
}

TEST_CASE(
    "Every world of the repository is a scene that says what is to be felt, in 80 characters") {
  const auto scenes = scenes_beside(fs::path(HLM_WORLDS) / "testbed.sdf");
  CHECK(names(scenes) == std::vector<std::string>{"assembly", "bimanual", "clutter", "contrast",
                                                  "corner", "door", "gripper", "lift", "linkage",
                                                  "mesh", "peg_in_hole_3d", "playground", "push",
                                                  "scale", "scissors", "stack", "testbed"});
  for (const SceneSummary& scene : scenes) {
    CAPTURE(scene.name);
    const Scene loaded = load_scene(scene.file);
    CHECK(loaded.tools.front() == loaded.world.tools.front());
    CHECK(scene.description == loaded.world.description);
    CHECK_FALSE(scene.description.empty());
    CHECK(scene.name.size() + scene.description.size() <= 80);
  }
}

TEST_CASE("The menu has the worlds of the folder, broken ones too, and none from outside") {
  const Folder folder;
  const fs::path played =
      folder.write("b.sdf", "<haptic:description>Two\n words</haptic:description>" + kModels);
  folder.write("c.sdf", kModels);
  std::ofstream(folder.path / "a.sdf") << "not a world";
  folder.write("notes.txt", "");
  fs::create_directory(folder.path / "folder.sdf");
  fs::create_symlink("c.sdf", folder.path / "link.sdf");
  fs::create_symlink("nowhere.sdf", folder.path / "dangling.sdf");
  fs::copy_file(played, folder.path / ".." / "outside.sdf");
  fs::create_symlink("../outside.sdf", folder.path / "outside.sdf");

  const auto scenes = scenes_beside(played);
  CHECK(names(scenes) == std::vector<std::string>{"a", "b", "c", "link"});
  CHECK(scenes.at(0).description.empty());
  CHECK(scenes.at(1).description == "Two words");
  CHECK(scenes.at(1).file == played);
}

TEST_CASE("A world that is played is in the menu, whatever its name, and the menu is not endless") {
  const Folder folder;
  const fs::path played = folder.write("z.world", kModels);
  for (std::size_t i = 0; i < kMostScenes + 5; ++i) folder.write(std::to_string(i) + ".sdf", "");
  const auto scenes = scenes_beside(played);
  CHECK(scenes.size() == kMostScenes);
  CHECK(scenes.back().name == "z.world");
}

}  // namespace
}  // namespace hlm::ve
