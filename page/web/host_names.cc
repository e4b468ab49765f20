#include "hlm/page/web/host_names.h"

#include <algorithm>
#include <cctype>

namespace hlm::ve {
namespace {

bool equal_but_for_case(std::string_view a, std::string_view b) {
  const auto lower = [](char c) { return std::tolower(static_cast<unsigned char>(c)); };
  return std::ranges::equal(a, b, {}, lower, lower);
}

std::vector<std::string> names_of(const std::string& address, std::uint16_t port) {
  std::vector<std::string> names{"localhost", "127.0.0.1"};
  if (address != names[1]) names.push_back(address);
  constexpr std::uint16_t kHttp = 80;
  if (port == kHttp) return names;
  for (std::string& name : names) name.append(":").append(std::to_string(port));
  return names;
}

}  // namespace

HostNames::HostNames(const std::string& address, std::uint16_t port, std::uint16_t partner)
    : names_(names_of(address, port)) {
  if (partner != 0) partners_ = names_of(address, partner);
}

bool HostNames::is_host(std::string_view host) const {
  return std::ranges::any_of(
      names_, [&](const std::string& name) { return equal_but_for_case(name, host); });
}

bool HostNames::is_origin(std::string_view origin, std::string_view host) const {
  constexpr std::string_view kScheme = "http://";
  if (!origin.starts_with(kScheme)) return false;
  const std::string_view from = origin.substr(kScheme.size());
  for (std::size_t i = 0; i < names_.size(); ++i) {
    if (!equal_but_for_case(names_[i], host)) continue;
    return equal_but_for_case(from, host) ||
           (!partners_.empty() && equal_but_for_case(from, partners_[i]));
  }
  return false;
}

std::string HostNames::list() const {
  std::string list;
  for (const std::string& name : names_) list.append(list.empty() ? "" : ", ").append(name);
  return list;
}

}  // namespace hlm::ve
