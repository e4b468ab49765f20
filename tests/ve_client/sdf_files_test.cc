// Files as Gazebo's users have them: what they include, models as root, URDF, older versions,
// frames; where URIs lead; the memory that a large world takes; the table of elements.
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <optional>
#include <sstream>

#include <malloc.h>
#include <sdf/SDFImpl.hh>
#include <sdf/parser.hh>
#include <unistd.h>

#include "hlm/ve_client/scene/resources.h"
#include "hlm/ve_client/scene/sdf_elements.h"
#include "tests/support/catch.h"
#include "tests/support/worlds.h"

namespace hlm::ve {
namespace {

using Catch::Matchers::ContainsSubstring;
namespace fs = std::filesystem;

const fs::path kFolder = HLM_TEST_WORLDS;

WorldDescription load(const std::string& name) { return load_world(kFolder / name); }

const BodyDescription& body(const WorldDescription& world, const std::string& name) {
  const auto found = std::ranges::find(world.bodies, name, &BodyDescription::name);
  if (found == world.bodies.end()) throw std::runtime_error("no body " + name);
  return *found;
}

TEST_CASE("An included model has the name, the pose and <static> of its <include>") {
  const WorldDescription world = load("include_folder.sdf");
  REQUIRE(world.models.size() == 2);
  CHECK(world.models[0].name == "crate");
  CHECK(body(world, "crate::body").X_WB.p.isApprox(Vector3(0, 0, 1), 1e-12));
  CHECK_FALSE(body(world, "crate::body").fixed);
  CHECK(body(world, "second::body").X_WB.p.isApprox(Vector3(1, 0, 0), 1e-12));
  CHECK(body(world, "second::body").fixed);
}

TEST_CASE("A model's folder stands for its file of the latest version that can be read") {
  const WorldDescription world = load("include_newest_version.sdf");
  CHECK(std::holds_alternative<Sphere>(body(world, "old_crate::body").collisions.at(0).shape));
}

TEST_CASE("The parts of a model that is merged are those of the model around it") {
  const WorldDescription world = load("include_merged.sdf");
  REQUIRE(world.models.size() == 1);
  CHECK(world.bodies.size() == 4);
  // The model stands at z = 0.5 m; what is merged is turned by a quarter about z at x = 1 m.
  const BodyDescription& lid = body(world, "robot::lid");
  CHECK_FALSE(lid.fixed);
  CHECK(lid.X_WB.p.isApprox(Vector3(1, 0.2, 0.6), 1e-12));
  CHECK((lid.X_WB * lid.collisions.at(0).X_BG).p.isApprox(Vector3(1, 0, 0.8), 1e-12));
  CHECK(body(world, "robot::box").X_WB.p.isApprox(Vector3(1, 0, 0.5), 1e-12));
  CHECK(body(world, "robot::knob").X_WB.p.isApprox(Vector3(1, 0.2, 0.7), 1e-12));
  CHECK(body(world, "robot::crate::body").X_WB.p.isApprox(Vector3(0, 0, 0.5), 1e-12));
  const JointDescription& hinge =
      *std::ranges::find(world.joints, "robot::hinge", &JointDescription::name);
  CHECK(world.bodies.at(static_cast<std::size_t>(hinge.parent)).name == "robot::box");
  CHECK((hinge.X_WJ.R * hinge.axis_J).isApprox(Vector3::UnitY(), 1e-12));
}

TEST_CASE("A model that is included in a model is part of it, and its joints reach it") {
  const WorldDescription world = load("include_in_model.sdf");
  REQUIRE(world.models.size() == 1);
  CHECK(body(world, "cart::load::body").X_WB.p.isApprox(Vector3(0, 0, 0.6), 1e-12));
  REQUIRE(world.joints.size() == 1);
  const auto name_of = [&](int index) {
    return world.bodies.at(static_cast<std::size_t>(index)).name;
  };
  CHECK(name_of(world.joints[0].parent) == "cart::bed");
  CHECK(name_of(world.joints[0].child) == "cart::load::body");
}

TEST_CASE("Included models are placed relative to frames, to each other and by their own frames") {
  const WorldDescription world = load("include_relative_to_frame.sdf");
  CHECK(body(world, "crate::body").X_WB.p.isApprox(Vector3(0.2, 0, 1), 1e-12));
  // Its frame "grip", 0.05 m above its link, is 0.2 m above the crate.
  CHECK(body(world, "old_crate::body").X_WB.p.isApprox(Vector3(0.2, 0, 1.15), 1e-12));
}

TEST_CASE("Before SDFormat 1.7 an included model is placed relative to a 'frame'") {
  const WorldDescription world = load("include_before_1_7.sdf");
  CHECK(body(world, "second::body").X_WB.p.isApprox(Vector3(0, 0, 1.1), 1e-12));
}

TEST_CASE("A model as root makes a world with that model, and gravity as SDFormat has it") {
  const WorldDescription world = load("root_model.sdf");
  REQUIRE(world.models.size() == 1);
  CHECK(world.models[0].name == "lever");
  CHECK(world.gravity_W.isApprox(Vector3(0, 0, -9.8), 1e-12));
  CHECK(world.joints.at(0).upper == 1);
}

TEST_CASE("A URDF file makes a world with that robot: links, limits, friction, what is mounted") {
  const WorldDescription world = load("root_urdf.urdf");
  CHECK(world.models.at(0).name == "robot");
  const auto joint = [&](const std::string& name) {
    return *std::ranges::find(world.joints, "robot::" + name, &JointDescription::name);
  };
  CHECK(joint("mount").parent == -1);
  CHECK(joint("shoulder").lower == -2);
  CHECK(joint("shoulder").damping == 0.1);
  const BodyDescription& arm = body(world, "robot::arm");
  CHECK(arm.X_WB.p.isApprox(Vector3(0, 0, 0.15), 1e-12));
  CHECK(arm.collisions.at(0).X_BG.p.isApprox(Vector3(0.2, 0, 0), 1e-12));
  CHECK(arm.collisions[0].friction == 0.4);
}

TEST_CASE("Links of a URDF file without mass leave no trace, and small masses leave their links") {
  const WorldDescription world = load("urdf_small_masses.urdf");
  REQUIRE(world.bodies.size() == 2);
  const BodyDescription& base = body(world, "robot::base");
  CHECK(base.mass == 2);
  CHECK(base.X_WB.p.isApprox(Vector3(0, 0, 0.5), 1e-12));
  CHECK(base.I_B.isApprox(0.01 * Matrix3::Identity(), 1e-12));
  CHECK(body(world, "robot::needle").mass == 2e-7);
  CHECK(world.joints.size() == 1);
}

TEST_CASE("A cone has its tip along z, its middle in its pose, and its rim to half a per cent") {
  const WorldDescription world = load("cones.sdf");
  const BodyDescription& hat = body(world, "m::hat");
  const CollisionDescription& cone = hat.collisions.at(0);
  CHECK(cone.friction == 0.3);
  const auto& vertices = std::get<Hull>(cone.shape).vertices;
  Eigen::AlignedBox3d box;
  for (const Vector3& p : vertices) {
    box.extend(p);
    const bool is_tip = p.isApprox(Vector3(0, 0, 0.2));
    CHECK((is_tip || std::abs(p.head<2>().norm() - 0.2) < 1e-12));
  }
  CHECK(box.min().isApprox(Vector3(-0.2, -0.2, -0.2), 0.005));
  CHECK(box.max().isApprox(Vector3(0.2, 0.2, 0.2), 0.005));
  // 3/10 m r² about the axis, less what the corners cut off.
  CHECK(hat.I_B(2, 2) == Catch::Detail::Approx(0.3 * 0.04).epsilon(0.02));
  CHECK((hat.X_WB * cone.X_BG).p.isApprox(Vector3(0, 0, 1), 1e-12));
}

TEST_CASE("Older versions mean what they meant: an axis in the model's frame") {
  const WorldDescription world = load("version_1_5_frames.sdf");
  const JointDescription& slide = world.joints.at(0);
  CHECK((slide.X_WJ.R * slide.axis_J).isApprox(Vector3::UnitX(), 1e-9));
  CHECK(slide.lower == -0.1);
  CHECK(std::isinf(slide.upper));
}

TEST_CASE("Poses in degrees and as quaternions") {
  const WorldDescription world = load("pose_formats.sdf");
  const Quaternion quarter(Eigen::AngleAxisd(std::numbers::pi / 2, Vector3::UnitZ()));
  CHECK(body(world, "m::body").X_WB.R.angularDistance(quarter) < 1e-6);
  CHECK(body(world, "n::body").X_WB.R.angularDistance(quarter) < 1e-6);
}

TEST_CASE("Models in models in models are placed, and joints reach through them") {
  const WorldDescription world = load("nested_models.sdf");
  CHECK(body(world, "outer::middle::inner::tip").X_WB.p.isApprox(Vector3(0, 0, 0.4), 1e-12));
  CHECK(world.joints.size() == 2);
}

TEST_CASE("What <physics> says beyond step and iterations changes nothing") {
  const WorldDescription world = load("decorated.sdf");
  CHECK(world.solver.largest_step == 0.002);
  CHECK(world.solver.sweeps == 50);
}

// Where URIs lead.

/// A variable of the environment, for as long as this lives.
class Variable {
 public:
  Variable(const char* name, const std::string& value) : name_(name) {
    if (const char* before = std::getenv(name)) before_ = before;
    setenv(name, value.c_str(), 1);
  }
  ~Variable() { before_ ? setenv(name_, before_->c_str(), 1) : unsetenv(name_); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  const char* name_;
  std::optional<std::string> before_;
};

TEST_CASE("A URI is searched in the folders of the environment, beside the file and above it") {
  const fs::path crate = kFolder / "models" / "crate";
  const fs::path inner = kFolder / "models" / "cart" / "model.sdf";
  CHECK(find_resource("model://crate", inner) == crate);
  CHECK(find_resource("../crate", inner) == crate);
  CHECK(find_resource("file://" + crate.string(), "elsewhere.sdf") == crate);
  CHECK_FALSE(find_resource("model://crate", "/elsewhere.sdf"));
  CHECK_FALSE(find_resource("", inner));
  CHECK_FALSE(find_resource("https://example.org/crate", inner));
  const std::string models = (kFolder / "models").string();
  for (const char* name : {"SDF_PATH", "GZ_SIM_RESOURCE_PATH", "GAZEBO_MODEL_PATH"}) {
    const Variable variable(name, std::string("/nowhere:").append(models));
    CHECK(find_resource("model://crate", "/elsewhere.sdf") == crate);
    CHECK(find_resource("crate/model.sdf", "/elsewhere.sdf") == crate / "model.sdf");
  }
  const Variable packages("ROS_PACKAGE_PATH", models);
  CHECK(find_resource("package://crate/model.sdf", "/elsewhere.sdf") == crate / "model.sdf");
  // libsdformat makes model:// of a URDF file's package://.
  CHECK(find_resource("model://crate/model.sdf", "/elsewhere.sdf") == crate / "model.sdf");
  const Variable package("ROS_PACKAGE_PATH", "/nowhere:" + crate.string());
  CHECK(find_resource("package://crate/model.sdf", "/elsewhere.sdf") == crate / "model.sdf");
}

/// A folder that is gone afterwards, with files.
class Folder {
 public:
  Folder() : path_(fs::temp_directory_path() / ("worlds_" + std::to_string(::getpid()))) {}
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  fs::path add(const fs::path& name, const std::string& text = "text") const {
    fs::create_directories((path_ / name).parent_path());
    std::ofstream(path_ / name) << text;
    return path_ / name;
  }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

TEST_CASE("Addresses of Fuel lead to its caches, in the newest version or the one that is given") {
  const Folder folder;
  const Variable home("HOME", folder.path());
  const fs::path gz = ".gz/fuel/fuel.gazebosim.org/openrobotics/models/construction cone";
  const fs::path second = folder.add(gz / "2/model.sdf").parent_path();
  const fs::path tenth = folder.add(gz / "10/model.sdf").parent_path();
  folder.add(gz / "draft/model.sdf");
  const fs::path mesh = folder.add(gz / "10/meshes/cone.dae");
  const std::string address = "https://fuel.gazebosim.org/1.0/OpenRobotics/models/";
  CHECK(find_resource(address + "Construction%20Cone", "/w.sdf") == tenth);
  CHECK(find_resource(address + "Construction Cone/tip", "/w.sdf") == tenth);
  CHECK(find_resource(address + "Construction Cone/2", "/w.sdf") == second);
  CHECK_FALSE(find_resource(address + "Construction Cone/3", "/w.sdf"));
  CHECK(find_resource(address + "Construction Cone/tip/files/meshes/cone.dae", "/w.sdf") == mesh);
  CHECK(find_resource("https://app.gazebosim.org/OpenRobotics/fuel/models/Construction Cone",
                      "/w.sdf") == tenth);
  CHECK_FALSE(find_resource("https://fuel.gazebosim.org/1.0/Other/models/Construction Cone", "/w"));
  CHECK_FALSE(find_resource("https://example.org/1.0/OpenRobotics/models/Construction Cone", "/w"));
  for (const char* broken : {"https://", "https://fuel.gazebosim.org", "http://fuel.gazebosim.org/",
                             "https://fuel.gazebosim.org/models", "https://fuel.gazebosim.org/%",
                             "https://fuel.gazebosim.org/1.0/OpenRobotics/models/%2"}) {
    CHECK_FALSE(find_resource(broken, "/w.sdf"));
  }
  // As files of Fuel name what is beside them, which may be an older version.
  const fs::path own = folder.add(gz / "2/meshes/cone.dae");
  CHECK(find_resource("model://construction cone/meshes/cone.dae", "/w.sdf") == mesh);
  CHECK(find_resource("model://construction cone/meshes/cone.dae", second / "model.sdf") == own);

  const fs::path old =
      folder.add(".ignition/fuel/fuel.ignitionrobotics.org/openrobotics/models/chair/1/model.sdf");
  CHECK(find_resource("https://fuel.ignitionrobotics.org/1.0/OpenRobotics/models/Chair", "/w") ==
        old.parent_path());
  CHECK(find_resource(address + "Chair", "/w.sdf") == old.parent_path());
  const fs::path elsewhere = folder.add("cache/fuel.gazebosim.org/me/models/desk/7/model.sdf");
  const Variable cache("GZ_FUEL_CACHE_PATH", folder.path() / "cache");
  CHECK(find_resource("https://fuel.gazebosim.org/1.0/me/models/desk", "/w") ==
        elsewhere.parent_path());
}

TEST_CASE("Models are found where Gazebo keeps them, and packages where ROS 2 installs them") {
  const Folder folder;
  const Variable home("HOME", folder.path());
  const fs::path model = folder.add(".gazebo/models/table/model.sdf");
  CHECK(find_resource("model://table", "/w.sdf") == model.parent_path());
  CHECK_FALSE(find_resource("package://arm/hand.stl", "/w.sdf"));
  const fs::path mesh = folder.add("ros/share/arm/hand.stl");
  const Variable prefixes("AMENT_PREFIX_PATH", "/nowhere:" + (folder.path() / "ros").string());
  CHECK(find_resource("package://arm/hand.stl", "/w.sdf") == mesh);
}

TEST_CASE("What is not found is said with every place that was looked at") {
  const Folder folder;
  const Variable home("HOME", folder.path());
  const Variable path("GZ_SIM_RESOURCE_PATH", "/models/a:/models/b");
  const Variable prefixes("AMENT_PREFIX_PATH", "/opt/ros");
  const std::string own = folder.path();
  CHECK_THAT(resource_remedy("model://x/m.dae", "/worlds/w.sdf"),
             ContainsSubstring("looked for /models/a/x/m.dae, /models/b/x/m.dae, "
                               "/worlds/x/m.dae and in all folders above, ") &&
                 ContainsSubstring(own + "/.gazebo/models/x/m.dae, ") &&
                 ContainsSubstring(own + "/.gz/fuel/*/*/models/x/*, ") &&
                 ContainsSubstring(own + "/.ignition/fuel/*/*/models/x/*, ") &&
                 ContainsSubstring("/opt/ros/share/x/m.dae; not set: SDF_PATH, "));
  CHECK_THAT(resource_remedy("https://fuel.gazebosim.org/1.0/me/models/desk/3", "/w.sdf"),
             ContainsSubstring("looked for " + own + "/.gz/fuel/*/me/models/desk/3, "));
  CHECK_THAT(resource_remedy("m.dae", "/worlds/w.sdf"),
             ContainsSubstring("looked for /worlds/m.dae, /models/a/m.dae, /models/b/m.dae"));
}

// Large worlds.

/// Of this process, kB: "VmRSS" now, "VmHWM" the most since the latest reset.
[[maybe_unused]] long memory(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    long value = 0;
    if (word == key + ":" && status >> value) return value;
  }
  return -1;
}

[[maybe_unused]] std::string many_models(int count) {
  std::ostringstream models;
  for (int i = 0; i < count; ++i) {
    models << test::model(std::to_string(i), std::to_string(i) + " 0 0 0 0 0",
                          test::box("1 1 1") +
                              "<visual name='v'><geometry><box><size>1 1 1</size></box></geometry>"
                              "</visual><sensor name='s' type='contact'/>");
  }
  return models.str();
}

#ifndef __SANITIZE_ADDRESS__  // With it memory is not given back at once.

TEST_CASE("A thousand models take at most 200 MB while they load, and leave at most 20 MB") {
  const std::string models = many_models(1000);
  test::world_of("");  // What is made once and kept.
  malloc_trim(0);
  const long before = memory("VmRSS");
  std::ofstream("/proc/self/clear_refs") << "5";  // The most is counted from now on.
  const WorldDescription world = test::world_of(models);
  CHECK(world.bodies.size() == 1000);
  CHECK(memory("VmHWM") - before < 200'000);
  CHECK(memory("VmRSS") - before < 20'000);
}

TEST_CASE("Where poses depend on each other all models are read together, and leave as little") {
  const std::string models =
      "<frame name='shelf'><pose>0 0 1 0 0 0</pose></frame>" + many_models(300);
  test::world_of("");
  malloc_trim(0);
  const long before = memory("VmRSS");
  std::ofstream("/proc/self/clear_refs") << "5";
  const WorldDescription world = test::world_of(models);
  CHECK(world.bodies.size() == 300);
  CHECK(memory("VmHWM") - before > 30'000);  // Enough to show whether it is given back.
  CHECK(memory("VmRSS") - before < 20'000);
}

#endif

// The table of elements.

/// Elements of the installed format that no rule covers.
void find_uncovered(const sdf::ElementPtr& description, const std::string& path,
                    std::vector<std::string>& uncovered) {
  for (unsigned i = 0; i < description->GetElementDescriptionCount(); ++i) {
    const sdf::ElementPtr child = description->GetElementDescription(i);
    const std::string own = path + "/" + child->GetName();
    const ElementRule* rule = find_rule(own);
    const bool nested = child->GetName() == "model";
    if (!is_used(own) && rule == nullptr) uncovered.push_back(own);
    if (is_used(own) && !nested) find_uncovered(child, own, uncovered);
  }
}

TEST_CASE("Every element of SDFormat is used, or a rule says what becomes of it") {
  const auto format = std::make_shared<sdf::SDF>();
  sdf::init(format);
  std::vector<std::string> uncovered;
  for (const std::string top : {"world", "model"}) {
    find_uncovered(format->Root()->GetElementDescription(top), top, uncovered);
  }
  CHECK(uncovered == std::vector<std::string>{});
}

TEST_CASE("docs/worlds.md has the table of elements") {
  std::vector<std::string> rows;
  std::ifstream document(HLM_DOCS "/worlds.md");
  for (std::string line; std::getline(document, line);) {
    if (line.starts_with("| `world/") || line.starts_with("| `model/")) rows.push_back(line);
  }
  const auto verdict = [](const ElementRule& rule) -> std::string {
    if (!rule.verdict) return "used";
    if (*rule.verdict == Verdict::kRefused) return "refused";
    return *rule.verdict == Verdict::kIgnored ? "ignored" : "approximated";
  };
  std::vector<std::string> due;
  for (const ElementRule& rule : element_rules()) {
    due.push_back("| `" + std::string(rule.path) + "` | " + verdict(rule) + " | " +
                  std::string(rule.note) + " |");
  }
  CHECK(rows == due);
}

}  // namespace
}  // namespace hlm::ve
