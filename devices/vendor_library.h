// A vendor's library, opened when a device of it is asked for.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace hlm::server {

/// Stays open until the program ends: its threads, and texts that it has given, may outlive what
/// asked for it.
class VendorLibrary {
 public:
  /// Opens `file` if it is given, otherwise the first of `names` that the dynamic linker finds
  /// (LD_LIBRARY_PATH, /etc/ld.so.conf). source: where a person gets it. Throws std::runtime_error
  /// that says what was searched, why nothing would do, and `source`.
  VendorLibrary(const std::string& file, const std::vector<std::string>& names,
                const std::string& source);

  /// The library's name as it was asked for.
  const std::string& name() const noexcept { return name_; }
  /// The library's name, and the file found by it, links resolved, which tells its version:
  /// "libdhd.so (/usr/lib/libdhd.so.3.17.6)".
  std::string description() const;
  /// Sets `function`, whose type must be the symbol's. Throws std::runtime_error naming the library
  /// and the symbol if there is none.
  template <class Function>
  void bind(Function*& function, const char* symbol) const {
    function = reinterpret_cast<Function*>(address_of(symbol));
  }
  /// The same where the library may lack the symbol: null.
  template <class Function>
  void bind_if_any(Function*& function, const char* symbol) const noexcept {
    function = reinterpret_cast<Function*>(find(symbol));
  }

 private:
  void* find(const char* symbol) const noexcept;
  void* address_of(const char* symbol) const;

  std::string name_;
  void* handle_ = nullptr;
};

}  // namespace hlm::server
