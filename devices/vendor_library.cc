#include "hlm/devices/vendor_library.h"

#include <filesystem>
#include <stdexcept>

#include <dlfcn.h>
#include <link.h>

namespace hlm::server {
namespace {

/// The dynamic linker's reason, for a person.
std::string reason(const std::string& name) {
  const std::string error = dlerror();
  return error.starts_with(name + ": cannot open shared object file: No such") ? name + " not found"
                                                                               : error;
}

}  // namespace

VendorLibrary::VendorLibrary(const std::string& file, const std::vector<std::string>& names,
                             const std::string& source) {
  std::string searched;
  for (const std::string& name : file.empty() ? names : std::vector{file}) {
    handle_ = dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (handle_ != nullptr) {
      name_ = name;
      return;
    }
    searched += (searched.empty() ? "" : ", ") + reason(name);
  }
  throw std::runtime_error("the vendor's library cannot be opened: " + searched + ". Get it from " +
                           source + ", and give its file as the key 'library' or its folder in " +
                           "LD_LIBRARY_PATH");
}

std::string VendorLibrary::description() const {
  const link_map* map = nullptr;
  if (dlinfo(handle_, RTLD_DI_LINKMAP, &map) != 0 || map == nullptr) return name_;
  std::error_code error;
  const std::filesystem::path file = std::filesystem::canonical(map->l_name, error);
  return error || file == name_ ? name_ : name_ + " (" + file.string() + ')';
}

void* VendorLibrary::find(const char* symbol) const noexcept { return dlsym(handle_, symbol); }

void* VendorLibrary::address_of(const char* symbol) const {
  void* const address = find(symbol);
  if (address == nullptr) {
    throw std::runtime_error(name_ + " has no function " + symbol +
                             ": it is another library, or too old");
  }
  return address;
}

}  // namespace hlm::server
