#include "hlm/ve_client/scene/resources.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstdlib>
#include <sstream>
#include <string_view>

namespace hlm::ve {
namespace {

namespace fs = std::filesystem;

constexpr std::array kSearchPath{"SDF_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH",
                                 "GAZEBO_MODEL_PATH", "GAZEBO_RESOURCE_PATH"};
/// Hosts of Fuel's addresses, and folders of its caches.
constexpr std::array kFuelHosts{"fuel.gazebosim.org", "app.gazebosim.org",
                                "fuel.ignitionrobotics.org", "app.ignitionrobotics.org"};

std::string value_of(const char* variable) {
  const char* value = std::getenv(variable);
  return value != nullptr ? value : "";
}

std::vector<fs::path> folders_of(const char* variable) {
  std::vector<fs::path> folders;
  std::istringstream list(value_of(variable));
  for (std::string folder; std::getline(list, folder, ':');) {
    if (!folder.empty()) folders.emplace_back(folder);
  }
  return folders;
}

bool is_there(const fs::path& path) {
  std::error_code error;
  return fs::exists(path, error);
}

fs::path folder_of(const fs::path& file) {
  std::error_code error;
  const fs::path absolute = fs::absolute(file.empty() ? "world" : file, error);
  return absolute.parent_path().lexically_normal();
}

std::string lowered(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

/// "Construction%20Cone" as it is meant.
std::string decoded(const std::string& text) {
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned code = 0;
    const bool coded =
        text[i] == '%' && i + 2 < text.size() &&
        std::from_chars(&text[i + 1], &text[i + 1] + 2, code, 16).ptr == &text[i + 1] + 2;
    result += coded ? static_cast<char>(code) : text[i];
    if (coded) i += 2;
  }
  return result;
}

/// The number that a folder of Fuel has for a version; -1 if it is none.
int version_of(const std::string& name) {
  int version = -1;
  const char* end = name.data() + name.size();
  const auto [stop, error] = std::from_chars(name.data(), end, version);
  return error == std::errc() && stop == end ? version : -1;
}

std::vector<fs::path> folders_in(const fs::path& folder) {
  std::vector<fs::path> folders;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code unknown;
    if (entry->is_directory(unknown)) folders.push_back(entry->path());
  }
  std::ranges::sort(folders);
  return folders;
}

/// What an address of Fuel names.
struct FuelName {
  std::string owner;  ///< Empty: any.
  std::string model;
  std::string version;  ///< Empty or "tip": the newest.
  fs::path rest;        ///< Path in the model's folder.
};

std::optional<FuelName> parse_fuel(const std::string& uri) {
  const std::size_t mark = uri.find("://");
  if (mark == uri.npos || !uri.starts_with("http")) return std::nullopt;
  std::vector<std::string> words;
  std::istringstream path(uri.substr(mark + 3));
  for (std::string word; std::getline(path, word, '/');) {
    if (!word.empty()) words.push_back(decoded(word));
  }
  if (words.empty() || std::ranges::find(kFuelHosts, lowered(words[0])) == kFuelHosts.end()) {
    return std::nullopt;
  }
  const auto models = std::ranges::find(words, "models");
  if (models - words.begin() < 2 || words.end() - models < 2) return std::nullopt;
  // "1.0/OWNER/models/NAME", or "OWNER/fuel/models/NAME" as a browser shows it.
  const auto owner =
      *(models - 1) == "fuel" && models - words.begin() > 2 ? models - 2 : models - 1;
  FuelName name{*owner, *(models + 1), "", {}};
  auto next = models + 2;
  if (next != words.end() && (*next == "tip" || version_of(*next) >= 0)) name.version = *next++;
  if (next != words.end() && *next == "files") ++next;
  for (; next != words.end(); ++next) name.rest /= *next;
  return name;
}

std::vector<fs::path> fuel_caches() {
  std::vector<fs::path> caches;
  for (const char* variable : {"GZ_FUEL_CACHE_PATH", "IGN_FUEL_CACHE_PATH"}) {
    for (const fs::path& folder : folders_of(variable)) caches.push_back(folder);
  }
  const fs::path home = value_of("HOME");
  if (home.empty()) return caches;
  for (const char* folder : {".gz/fuel", ".ignition/fuel"}) caches.push_back(home / folder);
  return caches;
}

/// Without a slash at the end where nothing follows.
fs::path joined(const fs::path& folder, const fs::path& rest) {
  return rest.empty() ? folder : folder / rest;
}

/// The newest of a model's folders of versions that holds what is named; empty if none does.
fs::path find_version(const fs::path& model, const FuelName& name) {
  const bool any = name.version.empty() || name.version == "tip";
  fs::path best;
  int newest = -1;
  for (const fs::path& folder : folders_in(model)) {
    const std::string own = folder.filename().string();
    if (version_of(own) <= newest || (!any && own != name.version)) continue;
    if (!is_there(joined(folder, name.rest))) continue;
    best = folder;
    newest = version_of(own);
  }
  return best;
}

/// The folders in `folder` of this name, in any case; all if it is empty.
std::vector<fs::path> folders_called(const fs::path& folder, const std::string& name) {
  std::vector<fs::path> folders = folders_in(folder);
  std::erase_if(folders, [&](const fs::path& each) {
    return !name.empty() && lowered(each.filename().string()) != lowered(name);
  });
  return folders;
}

/// The folder of a model's version in a cache; empty if it is not there.
fs::path find_in_cache(const fs::path& cache, const FuelName& name) {
  for (const fs::path& host : folders_in(cache)) {
    for (const fs::path& owner : folders_called(host, name.owner)) {
      for (const fs::path& model : folders_called(owner / "models", name.model)) {
        fs::path version = find_version(model, name);
        if (!version.empty()) return version;
      }
    }
  }
  return {};
}

/// Looks at one place after the other, and keeps in mind which.
class Search {
 public:
  Search(const std::string& uri, const fs::path& file) : folder_(folder_of(file)) {
    constexpr std::string_view kMark = "://";
    const std::size_t mark = uri.find(kMark);
    const std::string scheme = mark == uri.npos ? "" : uri.substr(0, mark);
    const std::string rest = mark == uri.npos ? uri : uri.substr(mark + kMark.size());
    if (rest.empty()) return;
    if (scheme == "package") {
      try_packages(rest);
      try_models(rest);
    } else if (scheme == "model") {
      try_models(rest);
      try_packages(rest);  // libsdformat makes model:// of URDF's package://.
    } else if (scheme.empty() || scheme == "file") {
      try_place(folder_, rest);  // An absolute path replaces it.
      if (!fs::path(rest).is_absolute()) try_search_path(rest);
    } else if (const auto name = parse_fuel(uri)) {
      try_caches(*name);
    }
  }

