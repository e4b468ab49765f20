// Meshes that bend, and heightmaps, felt by the hand: server and client together, in virtual time.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include <unistd.h>

#include "tests/support/catch.h"
#include "tests/support/png.h"
#include "tests/support/virtual_session.h"

namespace hlm::test {
namespace {

constexpr double kRadius = 0.01;  // m, of the ball.
constexpr double kHalf = 0.015;   // m, of the cube.
constexpr double kPush = 3;       // N.
constexpr double kWay = 0.05;     // m: the hand leads the tool from -kWay to kWay along x.

/// Height of a surface over x and y, m.
using Height = std::function<double(double, double)>;

double dome(double x, double y) { return std::sqrt(0.01 - x * x - y * y) - 0.1; }
double bowl(double x, double y) { return -dome(x, y); }
double hills(double x, double y) { return 0.004 * std::sin(x / 0.0095) * std::cos(y / 0.0095); }

/// How a ground is described.
enum class GroundKind { kMesh, kHeightmap };

/// A square of triangles whose corners are on a surface, in a file of its own.
class Ground {
 public:
  Ground(Height height, double cell, GroundKind kind = GroundKind::kMesh)
      : height_(std::move(height)),
        cell_(cell),
        count_(static_cast<int>(0.14 / cell)),
        file_(std::filesystem::temp_directory_path() /
              ("haptic_ground_" + std::to_string(getpid()) +
               (kind == GroundKind::kMesh ? ".obj" : ".png"))) {
    kind == GroundKind::kMesh ? write_mesh() : write_heightmap();
  }
  ~Ground() { std::filesystem::remove(file_); }
  Ground(const Ground&) = delete;
  Ground& operator=(const Ground&) = delete;

  std::string model() const {
    return fixed_model(
        "ground", "0 0 0 0 0 0",
        "<collision name='ground'><geometry>" + geometry_ + "</geometry></collision>");
  }
  double height(double x, double y) const { return height_(x, y); }

  /// Of a point over the nearest triangle, m; negative below it.
  double distance(const Vector3& p) const {
    double nearest = std::numeric_limits<double>::infinity();
    const int at_x = static_cast<int>(std::floor(p.x() / cell_)) + count_ / 2;
    const int at_y = static_cast<int>(std::floor(p.y() / cell_)) + count_ / 2;
    constexpr int kAround = 3;  // Cells: farther ones are beyond the ball.
    for (int i = std::max(0, at_x - kAround); i < std::min(count_, at_x + kAround); ++i) {
      for (int j = std::max(0, at_y - kAround); j < std::min(count_, at_y + kAround); ++j) {
        const Vector3 a = corner(i, j);
        const Vector3 c = corner(i + 1, j + 1);
        for (const double d :
             {distance(p, a, corner(i + 1, j), c), distance(p, a, c, corner(i, j + 1))}) {
          if (std::abs(d) < std::abs(nearest)) nearest = d;
        }
      }
    }
    return nearest;
  }

