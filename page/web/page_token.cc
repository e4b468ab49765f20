#include "hlm/page/web/page_token.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include <sodium.h>

namespace hlm::ve {
namespace {

/// The value of NAME=VALUE among items with such separators; empty if there is none.
std::string_view value_of(std::string_view items, std::string_view name, char separator) {
  while (!items.empty()) {
    std::string_view item = items.substr(0, items.find(separator));
    items.remove_prefix(std::min(items.size(), item.size() + 1));
    while (item.starts_with(' ')) item.remove_prefix(1);
    if (item.starts_with(name) && item.substr(name.size()).starts_with('=')) {
      return item.substr(name.size() + 1);
    }
  }
  return {};
}

std::string_view query_of(std::string_view target) {
  const std::size_t mark = target.find('?');
  return mark == std::string_view::npos ? std::string_view() : target.substr(mark + 1);
}

}  // namespace

PageToken::PageToken(std::string token, std::string_view port)
    : token_(std::move(token)), cookie_name_("haptic_page_" + std::string(port)) {}

std::string PageToken::random() {
  std::array<unsigned char, 16> bytes{};
  randombytes_buf(bytes.data(), bytes.size());
  std::array<char, 2 * bytes.size() + 1> digits{};
  sodium_bin2hex(digits.data(), digits.size(), bytes.data(), bytes.size());
  return digits.data();
}

bool PageToken::is_shown(const TokenPlaces& places) const {
  if (token_.empty()) return true;
  std::string_view shown = value_of(query_of(places.target), "token", '&');
  if (shown.empty()) shown = value_of(places.cookies, cookie_name_, ';');
  return shown.size() == token_.size() &&
         sodium_memcmp(shown.data(), token_.data(), token_.size()) == 0;
}

std::string PageToken::cookie() const {
  return token_.empty() ? "" : cookie_name_ + '=' + token_ + "; Path=/; HttpOnly; SameSite=Strict";
}

}  // namespace hlm::ve
