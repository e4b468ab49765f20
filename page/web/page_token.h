// The word without which the live page answers nobody.
#pragma once

#include <string>
#include <string_view>

namespace hlm::ve {

/// Where a browser shows it: in the target of a request, which wins, or in the cookie that an
/// answer to such a request set, for the files that a page loads by itself.
struct TokenPlaces {
  std::string_view target;  ///< Path and query, for example "/session?token=0123".
  std::string_view cookies;
};

/// Guards nothing if it is empty.
class PageToken {
 public:
  /// `port` is in the cookie's name: browsers send it to every port of the machine.
  PageToken(std::string token, std::string_view port);
  /// 128 random bits of the system, 32 hexadecimal digits.
  static std::string random();

  /// Whether a request shows it, compared in a time that does not depend on what is shown.
  bool is_shown(const TokenPlaces& places) const;
  /// For Set-Cookie; empty without a token.
  std::string cookie() const;

 private:
  std::string token_;
  std::string cookie_name_;
};

}  // namespace hlm::ve
