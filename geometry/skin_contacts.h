// Which contact with a skin of triangles is one of the frame before, on another triangle?
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "hlm/geometry/pieces.h"

namespace hlm::geometry {

/// Whether a contact is with a mesh that is a skin of triangles.
bool is_on_skin(const Pieces& pieces, const FoundContact& contact);

/// Gives contacts with skins of triangles, and with what adjoins one, names of their own, which go
/// on where a contact leaves one triangle for the next. By feature pairs it would be another one
/// there, and the proxy's deformation would be lost at each edge.
class SkinContacts {
 public:
  /// Renames those of a frame's contacts that are with a skin or by one. `X_WL`: the poses of the
  /// tool's links in which they were found. Call once a frame.
  void name(const Pieces& pieces, const std::function<Pose(int link)>& X_WL,
            std::vector<FoundContact>& contacts);

 private:
  struct Known {
    ContactKey found;  ///< Key as it was found.
    ContactKey name;
    Vector3 p_L;  ///< Point on the tool, in its link, m.
    Vector3 n_W;
  };

  std::vector<Known> known_;  ///< Contacts of the frame before.
  std::uint32_t next_ = 0;
};

}  // namespace hlm::geometry
