// Which contacts are reported, out of all that were found?
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "hlm/geometry/feature.h"

namespace hlm::geometry {

/// Most contacts that are reported. More cost the server time; fewer no longer hold a large face.
inline constexpr std::size_t kMaxSelected = 64;

/// Chooses the contacts to report, frame by frame: what was reported in the frame before goes on
/// unless another contact is clearly better, so that identities last.
class ContactSelection {
 public:
  /// The contacts to report, at most kMaxSelected, sorted by key. They depend on the set of
  /// candidates and on what was selected before, not on the candidates' order. Valid until the next
  /// call.
  ///
  /// Contacts of the same two sides that lie within a millimetre of each other, or a fiftieth of
  /// the extent of all contacts if that is less, and have normals within 0.1 rad are a cluster: the
  /// one of the smallest separation stands for it. If there are still too many, of each face of the
  /// tool that touches, that is of each normal, the deepest and the outermost ones stay, so that
  /// the tool can neither sink nor tilt. Of the others, the smallest separations stay, and of those
  /// that differ by less than a millimetre the ones that lie farthest apart.
  ///
  /// `planar_normal_W`: unit normal of the plane of motion of a planar tool, none for other tools.
  /// A contact of such a tool whose normal is that of the plane constrains nothing and is left
  /// out, and contacts of one link with one body that are equal except for a shift along the
  /// plane's normal are one constraint: the one with the smallest key stays.
  std::span<const FoundContact> select(std::span<const FoundContact> candidates,
                                       const std::optional<Vector3>& planar_normal_W);

 private:
  bool was_selected(const FoundContact& contact) const;
  double rank(const FoundContact& contact) const;
  void cluster(std::vector<FoundContact>& contacts) const;
  std::vector<FoundContact> most_telling(const std::vector<FoundContact>& contacts) const;

  std::vector<FoundContact> selected_;  ///< Sorted by key.
};

}  // namespace hlm::geometry
