// The names under which a browser may ask for the live page.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace hlm::ve {

/// Browsers run pages of strangers too. A name that is not one of these may be a stranger's that
/// was made to point here (DNS rebinding); an address cannot.
class HostNames {
 public:
  /// localhost, 127.0.0.1 and `address`, that of this machine to which a connection came, each with
  /// the port unless it is 80, which browsers leave out.
  HostNames(const std::string& address, std::uint16_t port);

  /// Whether a Host header is one of the names, in whatever case.
  bool is_host(std::string_view host) const;
  /// Whether an Origin header is http:// and the Host header that came with it, one of the names.
  bool is_origin(std::string_view origin, std::string_view host) const;
  /// The names as text, for example "localhost:8080, 127.0.0.1:8080".
  std::string list() const;

 private:
  std::vector<std::string> names_;
};

}  // namespace hlm::ve
