#include "hlm/geometry/expanding_polytope.h"

#include <array>
#include <cstdint>
#include <limits>

#include "hlm/common/static_vector.h"
#include "hlm/geometry/tolerances.h"
#include "hlm/geometry/work.h"

namespace hlm::geometry {
namespace {

/// Most points of the polytope. Of 180,000 curved pairs up to 20 mm deep one in 300 takes more than
/// 64, two take more than 256: those with a circle of equally good normals. A pair for which this
/// is too small is refused.
constexpr std::size_t kMaxPoints = 1024;
/// Most faces and edges that are looked at, 1 ns each, where the cores overlap more deeply than is
/// promised. Pairs of shapes that are seen every day take less than a hundredth.
constexpr std::size_t kMostWork = 2'000'000;
constexpr std::size_t kMaxFaces = 2 * kMaxPoints;
/// Work of a point that is added, besides that of the faces and edges looked at.
constexpr std::uint64_t kPointWork = 100;

using Index = std::uint16_t;

struct Face {
  Vector3 u;      ///< Unit, outward.
  double offset;  ///< Offset of the face's plane along u, m.
  std::array<Index, 3> corners;
};

struct Edge {
  Index from;
  Index to;
};

/// A convex polytope inside the Minkowski difference tool - body.
class Polytope {
 public:
  explicit Polytope(const CorePair& pair) noexcept : pair_(pair) {}

  /// The farthest point of the Minkowski difference along u.
  Vector3 support(const Vector3& u) const noexcept {
    return pair_.tool_support(u) - pair_.body_support(-u);
  }

  /// Four or five points that span a volume. False if there are none.
  bool begin(const Vector3& toward) noexcept {
    const Vector3 a = support(toward);
    const Vector3 b = support(-toward);
    const Vector3 line = b - a;
    if (!(line.norm() > narrow::kAdvantage)) return false;
    const Vector3 e = line.unitOrthogonal();
    const Vector3 f = line.cross(e).normalized();
    Vector3 c = a;
    double widest = narrow::kAdvantage;
    for (const Vector3& across : {e, Vector3(-e), f, Vector3(-f)}) {
      const Vector3 candidate = support(across);
      const double width = std::abs(across.dot(candidate - a));
      if (width > widest) {
        widest = width;
        c = candidate;
      }
    }
    const Vector3 area = line.cross(c - a);
    if (!(area.norm() > narrow::kAdvantage * line.norm())) return false;
    const Vector3 n = area.normalized();
    const Vector3 above = support(n);
    const Vector3 below = support(-n);
    const bool up = n.dot(above - a) > n.dot(a - below);
    const Vector3& top = up ? above : below;
    if (!(std::abs(n.dot(top - a)) > narrow::kAdvantage)) return false;
    for (const Vector3& p : {a, b, c, top}) points_.push_back(p);
    const bool built =
        up ? add_face(0, 2, 1) && add_face(0, 1, 3) && add_face(1, 2, 3) && add_face(2, 0, 3)
           : add_face(0, 1, 2) && add_face(1, 0, 3) && add_face(2, 1, 3) && add_face(0, 2, 3);
    return built && (std::abs(n.dot((up ? below : above) - a)) <= narrow::kAdvantage ||
                     add(up ? below : above));
  }

  /// How many faces and edges were looked at.
  std::size_t work() const noexcept { return work_; }

  const Face& nearest() const noexcept {
    const Face* best = &faces_[0];
    for (const Face& face : faces_) {
      if (face.offset < best->offset) best = &face;
    }
    return *best;
  }

  /// The hull of the polytope and p, which is not inside. False if rounding or room prevents it.
  bool add(const Vector3& p) noexcept {
    work_ += 2 * faces_.size();  // Here, and to find the nearest.
    Work::add(kPointWork + 2 * faces_.size());
    if (points_.size() == kMaxPoints) return false;
    border_.clear();
    for (std::size_t i = 0; i < faces_.size();) {
      if (faces_[i].u.dot(p) - faces_[i].offset < -narrow::kLength) {
        ++i;
        continue;
      }
      if (!open(faces_[i])) return false;
      faces_[i] = faces_.back();
      faces_.pop_back();
    }
    if (border_.size() < 3 || faces_.empty()) return false;
    if (faces_.size() + border_.size() > kMaxFaces) return false;
    const auto apex = static_cast<Index>(points_.size());
    points_.push_back(p);
    for (const Edge& edge : border_) {
      if (!add_face(edge.from, edge.to, apex)) return false;
    }
    return true;
  }

 private:
  /// Adds the edges of a face that is taken away to the border of the hole; an edge between two
  /// such faces is in it no longer.
  bool open(const Face& face) noexcept {
    for (std::size_t i = 0; i < 3; ++i) {
      const Edge edge{face.corners[i], face.corners[(i + 1) % 3]};
      std::size_t at = 0;
      while (at < border_.size() && !(border_[at].from == edge.to && border_[at].to == edge.from)) {
        ++at;
      }
      work_ += at;
      Work::add(at);
      if (at < border_.size()) {
        border_[at] = border_.back();
        border_.pop_back();
      } else if (border_.size() < border_.capacity()) {
        border_.push_back(edge);
      } else {
        return false;
      }
    }
    return true;
  }

  bool add_face(Index a, Index b, Index c) noexcept {
    const Vector3 area = (points_[b] - points_[a]).cross(points_[c] - points_[a]);
    const double norm = area.norm();
    if (!(norm > narrow::kSmallestArea)) return false;
    const Vector3 u = area / norm;
    faces_.push_back({u, u.dot(points_[a]), {a, b, c}});
    return true;
  }

  const CorePair& pair_;
  StaticVector<Vector3, kMaxPoints> points_;
  StaticVector<Face, kMaxFaces> faces_;
  StaticVector<Edge, 256> border_;
  std::size_t work_ = 0;
};

}  // namespace

std::optional<CoreSeparation> expanding_polytope(const CorePair& pair, const Vector3& toward,
                                                 double tolerance, double touching_upper,
                                                 bool& too_long) noexcept {
  Polytope polytope(pair);
  if (!polytope.begin(toward)) return {};
  CoreSeparation best;
  best.gap = -std::numeric_limits<double>::infinity();
  for (;;) {
    const Face face = polytope.nearest();
    best.upper = face.offset > 0 ? -face.offset : touching_upper;
    const Vector3 p = polytope.support(face.u);
    const double farthest = face.u.dot(p);
    if (-farthest > best.gap) {
      best.gap = -farthest;
      best.n_B = -face.u;
    }
    if (farthest - face.offset <= narrow::kLength || best.upper - best.gap <= tolerance)
      return best;
    too_long = Work::is_spent() || (polytope.work() > kMostWork && best.gap < -narrow::kDeepest);
    if (too_long || !polytope.add(p)) return best;
  }
}

}  // namespace hlm::geometry
