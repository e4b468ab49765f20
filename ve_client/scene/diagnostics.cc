#include "hlm/ve_client/scene/diagnostics.h"

#include <algorithm>

#include "hlm/common/one_line.h"

namespace hlm::ve {
namespace {

std::string summary(const Diagnostics& diagnostics) {
  const auto& findings = diagnostics.findings();
  const auto first = std::ranges::find(findings, Verdict::kRefused, &Finding::verdict);
  const int more = diagnostics.count(Verdict::kRefused) - 1;
  std::string text = first == findings.end() ? "nothing is refused" : to_string(*first);
  if (more > 0) text.append(" (and ").append(std::to_string(more)).append(" more)");
  return text;
}

}  // namespace

std::string to_string(const Place& place) {
  std::string text = place.file;
  if (!text.empty() && place.line > 0) text.append(":").append(std::to_string(place.line));
  if (!text.empty() && !place.element.empty()) text.append(": ");
  return text.append(place.element);
}

std::string to_string(const Finding& finding) {
  std::string text = to_string(finding.place);
  if (!text.empty()) text.append(": ");
  text.append(finding.what);
  if (finding.count > 1) text.append(" (").append(std::to_string(finding.count)).append(" times)");
  return one_line(text);
}

void Diagnostics::refuse(const Place& place, const std::string& what) {
  const auto is_same = [&](const Finding& other) {
    return other.place.line == place.line && other.what == what &&
           to_string(other.place) == to_string(place);
  };
  if (std::ranges::none_of(findings_, is_same)) {
    findings_.push_back({Verdict::kRefused, place, what});
  }
}

void Diagnostics::approximate(const Place& place, const std::string& what) {
  add_to_kind(Verdict::kApproximated, place, what);
}

void Diagnostics::ignore(const Place& place, const std::string& what) {
  add_to_kind(Verdict::kIgnored, place, what);
}

void Diagnostics::add_to_kind(Verdict verdict, const Place& place, const std::string& what) {
  const auto known = std::ranges::find_if(findings_, [&](const Finding& finding) {
    return finding.verdict == verdict && finding.what == what;
  });
  if (known == findings_.end()) {
    findings_.push_back({verdict, place, what});
  } else {
    ++known->count;
  }
}

int Diagnostics::count(Verdict verdict) const {
  return static_cast<int>(std::ranges::count(findings_, verdict, &Finding::verdict));
}

RefusedWorld::RefusedWorld(Diagnostics diagnostics)
    : std::runtime_error(summary(diagnostics)), diagnostics_(std::move(diagnostics)) {}

}  // namespace hlm::ve
