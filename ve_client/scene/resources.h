// Where the file is that a URI in a world file names.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace hlm::ve {

/// The file or folder that `uri`, which stands in `file`, names; empty if there is none:
/// - "model://NAME/…": NAME in a folder of the search path, or next to or above `file`;
/// - "package://NAME/…": the same, but in the folders of ROS_PACKAGE_PATH first;
/// - "file://…" or no scheme: an absolute path, or one relative to the folder of `file`, or else in
///   a folder of the search path.
/// The search path: SDF_PATH, GZ_SIM_RESOURCE_PATH, IGN_GAZEBO_RESOURCE_PATH, GAZEBO_MODEL_PATH,
/// GAZEBO_RESOURCE_PATH, with colons between folders. An empty `file` stands in the working folder.
std::optional<std::filesystem::path> find_resource(const std::string& uri,
                                                   const std::filesystem::path& file);

/// How to make a resource be found that was not: one sentence for the message.
std::string resource_remedy(const std::string& uri);

}  // namespace hlm::ve
