#include "hlm/ve_client/scene/convex_decomposition.h"

#include <chrono>
#include <filesystem>
#include <stdexcept>

#include <bullet/HACD/hacdHACD.h>

#include "hlm/geometry/hull.h"
#include "hlm/geometry/mesh_pieces.h"
#include "hlm/ve_client/scene/kept_pieces.h"

namespace hlm::ve {
namespace {

/// How far a piece may bridge a hollow, in thousandths of the mesh's size. A tenth of it gives half
/// as many pieces again on a cup and nine times as many on rolling ground.
constexpr double kConcavity = 10;
/// Weight of compact pieces against few.
constexpr double kCompactness = 0.1;
/// More triangles take minutes.
constexpr std::size_t kMostToDecompose = 20000;

using Clock = std::chrono::steady_clock;
constexpr std::chrono::seconds kBetweenLines{1};

/// Tells how far one decomposition is. The library calls a plain function.
class Report {
 public:
  Report(const std::string& name, std::size_t triangles, const Progress& progress)
      : name_(name), triangles_(triangles), progress_(progress) {
    current_ = this;
  }
  ~Report() { current_ = nullptr; }
  Report(const Report&) = delete;
  Report& operator=(const Report&) = delete;

  /// `clusters` are left. Throws if it is to stop.
  static bool hear(const char*, double, double, std::size_t clusters) {
    if (current_ != nullptr) current_->tell(clusters);
    return true;
  }

  void say(const std::string& what) const {
    if (progress_.say) progress_.say(name_ + ": " + what);
  }

  void end_if_stopped() const {
    if (progress_.stopped && progress_.stopped()) throw std::runtime_error("stopped");
  }

 private:
  void tell(std::size_t clusters) {
    end_if_stopped();
    const Clock::time_point now = Clock::now();
    if (now < next_ || clusters > triangles_) return;
    next_ = now + kBetweenLines;
    say(std::to_string(triangles_ - clusters) + " of " + std::to_string(triangles_) +
        " triangles are joined to convex parts");
  }

  static thread_local Report* current_;

  const std::string& name_;
  std::size_t triangles_;
  const Progress& progress_;
  Clock::time_point next_ = Clock::now() + kBetweenLines;
};

thread_local Report* Report::current_ = nullptr;

/// Parts of the surface that are flat get the skin behind it.
void give_inside(const Mesh& mesh, const long* partition, std::vector<Hull>& hulls) {
  const std::vector<Hull> skin = skin_of(mesh);
  std::vector<bool> is_flat;
  is_flat.reserve(hulls.size());
  for (const Hull& hull : hulls) is_flat.push_back(!has_inside(hull.vertices));
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto part = static_cast<std::size_t>(partition[t]);
    if (!is_flat[part]) continue;
    auto& vertices = hulls[part].vertices;
    vertices.insert(vertices.end(), skin[t].vertices.begin(), skin[t].vertices.end());
  }
}

std::vector<Hull> decompose(const Mesh& mesh) {
  std::vector<HACD::Vec3<HACD::Real>> points;
  std::vector<HACD::Vec3<long>> triangles;
  for (const Vector3& p : mesh.points) points.emplace_back(p.x(), p.y(), p.z());
  for (const auto& t : mesh.triangles) triangles.emplace_back(t[0], t[1], t[2]);
  HACD::HACD hacd;
  hacd.SetPoints(points.data());
  hacd.SetNPoints(points.size());
  hacd.SetTriangles(triangles.data());
  hacd.SetNTriangles(triangles.size());
  hacd.SetCompacityWeight(kCompactness);
  hacd.SetVolumeWeight(0);
  hacd.SetNClusters(1);
  hacd.SetConcavity(kConcavity);
  hacd.SetAddExtraDistPoints(true);
  hacd.SetAddNeighboursDistPoints(true);
  hacd.SetAddFacesPoints(true);
  hacd.SetCallBack(&Report::hear);
  if (!hacd.Compute()) throw std::runtime_error("no convex decomposition was found");
  std::vector<Hull> hulls(hacd.GetNClusters());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    Hull& hull = hulls[static_cast<std::size_t>(hacd.GetPartition()[t])];
    for (std::size_t i = 0; i < 3; ++i) hull.vertices.push_back(mesh.corner(t, i));
  }
  give_inside(mesh, hacd.GetPartition(), hulls);
  for (Hull& hull : hulls) hull.vertices = convex_hull(hull.vertices).vertices;
  return hulls;
}

}  // namespace

std::vector<Hull> decomposed(const Mesh& mesh, const std::string& name, const Progress& progress) {
  if (mesh.triangles.size() > kMostToDecompose) {
    throw std::runtime_error(std::to_string(mesh.triangles.size()) + " triangles; at most " +
                             std::to_string(kMostToDecompose) +
                             " are allowed for a concave mesh that moves");
  }
  const double parameters[] = {kConcavity, kCompactness};
  const std::filesystem::path file = kept_file(mesh, parameters);
  if (auto known = read_kept(file)) return *known;
  const Report report(name, mesh.triangles.size(), progress);
  report.end_if_stopped();
  report.say("convex parts are made of its " + std::to_string(mesh.triangles.size()) +
             " triangles, and kept for the next time");
  std::vector<Hull> hulls = decompose(mesh);
  if (!file.empty()) keep(file, hulls);
  return hulls;
}

}  // namespace hlm::ve