  const std::optional<fs::path>& found() const { return found_; }
  /// The places, in their order.
  const std::string& places() const { return places_; }
  /// The variables that name none.
  const std::string& unset() const { return unset_; }

 private:
  static void add(std::string& list, const std::string& text) {
    list.append(list.empty() ? "" : ", ").append(text);
  }

  void try_path(const fs::path& path) {
    if (!found_ && is_there(path)) found_ = path.lexically_normal();
  }

  void try_place(const fs::path& folder, const fs::path& relative) {
    add(places_, (folder / relative).lexically_normal().string());
    try_path(folder / relative);
  }

  void try_variable(const char* variable, const fs::path& relative) {
    const std::vector<fs::path> folders = folders_of(variable);
    if (folders.empty()) add(unset_, variable);
    for (const fs::path& folder : folders) try_place(folder, relative);
  }

  void try_search_path(const fs::path& relative) {
    for (const char* variable : kSearchPath) try_variable(variable, relative);
  }

  void try_packages(const fs::path& relative) {
    const std::string name = relative.begin()->string();
    try_variable("ROS_PACKAGE_PATH", relative);
    for (const fs::path& folder : folders_of("ROS_PACKAGE_PATH")) {
      // The package itself may stand there.
      if (folder.filename() == name) try_place(folder.parent_path(), relative);
    }
    try_variable("AMENT_PREFIX_PATH", fs::path("share") / relative);
  }

  void try_models(const fs::path& relative) {
    try_search_path(relative);
    const std::string name = relative.begin()->string();
    const fs::path rest = relative == name ? fs::path() : relative.lexically_relative(name);
    add(places_, (folder_ / relative).string() + " and in all folders above");
    for (fs::path folder = folder_;; folder = folder.parent_path()) {
      try_path(folder / relative);
      // A file of Fuel is in NAME/VERSION.
      const bool own = lowered(folder.parent_path().filename().string()) == lowered(name);
      if (own && version_of(folder.filename().string()) >= 0) try_path(joined(folder, rest));
      if (folder == folder.parent_path()) break;
    }
    if (const fs::path home = value_of("HOME"); !home.empty()) {
      try_place(home / ".gazebo/models", relative);
    }
    try_caches({"", name, "", rest});
  }

  void try_caches(const FuelName& name) {
    const fs::path below = fs::path("*") / (name.owner.empty() ? "*" : name.owner) / "models" /
                           name.model / (version_of(name.version) < 0 ? "*" : name.version);
    for (const fs::path& cache : fuel_caches()) {
      add(places_, (cache / below).string());
      const fs::path folder = found_ ? fs::path() : find_in_cache(cache, name);
      if (!folder.empty()) try_path(joined(folder, name.rest));
    }
  }

  fs::path folder_;  ///< Folder of the file in which the URI stands.
  std::optional<fs::path> found_;
  std::string places_;
  std::string unset_;
};

std::string how_to_find(const std::string& uri) {
  if (parse_fuel(uri)) return "download it with 'gz fuel download -u' and its address";
  if (uri.find("://") != uri.npos && !uri.starts_with("file://") &&
      !uri.starts_with("package://") && !uri.starts_with("model://")) {
    return "download it, and give a path";
  }
  if (uri.starts_with("package://")) {
    return "set ROS_PACKAGE_PATH to the folder that holds the package";
  }
  if (uri.starts_with("model://")) {
    return "set SDF_PATH or GZ_SIM_RESOURCE_PATH to the folder that holds the model's folder";
  }
  return "give a path relative to the file, or set SDF_PATH";
}

}  // namespace

std::optional<fs::path> find_resource(const std::string& uri, const fs::path& file) {
  return Search(uri, file).found();
}

std::string resource_remedy(const std::string& uri, const fs::path& file) {
  const Search search(uri, file);
  std::string text = how_to_find(uri);
  if (!search.places().empty()) text.append("; looked for ").append(search.places());
  if (!search.unset().empty()) text.append("; not set: ").append(search.unset());
  return text;
}

}  // namespace hlm::ve
