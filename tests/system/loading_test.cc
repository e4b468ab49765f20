// The client while it loads a world that takes long.
#include <cmath>
#include <csignal>
#include <fstream>
#include <numbers>

#include "tests/support/catch.h"
#include "tests/system/process.h"

namespace hlm::test {
namespace {

/// A ring of 5000 triangles that moves: convex parts of it take seconds.
void write_world(const TemporaryDirectory& directory) {
  constexpr int kAround = 125;
  constexpr int kAcross = 20;
  std::ofstream mesh(directory.file("ring.obj"));
  const auto at = [](int i, int j) { return i % kAround * kAcross + j % kAcross + 1; };
  for (int i = 0; i < kAround; ++i) {
    for (int j = 0; j < kAcross; ++j) {
      const double u = 2 * std::numbers::pi * i / kAround;
      const double v = 2 * std::numbers::pi * j / kAcross;
      const double r = 0.1 + 0.03 * std::cos(v);
      mesh << "v " << r * std::cos(u) << " " << r * std::sin(u) << " " << 0.03 * std::sin(v)
           << "\nf " << at(i, j) << " " << at(i + 1, j) << " " << at(i + 1, j + 1) << " "
           << at(i, j + 1) << "\n";
    }
  }
  std::ofstream(directory.file("ring.sdf"))
      << "<sdf version='1.9'><model name='ring'><link name='l'><collision name='c'><geometry><mesh>"
         "<uri>ring.obj</uri></mesh></geometry></collision></link></model></sdf>";
}

TEST_CASE("A signal ends the client at once while it makes convex parts") {
  const TemporaryDirectory directory;
  write_world(directory);
  const std::string world = directory.file("ring.sdf");
  const std::vector<std::string> options =
      GENERATE(std::vector<std::string>{"--check"}, std::vector<std::string>{"--tool", "ring"});
  std::vector<std::string> arguments{"env", "XDG_CACHE_HOME=" + directory.file(""), HLM_CLIENT,
                                     "--world", world};
  arguments.insert(arguments.end(), options.begin(), options.end());
  Process client(arguments);
  REQUIRE(client.wait_for_error("ring.obj: convex parts are made of its 5000 triangles", 10));
  client.send_signal(SIGINT);
  CHECK(client.wait(0.5) == 128 + SIGINT);
}

}  // namespace
}  // namespace hlm::test