 private:
  void write_mesh() {
    std::ofstream obj(file_);
    obj.precision(12);
    for (int i = 0; i <= count_; ++i) {
      for (int j = 0; j <= count_; ++j) obj << "v " << corner(i, j).transpose() << '\n';
    }
    const auto number = [&](int i, int j) { return (count_ + 1) * i + j + 1; };  // From 1.
    for (int i = 0; i < count_; ++i) {
      for (int j = 0; j < count_; ++j) {
        const int a = number(i, j);
        const int c = number(i + 1, j + 1);
        obj << "f " << a << ' ' << number(i + 1, j) << ' ' << c << '\n';
        obj << "f " << a << ' ' << c << ' ' << number(i, j + 1) << '\n';
      }
    }
    geometry_ = "<mesh><uri>" + file_.string() + "</uri></mesh>";
  }
  /// Of an even number of cells along a side: the middle of the image is the origin.
  void write_heightmap() {
    constexpr double kWhite = 65535;
    constexpr double kLow = -0.06;  // m
    constexpr double kSpan = 0.12;  // m
    std::vector<std::uint16_t> pixels;
    for (int j = count_; j >= 0; --j) {
      for (int i = 0; i <= count_; ++i) {
        pixels.push_back(
            static_cast<std::uint16_t>(std::lround((corner(i, j).z() - kLow) / kSpan * kWhite)));
      }
    }
    const auto side = static_cast<unsigned>(count_ + 1);
    write_png(file_, side, side, pixels);
    const double brightest = *std::ranges::max_element(pixels);
    std::ostringstream map;
    map.precision(12);
    map << "<heightmap><uri>" << file_.string() << "</uri><size>" << cell_ * count_ << ' '
        << cell_ * count_ << ' ' << kSpan * brightest / kWhite << "</size><pos>0 0 " << kLow
        << "</pos></heightmap>";
    geometry_ = map.str();
  }
  Vector3 corner(int i, int j) const {
    const double x = cell_ * (i - count_ / 2);
    const double y = cell_ * (j - count_ / 2);
    return {x, y, height_(x, y)};
  }
  static double distance(const Vector3& p, const Vector3& a, const Vector3& b, const Vector3& c) {
    const Vector3 n = (b - a).cross(c - a).normalized();
    const auto beside = [&](const Vector3& from, const Vector3& to) {
      return (to - from).cross(p - from).dot(n) >= 0;
    };
    if (beside(a, b) && beside(b, c) && beside(c, a)) return n.dot(p - a);
    const auto to_edge = [&](const Vector3& from, const Vector3& to) {
      const double share = (p - from).dot(to - from) / (to - from).squaredNorm();
      return (p - from - std::clamp(share, 0.0, 1.0) * (to - from)).norm();
    };
    return std::min({to_edge(a, b), to_edge(b, c), to_edge(c, a)});
  }

