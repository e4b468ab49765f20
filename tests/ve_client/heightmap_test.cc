// Heightmaps: where their heights are, what is felt of them, and which cannot be used.
#include "hlm/ve_client/scene/heightmap.h"

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <unistd.h>

#include "hlm/ve_client/scene/sdf_loader.h"
#include "hlm/ve_client/world/proximity.h"
#include "tests/support/catch.h"
#include "tests/support/png.h"
#include "tests/support/random.h"
#include "tests/support/worlds.h"

namespace hlm::ve::test {
namespace {

using Catch::Matchers::ContainsSubstring;
using hlm::test::Random;
using hlm::test::write_png;
namespace fs = std::filesystem;
using Bytes = std::vector<std::uint8_t>;
using Words = std::vector<std::uint16_t>;

/// A folder of a test's own.
class Folder {
 public:
  Folder() : path_(fs::temp_directory_path() / ("haptic_heightmap_" + std::to_string(getpid()))) {
    fs::create_directories(path_);
  }
  ~Folder() { fs::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  fs::path operator/(const std::string& name) const { return path_ / name; }

 private:
  fs::path path_;
};

}  // namespace

TEST_CASE("The heights of a map are where Gazebo has them") {
  const Folder folder;
  const fs::path file = folder / "map.png";
  const auto check_heights = [&](const std::vector<double>& heights) {
    const Mesh mesh = read_heightmap(file, {2, 1, 0.5});
    REQUIRE(mesh.points.size() == 6);
    for (std::size_t i = 0; i < 6;
         ++i) {  // Three in the row of +y, from -x to x, then three below.
      const Vector3 expected(static_cast<double>(i % 3) - 1, i < 3 ? 0.5 : -0.5, heights[i]);
      CHECK((mesh.points[i] - expected).norm() < 1e-6);  // m
    }
    REQUIRE(mesh.triangles.size() == 4);
    for (std::size_t t = 0; t < 4; ++t) {
      CHECK(mesh.area(t).z() == Approx(1));  // m², twice half a cell: seen from above.
    }
    CHECK(mesh.around[1].size() == 3);
  };
  // 0.5 m over black is the brightest pixel, whether it is white or not.
  const std::vector<double> heights{0, 0.5, 0.1, 0.2, 0, 0.4};
  write_png(file, 3, 2, Bytes{0, 255, 51, 102, 0, 204});
  check_heights(heights);
  write_png(file, 3, 2, Bytes{0, 50, 10, 20, 0, 40});
  check_heights(heights);
  write_png(file, 3, 2, Words{0, 65535, 13107, 26214, 0, 52428});
  check_heights(heights);
  write_png(file, 3, 2, Words{0, 500, 100, 200, 0, 400});
  check_heights(heights);
  write_png(file, 3, 2, Bytes{0, 0, 0, 50, 50, 50, 10, 10, 10, 20, 20, 20, 0, 0, 0, 40, 40, 40},
            PNG_FORMAT_RGB);
  check_heights(heights);
  write_png(file, 3, 2, Bytes(6, 0));
  check_heights(std::vector<double>(6, 0));
  write_png(file, 3, 2, Bytes(6, 7));
  check_heights(std::vector<double>(6, 0.5));
}

TEST_CASE("A ball over a sloping heightmap is as far from it as from a plane") {
  const Folder folder;
  Words slope;  // Up by a tenth from left to right, by a fifth from row to row.
  for (unsigned row = 0; row < 4; ++row) {
    for (unsigned column = 0; column < 5; ++column) {
      slope.push_back(static_cast<std::uint16_t>(6000 * (2 * (3 - row) + column)));
    }
  }
  write_png(folder / "slope.png", 5, 4, slope);
  const WorldDescription description = hlm::test::world_of(
      hlm::test::model("ball", "0 0 1 0 0 0",
                       "<collision name='c'><geometry><sphere><radius>0.01</radius></sphere>"
                       "</geometry></collision>") +
      hlm::test::fixed_model("map", "0.1 0.2 0.3 0 0 0",
                             "<collision name='c'><geometry><heightmap><uri>" +
                                 (folder / "slope.png").string() +
                                 "</uri><size>0.4 0.3 0.1</size><pos>0.01 0.02 0.03</pos>"
                                 "</heightmap></geometry></collision>"));
  CHECK(description.bodies.at(1).collisions.size() == 24);
  const Vector3 n = Vector3(-0.1, -0.2, 1).normalized();
  const Vector3 corner(0.11 - 0.2, 0.22 - 0.15, 0.33);  // Where row 3 begins.
  Random random;
  for (int i = 0; i < 50; ++i) {
    const double x = random.uniform(0.02, 0.38);
    const double y = random.uniform(0.02, 0.28);
    const double separation = random.uniform(-0.001, 0.004);
    const Vector3 on_plane = corner + Vector3(x, y, 0.1 * x + 0.2 * y);
    const WorldDescription there =
        with_model_at(description, "ball", {on_plane + (0.01 + separation) * n, {1, 0, 0, 0}});
    const ToolAssembly assembly = assemble_tool(there, "ball");
    World world(there, assembly.bodies);
    const VirtualTool tool(world, assembly, {.mode = FollowMode::kKinematic});
    Proximity proximity(world, assembly);
    const auto contacts = proximity.query(tool, 0.005);
    REQUIRE_FALSE(contacts.empty());
    const auto nearest = std::ranges::min_element(contacts, {}, &FoundContact::separation);
    CHECK(nearest->separation == Approx(separation).margin(2e-6));  // m
    CHECK((nearest->n_W - n).norm() < 1e-4);                        // rad
  }
}

TEST_CASE("A heightmap that cannot be used is left out or refused, with its place") {
  const Folder folder;
  const auto load = [&](const std::string& map, bool fixed = true) {
    std::ofstream(folder / "w.sdf")
        << "<sdf version='1.9'><world name='w'><model name='m'><static>"
        << (fixed ? "true" : "false") << "</static><link name='l'>\n"
        << "<collision name='c'><geometry>\n<heightmap>" << map
        << "</heightmap></geometry></collision></link></model></world></sdf>";
    Diagnostics diagnostics;
    WorldDescription world = load_world(folder / "w.sdf", diagnostics);
    return std::pair(std::move(world), std::move(diagnostics));
  };
  const auto found = [&](Verdict verdict, const std::string& map, const std::string& why,
                         bool fixed) {
    CAPTURE(map);
    const auto [world, diagnostics] = load(map, fixed);
    const auto& findings = diagnostics.findings();
    const auto finding = std::ranges::find(findings, verdict, &Finding::verdict);
    REQUIRE(finding != findings.end());
    CHECK_THAT(
        to_string(*finding),
        ContainsSubstring("w.sdf:3: model 'm' link 'l' collision 'c': ") && ContainsSubstring(why));
    CHECK(diagnostics.usable() == (verdict != Verdict::kRefused));
  };
  const auto refused = [&](const std::string& map, const std::string& why) {
    found(Verdict::kRefused, map, why, true);
  };
  const auto left_out = [&](const std::string& map, const std::string& why, bool fixed = true) {
    found(Verdict::kApproximated, map, why, fixed);
  };
  const auto sized = [](const std::string& size) {
    return "<uri>good.png</uri><size>" + size + "</size>";
  };
  write_png(folder / "good.png", 3, 2, Bytes{0, 255, 51, 102, 0, 204});
  const auto [map, said] =
      load(sized("1 1 1") + "<sampling>2</sampling><texture><size>10</size></texture>", true);
  CHECK(map.bodies.at(0).collisions.size() == 4);
  left_out(sized("1 1 1"), "a heightmap cannot move: put it into a model with <static>true", false);
  left_out(sized("1 1 0"), "size z 0 m must be 1e-06 to 1000 m");
  refused(sized("1 -1 1"), "size y -1 m must be 0.001 to 1000 m");
  refused(sized("1 1 nan"), "<heightmap> <size> '1 1 nan' must be 3 numbers");
  left_out(sized("1e-9 1 1"), "size x 1e-09 m must be 0.001 to 1000 m");
  refused("<uri>none.png</uri>", "heightmap 'none.png' is not found; give a path");
  refused("<uri>.</uri>", "heightmap '.' is not a file (");
  refused("", "<uri> is not given");

  std::ofstream(folder / "text.png") << "no image at all\n";
  left_out("<uri>text.png</uri>", "text.png: is not a PNG file");
  std::ofstream(folder / "empty.png").flush();
  left_out("<uri>empty.png</uri>", "empty.png: is not a PNG file");
  write_png(folder / "big.png", 129, 129, Words(129 * 129, 1));
  fs::resize_file(folder / "big.png", fs::file_size(folder / "big.png") / 2);
  found(Verdict::kApproximated, "<uri>big.png</uri>", "big.png: ", true);
  fs::resize_file(folder / "big.png", 12);
  found(Verdict::kApproximated, "<uri>big.png</uri>", "big.png: ", true);
  write_png(folder / "red.png", 2, 2, Bytes{9, 9, 9, 9, 9, 9, 9, 9, 9, 10, 9, 9}, PNG_FORMAT_RGB);
  left_out("<uri>red.png</uri>", "red.png: has colours; allowed are shades of grey");
  write_png(folder / "dot.png", 1, 1, Bytes{9});
  left_out("<uri>dot.png</uri>", "dot.png: width 1 pixels must be 2 to 129 pixels");
  write_png(folder / "long.png", 2, 10000, Bytes(20000, 9));
  left_out("<uri>long.png</uri>", "long.png: height 10000 pixels must be 2 to 129 pixels");
}

}  // namespace hlm::ve::test
