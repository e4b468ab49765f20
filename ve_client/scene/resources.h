// Where the file is that a URI in a world file names.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace hlm::ve {

/// The file or folder that `uri`, which stands in `file`, names; empty if there is none:
/// - "model://NAME/…": NAME in a folder of the search path, next to or above `file`, in
///   ~/.gazebo/models, of any owner in a cache of Gazebo Fuel, or as for "package://";
/// - "https://fuel.gazebosim.org/1.0/OWNER/models/NAME[/VERSION][/files/…]": in a cache of Fuel, in
///   the newest version there where none or "tip" is given;
/// - "package://NAME/…": NAME in a folder of ROS_PACKAGE_PATH, or in share/ of one of
///   AMENT_PREFIX_PATH, or else as for "model://";
/// - "file://…" or no scheme: an absolute path, or one relative to the folder of `file`, or else in
///   a folder of the search path.
/// The search path: SDF_PATH, GZ_SIM_RESOURCE_PATH, IGN_GAZEBO_RESOURCE_PATH, GAZEBO_MODEL_PATH,
/// GAZEBO_RESOURCE_PATH, with colons between folders. The caches of Fuel: GZ_FUEL_CACHE_PATH,
/// IGN_FUEL_CACHE_PATH, ~/.gz/fuel, ~/.ignition/fuel; names of owners and models in them count in
/// any case. An empty `file` stands in the working folder.
std::optional<std::filesystem::path> find_resource(const std::string& uri,
                                                   const std::filesystem::path& file);

/// For the message about a resource that was not found: every place that find_resource() looks at,
/// and how to make it be found.
std::string resource_remedy(const std::string& uri, const std::filesystem::path& file);

}  // namespace hlm::ve