  Height height_;
  double cell_;  // m
  int count_;    // Cells along a side.
  std::filesystem::path file_;
  std::string geometry_;  // SDF
};

/// What the hand felt while it pressed a tool down and led it over the ground.
struct Slide {
  double deepest = 1;  ///< Separation of the proxy, m.
  double ghost = -1;   ///< Largest separation at which more than 0.2 N was felt, m.
  double largest = 0;  ///< Force, N.
  double rise = 0;     ///< Largest rise of the force in a tick, N.
  double aslant = 0;   ///< Largest part of it across the normal of a plane, N.
  double end = 0;      ///< Of the proxy along x, m.
};

/// separation: of the tool from the ground in a pose, m. `start`: on the ground, m.
/// `n`: of the ground, if that is a plane.
Slide slide(const Ground& ground, const std::string& shape, const Vector3& start, double delay,
            const std::function<double(const Pose&)>& separation,
            const Vector3& n = Vector3::UnitZ()) {
  const Vector3 p = start + Vector3(0, 0, 0.002);
  const std::string pose =
      std::to_string(p.x()) + " " + std::to_string(p.y()) + " " + std::to_string(p.z()) + " 0 0 0";
  VirtualSessionOptions options;
  options.world =
      world_of(model("tool", pose,
                     "<collision name='shape'><geometry>" + shape + "</geometry></collision>") +
               ground.model());
  options.tool = "tool";
  options.link.delay = delay;
  options.device.freedom = server::DeviceFreedom::kSpatial;
  options.device.dry_friction = 0;
  options.servo.local_model.static_friction = options.servo.local_model.kinetic_friction = 0;
  const server::Grip grip;
  const Vector3 down(0, 0, -0.002 - kPush / grip.stiffness);
  constexpr double kSettling = 2;  // s
  options.hand = {{{kSettling, server::Reach{down, {}, true, grip}},
                   {3, server::Reach{down + Vector3(2 * kWay, 0, 0), {}, true, grip}}},
                  server::AfterLastSegment::kHold};
  Slide felt;
  double before = kPush;
  VirtualSession session(options, [&](const server::TickRecord& record) {
    if (record.time < kSettling) return;
    const double force = record.F_env.head<3>().norm();
    felt.aslant = std::max(felt.aslant, record.F_env.head<3>().cross(n).norm());
    const double s = separation(record.X_WP);
    felt.deepest = std::min(felt.deepest, s);
    if (force > 0.2) felt.ghost = std::max(felt.ghost, s);
    felt.largest = std::max(felt.largest, force);
    felt.rise = std::max(felt.rise, force - before);
    before = force;
  });
  session.run(6);
  CHECK(session.last().fault == Fault::kNone);
  felt.end = session.last().X_WP.p.x();
  UNSCOPED_INFO("delay " << 1e3 * delay << " ms: deepest " << 1e3 * felt.deepest
                         << " mm, felt up to " << 1e3 * felt.ghost << " mm above, force up to "
                         << felt.largest << " N, rises by " << felt.rise << " N a tick, ends at "
                         << 1e3 * felt.end << " mm");
  return felt;
}

constexpr double kBeside = 0.0013;  // m: y of the way.

Slide slide_ball(const Ground& ground, double delay, const Vector3& n = Vector3::UnitZ()) {
  Vector3 start(-kWay, kBeside, -1);
  for (double x = -kRadius; x <= kRadius; x += kRadius / 10) {  // Where it touches, or above.
    start.z() = std::max(
        start.z(), ground.height(start.x() + x, kBeside) + std::sqrt(kRadius * kRadius - x * x));
  }
  return slide(
      ground, "<sphere><radius>0.01</radius></sphere>", start, delay,
      [&](const Pose& X_WP) { return ground.distance(X_WP.p) - kRadius; }, n);
}

/// The separation is that of its corners alone.
Slide slide_cube(const Ground& ground, double delay) {
  Vector3 start(-kWay, kBeside, -1);
  for (double x = -kHalf; x <= kHalf; x += kHalf / 10) {
    for (double y = -kHalf; y <= kHalf; y += kHalf / 10) {
      start.z() = std::max(start.z(), ground.height(start.x() + x, kBeside + y) + kHalf);
    }
  }
  return slide(ground, "<box><size>0.03 0.03 0.03</size></box>", start, delay,
               [&](const Pose& X_WP) {
                 double lowest = 1;
                 for (int i = 0; i < 8; ++i) {
                   const Vector3 p = X_WP * Vector3(i & 1 ? kHalf : -kHalf, i & 2 ? kHalf : -kHalf,
                                                    i & 4 ? kHalf : -kHalf);
                   lowest = std::min(lowest, p.z() - ground.height(p.x(), p.y()));
                 }
                 return lowest;
               });
}

TEST_CASE("A ball slides over a dome of triangles at f/k, and at its edges the force only turns") {
  for (const GroundKind kind : {GroundKind::kMesh, GroundKind::kHeightmap}) {
    const Ground ground(dome, 0.01, kind);
    for (const double delay : {0.0, 0.02}) {
      const Slide felt = slide_ball(ground, delay);
      CHECK(felt.deepest > -felt.largest / 4000 - 1e-4);  // m
      CHECK(felt.ghost < 1e-4);                           // m
      CHECK(felt.rise < 0.2);                             // N
      CHECK(felt.end == Approx(kWay).margin(0.01));
    }
  }
}

TEST_CASE("A ball slides over the level and sloping cells of a heightmap as over one plane") {
  for (const double rise : {0.0, 0.2}) {
    const Ground ground([rise](double x, double y) { return rise * (x + 0.5 * y); }, 0.01,
                        GroundKind::kHeightmap);
    const Vector3 n = Vector3(-rise, -0.5 * rise, 1).normalized();
    const Slide felt = slide_ball(ground, 0, n);
    CHECK(felt.aslant < 0.05);                                         // N
    CHECK(felt.deepest == Approx(-felt.largest / 4000).margin(1e-4));  // m
    CHECK(felt.ghost < 1e-4);                                          // m
  }
}

TEST_CASE("A ball sinks into a bowl or hills of triangles by f/k, and feels them where they are") {
  for (const double delay : {0.0, 0.02}) {
    for (const auto& [height, cell] : {std::pair<Height, double>{bowl, 0.01}, {hills, 0.0058}}) {
      const Ground ground(height, cell);
      const Slide felt = slide_ball(ground, delay);
      CHECK(felt.deepest > -1e-3);  // m: f/k is 0.75 mm.
      CHECK(felt.ghost < 5e-4);     // m
      CHECK(felt.end == Approx(kWay).margin(0.01));
    }
  }
}

TEST_CASE("A cube does not sink into a dome, a bowl or hills of triangles") {
  for (const double delay : {0.0, 0.02}) {
    for (const auto& [height, cell] :
         {std::pair<Height, double>{dome, 0.01}, {bowl, 0.01}, {hills, 0.0058}}) {
      const Ground ground(height, cell);
      CHECK(slide_cube(ground, delay).deepest > -1e-3);  // m
    }
  }
}

}  // namespace
}  // namespace hlm::test
