#include "hlm/scene/resources.h"

#include <cstdlib>
#include <sstream>
#include <string_view>

namespace hlm::ve {
namespace {

namespace fs = std::filesystem;

void add_folders(const char* variable, std::vector<fs::path>& folders) {
  const char* value = std::getenv(variable);
  std::istringstream list(value != nullptr ? value : "");
  for (std::string folder; std::getline(list, folder, ':');) {
    if (!folder.empty()) folders.emplace_back(folder);
  }
}

std::vector<fs::path> search_path() {
  std::vector<fs::path> folders;
  for (const char* variable : {"SDF_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH",
                               "GAZEBO_MODEL_PATH", "GAZEBO_RESOURCE_PATH"}) {
    add_folders(variable, folders);
  }
  return folders;
}

fs::path folder_of(const fs::path& file) {
  std::error_code error;
  const fs::path absolute = fs::absolute(file.empty() ? "world" : file, error);
  return absolute.parent_path().lexically_normal();
}

/// The folder of `file` and all above it.
void add_parents(const fs::path& file, std::vector<fs::path>& folders) {
  for (fs::path folder = folder_of(file);; folder = folder.parent_path()) {
    folders.push_back(folder);
    if (folder == folder.parent_path()) return;
  }
}

std::optional<fs::path> find_in(const std::vector<fs::path>& folders, const fs::path& relative) {
  for (const fs::path& folder : folders) {
    std::error_code error;
    fs::path found = (folder / relative).lexically_normal();
    if (fs::exists(found, error)) return found;
  }
  return std::nullopt;
}

}  // namespace

std::optional<fs::path> find_resource(const std::string& uri, const fs::path& file) {
  constexpr std::string_view kMark = "://";
  const std::size_t mark = uri.find(kMark);
  const std::string scheme = mark == uri.npos ? "" : uri.substr(0, mark);
  const std::string rest = mark == uri.npos ? uri : uri.substr(mark + kMark.size());
  if (rest.empty()) return std::nullopt;
  std::vector<fs::path> folders;
  if (scheme == "model" || scheme == "package") {
    if (scheme == "package") add_folders("ROS_PACKAGE_PATH", folders);
    for (const fs::path& folder : search_path()) folders.push_back(folder);
    add_parents(file, folders);
  } else if (scheme.empty() || scheme == "file") {
    folders.push_back(folder_of(file));  // An absolute path replaces it.
    for (const fs::path& folder : search_path()) folders.push_back(folder);
  }
  return find_in(folders, rest);
}

std::string resource_remedy(const std::string& uri) {
  if (uri.starts_with("http")) {
    return "download it, and put its folder into SDF_PATH or beside the file";
  }
  if (uri.starts_with("package://")) {
    return "set ROS_PACKAGE_PATH to the folder that holds the package";
  }
  if (uri.starts_with("model://")) {
    return "set SDF_PATH or GZ_SIM_RESOURCE_PATH to the folder that holds the model's folder";
  }
  return "give a path relative to the file, or set SDF_PATH";
}

}  // namespace hlm::ve
