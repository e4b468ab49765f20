// Convex parts that take long: what is said meanwhile, how they are given up, and what is kept.
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numbers>

#include <unistd.h>

#include "hlm/ve_client/scene/convex_decomposition.h"
#include "hlm/ve_client/scene/kept_pieces.h"
#include "tests/support/catch.h"

namespace hlm::ve {
namespace {

using Catch::Matchers::ContainsSubstring;
using std::numbers::pi;
namespace fs = std::filesystem;

/// A ring of `around` x `across` quadrilaterals.
Mesh ring(int around, int across) {
  Mesh mesh;
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < across; ++j) {
      const double u = 2 * pi * i / around;
      const double v = 2 * pi * j / across;
      const double r = 0.1 + 0.03 * std::cos(v);
      mesh.points.emplace_back(r * std::cos(u), r * std::sin(u), 0.03 * std::sin(v));
      const int a = i * across + j;
      const int b = (i + 1) % around * across + j;
      const int c = (i + 1) % around * across + (j + 1) % across;
      const int d = i * across + (j + 1) % across;
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({a, c, d});
    }
  }
  std::vector<std::string> repairs;
  return repaired(std::move(mesh), "ring", repairs);
}

/// A cache directory that is empty, and gone afterwards.
class Cache {
 public:
  Cache() : folder_(fs::temp_directory_path() / ("cache_" + std::to_string(::getpid()))) {
    if (const char* before = std::getenv("XDG_CACHE_HOME")) before_ = before;
    setenv("XDG_CACHE_HOME", folder_.c_str(), 1);
  }
  ~Cache() {
    before_.empty() ? unsetenv("XDG_CACHE_HOME") : setenv("XDG_CACHE_HOME", before_.c_str(), 1);
    fs::remove_all(folder_);
  }
  Cache(const Cache&) = delete;
  Cache& operator=(const Cache&) = delete;

  fs::path folder() const { return folder_ / "haptic_local_model"; }
  std::vector<fs::path> files() const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(folder())) files.push_back(entry.path());
    return files;
  }

 private:
  fs::path folder_;
  std::string before_;
};

std::vector<Vector3> corners(const std::vector<Hull>& hulls) {
  std::vector<Vector3> all;
  for (const Hull& hull : hulls) all.insert(all.end(), hull.vertices.begin(), hull.vertices.end());
  return all;
}

std::string text_in(const fs::path& file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST_CASE("What is made of a mesh is kept to the last bit, and nothing is said the second time") {
  const Cache cache;
  const Mesh mesh = ring(20, 8);
  std::vector<std::string> said;
  const Progress progress{.say = [&](const std::string& line) { said.push_back(line); },
                          .stopped = {}};
  const std::vector<Hull> made = decomposed(mesh, "mesh ring.obj", progress);
  REQUIRE(said.size() == 1);
  CHECK_THAT(said[0], ContainsSubstring("mesh ring.obj: ") && ContainsSubstring("320 triangles"));
  REQUIRE(cache.files().size() == 1);  // And nothing half written.
  CHECK(corners(decomposed(mesh, "mesh ring.obj", progress)) == corners(made));
  CHECK(said.size() == 1);
  // Another mesh is another file.
  decomposed(ring(20, 9), "other", progress);
  CHECK(said.size() == 2);
  CHECK(cache.files().size() == 2);
}

TEST_CASE("A kept file that is damaged anywhere is not used, and made again") {
  const Cache cache;
  const Mesh mesh = ring(12, 6);
  const std::vector<Vector3> made = corners(decomposed(mesh));
  const fs::path file = cache.files().at(0);
  const std::string whole = text_in(file);
  std::vector<std::string> damaged{"",
                                   "\n",
                                   "0\n",
                                   whole.substr(0, whole.size() / 2),
                                   whole.substr(0, whole.size() - 2),
                                   whole + "1\n",
                                   std::string(whole.size(), '\0')};
  for (std::size_t i = 0; i < whole.size(); i += 97) {
    damaged.push_back(whole);
    damaged.back()[i] = damaged.back()[i] == '1' ? '2' : '1';
  }
  for (const std::string& text : damaged) {
    std::ofstream(file) << text;
    CHECK_FALSE(read_kept(file));
  }
  CHECK(corners(decomposed(mesh)) == made);
  CHECK(text_in(file) == whole);
  fs::remove(file);
  fs::create_directory(file);
  CHECK(corners(decomposed(mesh)) == made);
}

TEST_CASE("Of what is kept the longest unused goes first, and what was left half written") {
  const Cache cache;
  const std::vector<Hull> hulls{{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}};
  const auto age = [](const fs::path& file, int hours) {
    fs::last_write_time(file, fs::file_time_type::clock::now() - std::chrono::hours(hours));
  };
  std::vector<fs::path> files;
  for (int i = 0; i < 5; ++i) {
    files.push_back(cache.folder() / (std::to_string(i) + ".hulls"));
    keep(files.back(), hulls);
    age(files.back(), 10 + i);
  }
  const fs::path half = cache.folder() / "x.hulls.1234";
  const fs::path writing = cache.folder() / "y.hulls.1235";
  const fs::path foreign = cache.folder() / "notes.txt";
  for (const fs::path& file : {half, writing, foreign}) std::ofstream(file) << "1";
  for (const fs::path& file : {half, foreign}) age(file, 2);
  CHECK(read_kept(files[4]));  // The oldest was used just now.
  files.push_back(cache.folder() / "new.hulls");
  keep(files.back(), hulls, 3 * fs::file_size(files[0]));
  for (const std::size_t kept : {0u, 4u, 5u}) CHECK(fs::exists(files[kept]));
  for (const std::size_t gone : {1u, 2u, 3u}) CHECK_FALSE(fs::exists(files[gone]));
  CHECK_FALSE(fs::exists(half));
  CHECK(fs::exists(writing));
  CHECK(fs::exists(foreign));
}

TEST_CASE("Without a place to keep them parts are made all the same") {
  const Cache cache;
  setenv("XDG_CACHE_HOME", "/dev/null", 1);
  CHECK_FALSE(decomposed(ring(12, 6)).empty());
}

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

TEST_CASE("A long decomposition is heard of each second, and not more often") {
  const Cache cache;
  std::vector<std::string> said;
  const Clock::time_point begin = Clock::now();
  decomposed(ring(100, 16), "mesh ring.obj",
             {.say = [&](const std::string& line) { said.push_back(line); }, .stopped = {}});
  const double duration = seconds_since(begin);
  CAPTURE(duration, said);
  CHECK(static_cast<double>(said.size()) <= 1 + duration);
  CHECK(static_cast<double>(said.size()) >= 0.5 * duration - 1);
  for (std::size_t i = 1; i < said.size(); ++i) {
    CHECK_THAT(said[i],
               ContainsSubstring("mesh ring.obj: ") && ContainsSubstring(" of 3200 triangles "));
  }
}

TEST_CASE("A decomposition that nobody waits for any more ends, and leaves nothing") {
  const Cache cache;
  const Clock::time_point begin = Clock::now();
  const Progress progress{.say = {}, .stopped = [&] { return seconds_since(begin) > 0.2; }};
  CHECK_THROWS_WITH(decomposed(ring(125, 20), "mesh ring.obj", progress),
                    ContainsSubstring("stopped"));
  CHECK(seconds_since(begin) < 2);  // Some ms; with sanitizers on a busy machine a second.
  CHECK_FALSE(fs::exists(cache.folder()));
  CHECK_THROWS_WITH(decomposed(ring(12, 6), "next", progress), ContainsSubstring("stopped"));
}

}  // namespace
}  // namespace hlm::ve
