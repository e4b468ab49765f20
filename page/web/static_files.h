// Which file a request for the page means, and which files it may not have.
#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

namespace hlm::ve {

struct StaticFile {
  std::filesystem::path path;     ///< Without symbolic links.
  std::string_view content_type;  ///< Type with a charset where it is text.
};

/// The file that the target of an HTTP request (from its slash on, with or without a query) names
/// below `root`; "/" is index.html. None for what is not a regular file, for kinds of files other
/// than html, css, js, mjs, json, map, svg, png and ico, for names that begin with a dot or need
/// percent signs, and for symbolic links that leave the root. Only root/node_modules itself may be
/// a link to elsewhere; what is asked for below it must lie there or in the root.
std::optional<StaticFile> find_static_file(const std::filesystem::path& root,
                                           std::string_view target);

}  // namespace hlm::ve
