#include "hlm/web/host_names.h"

#include <algorithm>
#include <cctype>

namespace hlm::ve {
namespace {

bool equal_but_for_case(std::string_view a, std::string_view b) {
  const auto lower = [](char c) { return std::tolower(static_cast<unsigned char>(c)); };
  return std::ranges::equal(a, b, {}, lower, lower);
}

}  // namespace

HostNames::HostNames(const std::string& address, std::uint16_t port)
    : names_{"localhost", "127.0.0.1"} {
  if (address != names_[1]) names_.push_back(address);
  constexpr std::uint16_t kHttp = 80;
  if (port == kHttp) return;
  for (std::string& name : names_) name.append(":").append(std::to_string(port));
}

bool HostNames::is_host(std::string_view host) const {
  return std::ranges::any_of(
      names_, [&](const std::string& name) { return equal_but_for_case(name, host); });
}

bool HostNames::is_origin(std::string_view origin, std::string_view host) const {
  constexpr std::string_view kScheme = "http://";
  return is_host(host) && origin.starts_with(kScheme) &&
         equal_but_for_case(origin.substr(kScheme.size()), host);
}

std::string HostNames::list() const {
  std::string list;
  for (const std::string& name : names_) list.append(list.empty() ? "" : ", ").append(name);
  return list;
}

}  // namespace hlm::ve
