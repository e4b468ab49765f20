// The files of tests/worlds: each is used or refused as verdicts.txt says, with those findings.
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>

#include "hlm/ve_client/scene/scene.h"
#include "hlm/ve_client/scene/sdf_loader.h"
#include "hlm/ve_client/world/world.h"
#include "tests/support/catch.h"

namespace hlm::ve {
namespace {

namespace fs = std::filesystem;

const fs::path kFolder = HLM_TEST_WORLDS;

const char* word(Verdict verdict) {
  switch (verdict) {
    case Verdict::kRefused:
      return "refused ";
    case Verdict::kApproximated:
      return "approximated ";
    case Verdict::kIgnored:
      return "ignored ";
  }
  return "";
}

std::string without_folder(std::string text) {
  const std::string folder = kFolder.string() + "/";
  for (std::size_t at = text.find(folder); at != text.npos; at = text.find(folder)) {
    text.erase(at, folder.size());
  }
  return text;
}

std::string verdict_of(const fs::path& file, const Diagnostics& diagnostics) {
  std::string text = file.filename().string() + (diagnostics.usable() ? " used\n" : " refused\n");
  for (const Verdict verdict : {Verdict::kRefused, Verdict::kApproximated, Verdict::kIgnored}) {
    for (const Finding& finding : diagnostics.findings()) {
      if (finding.verdict != verdict) continue;
      text += word(verdict) + without_folder(to_string(finding)) + "\n";
    }
  }
  return text;
}

/// What verdicts.txt says, by file.
std::map<std::string, std::string> due_verdicts() {
  std::ifstream file(kFolder / "verdicts.txt");
  std::map<std::string, std::string> verdicts;
  std::string text;
  for (std::string line; std::getline(file, line) || !text.empty(); line.clear()) {
    if (line.starts_with("#")) continue;
    if (!line.empty()) {
      text += line + "\n";
    } else if (!text.empty()) {
      verdicts[text.substr(0, text.find(' '))] = text;
      text.clear();
    }
  }
  return verdicts;
}

std::set<fs::path> files() {
  std::set<fs::path> files;
  for (const auto& entry : fs::directory_iterator(kFolder)) {
    const fs::path extension = entry.path().extension();
    if (extension == ".sdf" || extension == ".urdf") files.insert(entry.path());
  }
  return files;
}

/// Messages name the places that were looked at: those of nobody's home.
void forget_environment() {
  for (const char* name : {"SDF_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH",
                           "GAZEBO_MODEL_PATH", "GAZEBO_RESOURCE_PATH", "ROS_PACKAGE_PATH",
                           "AMENT_PREFIX_PATH", "GZ_FUEL_CACHE_PATH", "IGN_FUEL_CACHE_PATH"}) {
    unsetenv(name);
  }
  setenv("HOME", "/home/nobody", 1);
}

TEST_CASE("Each file of the corpus is used or refused as it is due, for the reasons that are due") {
  forget_environment();
  std::map<std::string, std::string> due = due_verdicts();
  for (const fs::path& file : files()) {
    Diagnostics diagnostics;
    load_scene(file, {{}}, diagnostics);
    CHECK(verdict_of(file, diagnostics) == due[file.filename().string()]);
    due.erase(file.filename().string());
  }
  for (const auto& [name, text] : due) FAIL_CHECK("verdicts.txt has " << name << ", which is none");
}

TEST_CASE("A file of the corpus that is used makes a world that moves") {
  for (const fs::path& file : files()) {
    Diagnostics diagnostics;
    const WorldDescription description = load_world(file, diagnostics);
    if (!diagnostics.usable()) continue;
    CAPTURE(file.filename().string());
    World world(description, {});
    for (int step = 0; step < 6; ++step) world.step(1.0 / 60, {}, {});
    CHECK_FALSE(world.fault());
  }
}

TEST_CASE("A file of the corpus that is refused is an error of one line with its first reason") {
  for (const fs::path& file : files()) {
    Diagnostics diagnostics;
    load_world(file, diagnostics);
    if (diagnostics.usable()) continue;
    CAPTURE(file.filename().string());
    std::string error;
    try {
      load_world(file);
    } catch (const RefusedWorld& refused) {
      error = refused.what();
    }
    CHECK(error.starts_with(kFolder.string()));
    CHECK(error.find('\n') == error.npos);
    const int more = diagnostics.count(Verdict::kRefused) - 1;
    CHECK(error.ends_with(" more)") == (more > 0));
  }
}

}  // namespace
}  // namespace hlm::ve
