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
  /// the port unless it is 80, which browsers leave out. partner: the port of the one other server
  /// of this machine whose pages are taken, too; 0: none.
  HostNames(const std::string& address, std::uint16_t port, std::uint16_t partner = 0);

  /// Whether a Host header is one of the names, in whatever case.
  bool is_host(std::string_view host) const;
  /// Whether an Origin header is http:// and the Host header that came with it, one of the names,
  /// with the port of that or the partner's.
  bool is_origin(std::string_view origin, std::string_view host) const;
  /// The names as text, for example "localhost:8080, 127.0.0.1:8080".
  std::string list() const;

 private:
  std::vector<std::string> names_;
  std::vector<std::string> partners_;  ///< The same names with the partner's port; empty: none.
};

}  // namespace hlm::ve
