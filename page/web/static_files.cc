#include "hlm/page/web/static_files.h"

#include <algorithm>
#include <array>
#include <string>
#include <system_error>
#include <utility>

namespace hlm::ve {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kModules = "node_modules";

constexpr std::array<std::pair<std::string_view, std::string_view>, 9> kContentTypes = {{
    {".html", "text/html; charset=utf-8"},
    {".css", "text/css; charset=utf-8"},
    {".js", "text/javascript; charset=utf-8"},
    {".mjs", "text/javascript; charset=utf-8"},
    {".json", "application/json"},
    {".map", "application/json"},
    {".svg", "image/svg+xml"},
    {".png", "image/png"},
    {".ico", "image/x-icon"},
}};

/// Empty for kinds that are not served.
std::string_view content_type(const fs::path& path) {
  const std::string extension = path.extension().string();
  for (const auto& [known, type] : kContentTypes) {
    if (extension == known) return type;
  }
  return {};
}

bool is_plain(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
         std::string_view("/-_.@+~").find(c) != std::string_view::npos;
}

/// The target's path below the root; none if it is not made of plain names.
std::optional<fs::path> relative_path(std::string_view target) {
  target = target.substr(0, target.find('?'));
  if (target.empty() || target.front() != '/') return std::nullopt;
  if (target == "/") return "index.html";
  target.remove_prefix(1);
  if (target.front() == '/' || !std::all_of(target.begin(), target.end(), is_plain)) {
    return std::nullopt;
  }
  fs::path path(target);
  for (const fs::path& name : path) {
    if (name.empty() || name.native().front() == '.') return std::nullopt;
  }
  return path;
}

/// Both without symbolic links.
bool is_below(const fs::path& path, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first ==
         folder.end();
}

bool is_allowed(const fs::path& root, const fs::path& relative, const fs::path& path) {
  std::error_code error;
  const fs::path real_root = fs::canonical(root, error);
  if (!error && is_below(path, real_root)) return true;
  if (*relative.begin() != kModules) return false;
  const fs::path modules = fs::canonical(root / kModules, error);
  return !error && is_below(path, modules);
}

}  // namespace

std::optional<StaticFile> find_static_file(const fs::path& root, std::string_view target) {
  const std::optional<fs::path> relative = relative_path(target);
  if (!relative) return std::nullopt;
  std::error_code error;
  fs::path path = fs::canonical(root / *relative, error);
  if (error || !fs::is_regular_file(path, error)) return std::nullopt;
  // A link's own name counts as well as the name of what it leads to.
  const std::string_view type = content_type(*relative);
  if (type.empty() || content_type(path).empty()) return std::nullopt;
  if (!is_allowed(root, *relative, path)) return std::nullopt;
  return StaticFile{std::move(path), type};
}

}  // namespace hlm::ve
