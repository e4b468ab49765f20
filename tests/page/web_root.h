// A folder of files for a test, removed after it.
#pragma once

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include <stdlib.h>

namespace hlm::ve::test {

class WebRoot {
 public:
  WebRoot() {
    std::string name = (std::filesystem::temp_directory_path() / "hlm_web_XXXXXX").string();
    if (!mkdtemp(name.data())) throw std::runtime_error("no temporary folder");
    path_ = name;
  }
  ~WebRoot() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  WebRoot(const WebRoot&) = delete;
  WebRoot& operator=(const WebRoot&) = delete;

  const std::filesystem::path& path() const { return path_; }

  /// Writes a file and the folders to it.
  void write(const std::filesystem::path& name, const std::string& text) const {
    std::filesystem::create_directories((path_ / name).parent_path());
    std::ofstream(path_ / name) << text;
  }

  /// Makes a symbolic link in the folder.
  void link(const std::filesystem::path& name, const std::filesystem::path& to) const {
    std::filesystem::create_symlink(to, path_ / name);
  }

 private:
  std::filesystem::path path_;
};

}  // namespace hlm::ve::test
