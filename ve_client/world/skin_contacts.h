// Which contact with a skin of triangles is one of the frame before, on another triangle?
#pragma once

#include <cstdint>
#include <vector>

#include "hlm/geometry/feature.h"
#include "hlm/world/virtual_tool.h"
#include "hlm/world/world.h"

namespace hlm::ve {

/// Whether a contact that Proximity found is with a mesh that is a skin of triangles.
bool is_on_skin(const World& world, const FoundContact& contact);

/// Gives contacts with meshes that are skins of triangles names of their own, which go on where a
/// contact leaves one triangle for the next. By feature pairs it would be another one there, and
/// the proxy's deformation would be lost at each edge.
class SkinContacts {
 public:
  /// Renames those of a frame's contacts that are with a skin. `tool`: in the pose in which they
  /// were found. Call once a frame.
  void name(const World& world, const VirtualTool& tool, std::vector<FoundContact>& contacts);

 private:
  struct Known {
    ContactKey found;  ///< Key as Proximity had it.
    ContactKey name;
    Vector3 p_L;  ///< Point on the tool, in its link, m.
    Vector3 n_W;
  };

  std::vector<Known> known_;  ///< Contacts of the frame before.
  std::uint32_t next_ = 0;
};

}  // namespace hlm::ve
